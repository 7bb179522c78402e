"""Judging an imported flight, and comparing it with the model."""
