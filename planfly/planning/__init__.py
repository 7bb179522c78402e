"""Plans beyond a single one: Pareto fronts, the paper's experiments, and margins for gusts."""
