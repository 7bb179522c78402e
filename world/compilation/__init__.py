"""Compiling kernels: who is told of it."""
