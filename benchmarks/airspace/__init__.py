"""Benchmarks among zones and within bands of heights above ground."""
