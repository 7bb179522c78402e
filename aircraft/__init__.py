"""Aircraft: JSBSim models as data, performance envelope, path limits, and autopilot tracking error."""
