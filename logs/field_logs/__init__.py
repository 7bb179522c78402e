"""Logs that others wrote: of ArduPilot, PX4 and ground stations, and tracks of loggers, read into flights of ours."""
