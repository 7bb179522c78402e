"""Wind from a weather forecast: its file, and the wind that varies in time, height and place."""
