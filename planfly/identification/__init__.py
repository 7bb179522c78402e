"""Identify an aircraft from flight logs by estimating a model, which is then written, replayed and shown."""
