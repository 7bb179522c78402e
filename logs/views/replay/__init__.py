"""A recorded flight again: its timeline, instruments, frames of a movie, KML and GPX."""
