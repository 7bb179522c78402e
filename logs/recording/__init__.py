"""Flights as MCAP files: written, read, recovered."""
