"""Statistics of campaigns.

They give the probability of a flyable flight, and the strongest wind that keeps a probability.
"""
