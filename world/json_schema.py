"""The rules by which the JSON schema of a data class is made, for plain data classes that stand in an answer."""

from typing import Any, ClassVar


class DocumentConfig:
    """Base of a plain data class of which a JSON schema is made.

    pydantic reads the settings where a schema is made or an answer written; the data class itself needs no pydantic.
    The strings below its fields become the fields' descriptions, other fields are refused, and a field with a default
    is always written.
    """

    __slots__ = ()
    __pydantic_config__: ClassVar[dict[str, Any]] = {
        "extra": "forbid",
        "use_attribute_docstrings": True,
        "json_schema_serialization_defaults_required": True,
    }
