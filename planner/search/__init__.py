"""Whole searches: from a scenario to a certified plan.

Replanning in flight and explanations of failures are included.
"""
