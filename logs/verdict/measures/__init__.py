"""What rules measure with: route demands, the track laid along its path, turns and slopes."""
