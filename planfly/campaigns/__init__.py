"""Campaigns: many flights of one mission in drawn conditions, and the probability of success."""
