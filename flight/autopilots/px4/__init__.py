"""PX4's law for fixed wing."""
