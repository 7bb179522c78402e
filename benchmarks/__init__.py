"""Benchmarks: each measures and records, none fails on an absolute time."""
