"""The Cessna 172 that JSBSim ships: its metadata only; the model itself stays in JSBSim."""
