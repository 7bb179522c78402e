"""Figures of a plan, a flight and an aircraft, drawn with matplotlib."""
