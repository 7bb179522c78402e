"""The Zagi flying wing of Beard and McLain as a JSBSim model."""
