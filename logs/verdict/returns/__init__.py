"""Returns to launch from all places on the path: destinations, hazards, and suggestions."""
