"""Judgement of an imported flight, and its comparison with the model."""
