"""Evaluation of a candidate path: encoding, problem as arrays, scores, and certificate."""
