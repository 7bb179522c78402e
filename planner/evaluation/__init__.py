"""What a candidate path is evaluated by: its encoding, the problem as arrays, the scores, and the certificate."""
