"""Whole searches: from a scenario to a certified plan, replanning in flight, and explanations of failures."""
