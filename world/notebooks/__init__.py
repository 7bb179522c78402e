"""What notebooks show of planfly's results."""
