"""Identification of an aircraft's model from logs: lift, drag, thrust, moments and their uncertainty."""
