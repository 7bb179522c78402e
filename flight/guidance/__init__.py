"""Guidance: the fly-by path, lateral and vertical control laws, inner loops and gains."""
