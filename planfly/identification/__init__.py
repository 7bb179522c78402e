"""Identify an aircraft from flight logs: read and cut logs, estimate a model, then write, replay and show it."""
