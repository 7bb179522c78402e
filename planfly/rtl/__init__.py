"""Fly returns to launch in JSBSim or by a real autopilot."""
