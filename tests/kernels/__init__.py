"""What a whole run of the tests compiles before it begins."""
