"""The fields of a log's `/state` channel, from its schema."""

from logs.recording.state_channel import FIELDS


def state_fields() -> str:
    """Return the names of the state's fields in the order of the message."""
    return ", ".join(f"`{name}`" for name in ["row", *(field.name for field in FIELDS)])
