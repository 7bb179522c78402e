"""Autopilots that fly a mission: simulated by their control laws, or as external programs."""
