"""ArduPlane by its control law: parameters, one compiled tick, and its deviations from a plan."""
