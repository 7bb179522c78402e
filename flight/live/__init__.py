"""A vehicle that speaks MAVLink: link, signing, telemetry, missions and commands."""
