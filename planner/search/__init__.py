"""Whole searches for a certified plan, replanning in flight, and explanations of failures."""
