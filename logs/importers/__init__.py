"""Flight logs of other programs, read into one form."""
