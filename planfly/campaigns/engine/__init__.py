"""Workers that fly, on this machine or on a cluster."""
