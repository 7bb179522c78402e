"""Commands on logs of the field."""
