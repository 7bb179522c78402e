"""What notebooks show of a verdict."""
