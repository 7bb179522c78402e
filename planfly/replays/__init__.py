"""Play recorded flights to other programs, and draw them as movies."""
