"""HTML pages: the report of a flight and the comparison of two flights."""
