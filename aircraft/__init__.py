"""JSBSim models as data, the envelope type, and the reference equations that validate a model."""
