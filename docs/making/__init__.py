"""What pages take from the code when they are built."""
