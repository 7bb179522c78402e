"""PX4 itself: its program in lockstep with our physics."""
