"""Section V of the paper, planned again: seeded plans of its problems, and the files they come to."""
