"""ArduPlane as it will fly a mission: its parameters, its lateral law and its height and speed law."""
