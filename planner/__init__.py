"""Path planner: encodings, constraints, objectives, and estimation of distribution algorithms."""
