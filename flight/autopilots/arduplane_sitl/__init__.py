"""ArduPlane itself: its program in lockstep with planfly's physics."""
