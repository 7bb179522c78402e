"""Export a flight log to formats of other programs: tables, telemetry of a ground station, a PX4 log."""
