"""Planfly's own guidance: its lateral laws, its altitude law, and the autopilot."""
