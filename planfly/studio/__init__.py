"""The studio: a local page on which a mission is dragged, judged meanwhile, and flown afterwards."""
