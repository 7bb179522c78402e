"""Read and write mission files: WPL 110, QGroundControl's .plan, fences and rally points."""
