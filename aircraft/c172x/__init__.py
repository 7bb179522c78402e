"""The Cessna 172 that JSBSim ships: only what we need to know of it; the model itself stays JSBSim's."""
