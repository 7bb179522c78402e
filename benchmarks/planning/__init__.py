"""Comparisons of planners: independent paths, fresh instances, ablations, and the choices of the paper."""
