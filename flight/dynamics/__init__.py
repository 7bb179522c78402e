"""JSBSim behind one class: trim, model checks, envelope tables and flight characteristics."""
