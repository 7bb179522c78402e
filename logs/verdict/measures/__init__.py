"""Measurements for rules: route requirements, the track aligned with its route, turns and slopes."""
