"""Vehicles that ground stations connect to."""
