"""Identify an aircraft from flight logs: estimate a model, then write, replay and show it."""
