"""What a plan and a flight are judged against: frames, path geometry, terrain, threats, scenario."""
