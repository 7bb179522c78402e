"""What a command's kernels are compiled by beforehand: small work in units, so that two processes can share them."""
