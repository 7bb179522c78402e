"""What the programs of autopilots share that fly in lockstep with our physics."""
