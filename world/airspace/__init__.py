"""Airspace zones to keep out of or to stay in, from tables, files and fences, and distances to them."""
