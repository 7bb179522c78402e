"""The Ultra Stick 25e of the University of Minnesota as a JSBSim model."""
