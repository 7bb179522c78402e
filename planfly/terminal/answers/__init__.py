"""What commands answer with ``--json``: data with a schema a command."""
