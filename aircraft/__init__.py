"""Aircraft: JSBSim models as data, the performance envelope, path limits, and the autopilot's tracking error."""
