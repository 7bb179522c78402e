"""Returns to launch from everywhere on the way: where each goes, what it meets, what would help."""
