"""Count the fields in the formats of a PX4 log before pyulog creates them, to refuse too many.

pyulog creates all fields of a topic when the log declares the topic.  A format may contain other formats, and arrays of
them (PX4, "ULog File Format", Message Format): forty formats that each contain the next one twice take a kilobyte, but
define 2^40 fields.
"""

import re

from world.errors import LogError

# Largest number of fields in all topics of a log; PX4 itself has about 30,000.
MAX_FIELDS = 300_000
_FIELD = re.compile(r"(\w+)(?:\[(\d{1,9})\])? ")
_PLAIN = frozenset(f"{sign}int{bits}_t" for sign in ("", "u") for bits in (8, 16, 32, 64)) | {
    "float",
    "double",
    "bool",
    "char",
}


class MessageFormats:
    """The formats and the number of topic fields that the records of a log have declared so far.

    source: path of the log, for messages.
    """

    def __init__(self, source: str) -> None:
        """Start without formats and topics."""
        self._source = source
        self._formats: dict[str, list[tuple[str, int]]] = {}
        self._counts: dict[str, int] = {}
        self._total = 0

    def add_format(self, text: str) -> None:
        """Add a format from its text: its name, a colon, and its fields, each followed by a semicolon.

        >>> formats = MessageFormats("a.ulg")
        >>> formats.add_format("wind:uint64_t timestamp;float[3] wind;")
        >>> formats.count_fields("wind")
        4
        """
        name, _, fields = text.partition(":")
        # Type of each field, and its number of elements: 1, or the length of an array.
        matches = map(_FIELD.match, fields.split(";"))
        self._formats[name] = [(match[1], int(match[2] or 1)) for match in matches if match]
        self._counts.clear()

    def add_topic(self, name: str) -> None:
        """Count the fields of a topic that has the format with this name.

        Raises LogError if all topics so far have more than `MAX_FIELDS` fields.
        """
        self._total += self.count_fields(name)
        if self._total > MAX_FIELDS:
            reason = f"the formats of its messages have more than {MAX_FIELDS:,} fields"
            raise LogError(f"{self._source}: not a readable PX4 log: {reason}", file=self._source)

    def count_fields(self, name: str) -> int:
        """Return the number of fields of a format, with the fields of nested formats.

        It is above `MAX_FIELDS` for a format that contains itself.
        """
        return self._count(name, frozenset())

    def _count(self, name: str, outer_names: frozenset[str]) -> int:
        """Return the number of fields of a format; 1 for a plain type, and for a name without a format.

        Counting ends above `MAX_FIELDS`.  A format that contains itself has more than `MAX_FIELDS` fields.

        outer_names: names of the formats in which this format is nested.
        """
        if name in _PLAIN or name not in self._formats:
            return 1
        if name in outer_names:
            return MAX_FIELDS + 1
        if name not in self._counts:
            names, total = outer_names | {name}, 0
            for kind, number in self._formats[name]:
                total += number * self._count(kind, names)
                if total > MAX_FIELDS:
                    break
            self._counts[name] = total
        return self._counts[name]
