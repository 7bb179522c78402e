"""Optimisers that see a box, samples and a ranking, and know no UAV."""
