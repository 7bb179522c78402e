"""General optimisers: they see a box, samples and a ranking, and nothing specific to paths."""
