"""Simulated ArduPlane: its parameters, its compiled control law, and its deviations from a plan."""
