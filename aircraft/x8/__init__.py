"""The Skywalker X8 of Gryte et al. as a JSBSim model."""
