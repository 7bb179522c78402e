"""Replay of a recorded flight: its timeline, instruments, frames of a movie, KML and GPX."""
