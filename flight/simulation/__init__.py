"""A flight from a trimmed start to its end: the loop, its tick, its wind and its track."""
