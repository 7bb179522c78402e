"""Planfly's own guidance: its lateral laws, its height law, and the autopilot that they make."""
