"""A flight log in the forms of other programs: tables, telemetry of a ground station, a log of PX4."""
