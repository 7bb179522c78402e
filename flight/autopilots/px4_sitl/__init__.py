"""PX4 itself: its program in lockstep with planfly's physics."""
