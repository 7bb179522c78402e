"""A real autopilot as a program of its own, flying our aircraft in our physics, wind and terrain."""
