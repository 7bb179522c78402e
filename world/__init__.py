"""Environment of plans and flights: frames, path geometry, terrain, threats, scenario."""
