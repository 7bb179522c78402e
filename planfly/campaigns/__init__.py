"""Campaigns: many flights of one mission, each with its own draw of the dispersions, and the probability of success."""
