"""Plans out of traps beside the shortest ways that a fine grid finds."""
