"""Campaigns: many flights of one mission, each with its own draw of what varies, and the probability that it flies."""
