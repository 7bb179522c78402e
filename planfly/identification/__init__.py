"""Identify an aircraft from flight logs by estimating a model.

The model is then written, replayed and shown.
"""
