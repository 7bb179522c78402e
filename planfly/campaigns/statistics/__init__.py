"""Estimation of the probability of a flyable flight from a number of flights."""
