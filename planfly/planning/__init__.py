"""Plan Pareto fronts, repeat the paper's experiments, and add margins for gusts to plans."""
