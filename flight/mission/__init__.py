"""A mission and its route: items, itinerary, fences and loiters."""
