"""ArduPlane by its law: parameters, one compiled tick, and how far it strays from a plan."""
