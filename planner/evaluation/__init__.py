"""Evaluation of a candidate path: its encoding, the problem as arrays, the scores, and the certificate."""
