"""Simulation of a flight from a trimmed start to its end: loop, tick, wind and track."""
