"""Changed sources that the tests must notice: a mutation run over the verdict's rules, measures, limits and physics."""
