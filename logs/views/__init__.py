"""Views of a flight: charts, pictures and pages from one description each, replays, and exports."""
