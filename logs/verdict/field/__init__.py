"""Flights of the field: which legs they flew, how far their logs can be judged, and against what."""
