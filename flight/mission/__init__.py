"""A mission and what it asks for: its items, its itinerary, the route, fences and loiters."""
