"""Benchmarks of the cost of campaigns, and of the effect of their optimisations on results."""
