"""The table of flights on disk."""
