"""Small units of work that compile a command's kernels beforehand, shared by two processes."""
