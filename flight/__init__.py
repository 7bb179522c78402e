"""Missions and their files, JSBSim, guidance and the simulated flight."""
