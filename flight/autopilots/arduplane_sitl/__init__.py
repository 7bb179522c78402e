"""ArduPlane itself: its program in lockstep with our physics."""
