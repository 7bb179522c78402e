"""JSBSim behind one class: trims, model checks, envelope tables and flight characteristics."""
