"""Identification of an aircraft from flight logs: its model is estimated, written and replayed."""
