"""What a candidate path is judged by: its encoding, the problem as arrays, the scores, and the certificate."""
