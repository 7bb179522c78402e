"""Mission files read and written: WPL 110, QGroundControl's .plan, fences and rally points."""
