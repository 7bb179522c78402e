"""Returns to launch flown by JSBSim or by a real autopilot, and their summary."""
