"""Comparison of plans out of traps with the shortest routes on a fine grid."""
