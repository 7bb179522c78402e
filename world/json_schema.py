"""Settings for the JSON schema of plain data classes in an answer."""

from typing import Any, ClassVar


class DocumentConfig:
    """Base class for a plain data class with a JSON schema.

    pydantic reads the settings to make a schema or write an answer; the data class itself does not need pydantic.
    The strings below its fields become the fields' descriptions, unknown fields and numbers that are not finite are
    refused, and a field with a default is always written.
    """

    __slots__ = ()
    __pydantic_config__: ClassVar[dict[str, Any]] = {
        "extra": "forbid",
        "allow_inf_nan": False,
        "use_attribute_docstrings": True,
        "json_schema_serialization_defaults_required": True,
    }
