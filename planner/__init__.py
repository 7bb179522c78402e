"""Path planner.

It has encodings, constraints, objectives, preferences, and estimation of distribution algorithms.
"""
