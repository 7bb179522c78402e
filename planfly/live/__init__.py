"""Serve vehicles to which ground stations connect."""
