"""Zones of a planner: which are near a leg, how deeply it penetrates them, and its distance from them."""
