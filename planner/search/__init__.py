"""Whole searches: from a scenario to a certified plan, again in flight, and why none was found."""
