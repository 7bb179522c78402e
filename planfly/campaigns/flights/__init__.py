"""One flight of a campaign: varied, flown, judged, and told as a row."""
