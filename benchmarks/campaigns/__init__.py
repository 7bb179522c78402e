"""What campaigns cost, and whether what makes them quick changes what they say."""
