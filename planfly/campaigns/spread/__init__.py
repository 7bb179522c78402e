"""What varies from flight to flight, by which distribution, and the draw of each flight."""
