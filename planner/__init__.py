"""Path planner: encodings, constraints and objectives, preference, and estimation of distribution algorithms."""
