"""What is shown of a flight: charts, pictures and pages from one description each, replays, and files for others."""
