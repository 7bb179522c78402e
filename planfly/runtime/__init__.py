"""Processes, first compilation, progress and the checks made before any work."""
