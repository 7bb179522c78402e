"""Axes along a way: where a path's waypoints are as lengths along it and across."""
