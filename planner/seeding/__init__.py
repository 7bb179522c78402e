"""First paths: routes over grids, waypoints fitted to them, random samples, and the pattern search."""
