"""From flight logs to an aircraft's folder: logs read and cut, a model estimated, written, replayed and shown."""
