"""What planners are compared by: independent paths, fresh instances, ablations, and the choices of the paper."""
