"""Autopilots that fly a mission: by their laws in Python, and as programs of their own."""
