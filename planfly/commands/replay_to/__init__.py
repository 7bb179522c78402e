"""Where a log is replayed to beside the terminal: a film, ground stations, Foxglove."""
