"""Evaluation of a candidate path.

It has the encoding, the problem as arrays, the scores, and the certificate.
"""
