"""What a number of flights says of the probability that one flies."""
