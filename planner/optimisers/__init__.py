"""General optimisers over a box, samples and a ranking, with nothing specific to paths."""
