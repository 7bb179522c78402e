"""Recorded flights played to other programs, and as movies."""
