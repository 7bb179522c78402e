"""Shared parts of the autopilot programs that fly in lockstep with planfly's physics."""
