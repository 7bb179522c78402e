"""PX4's control law for fixed wing."""
