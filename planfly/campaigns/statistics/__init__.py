"""Statistics of campaigns: the probability of a flyable flight, and the strongest flyable wind."""
