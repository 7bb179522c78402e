"""Zones as a planner keeps out of them: which are near a leg, how deep it is in them, and how far from them."""
