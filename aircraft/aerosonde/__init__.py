"""The Aerosonde of Beard and McLain as a JSBSim model."""
