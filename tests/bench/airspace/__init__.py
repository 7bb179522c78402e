"""Benchmarks of airspace."""
