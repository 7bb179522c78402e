"""What rules measure with: route requirements, the track laid along its path, turns and slopes."""
