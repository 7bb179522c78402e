"""Flights of the field set into their world, and flown again by the model."""
