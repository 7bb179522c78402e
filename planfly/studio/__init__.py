"""The studio: a page of this machine on which a mission is dragged, judged meanwhile, and flown when it is let go."""
