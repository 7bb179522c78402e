"""The path planner: encodings, criteria, preference, and the estimation of distribution algorithms."""
