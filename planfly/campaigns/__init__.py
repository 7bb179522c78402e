"""Campaigns: many flights of one mission, and the probability of success.

Each flight has its own draw of the dispersions.
"""
