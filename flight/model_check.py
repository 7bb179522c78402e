"""Reads a JSBSim model's XML before JSBSim does, and refuses what it could do to the machine.

JSBSim opens a network port for a model with ``<input port=...>``, writes files for ``<output>``, and aborts the
process at its first step when a function names a property that does not exist.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

from world.errors import FlightError

# Elements whose text names a property that must exist when the model runs.
_READERS = frozenset({"p", "property", "independentVar", "input"})
_NAME = re.compile(r"-?\s*([A-Za-z_][\w./\[\]-]*)\Z")


@dataclass(frozen=True, slots=True)
class PropertyUse:
    """A property's name as a model's file reads it, with its line."""

    name: str
    line: int


class _Reader:
    """Collects property uses from one file's XML events and stops at the first forbidden element."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.uses: list[PropertyUse] = []
        self._path: list[str] = []
        self._text: list[str] = []
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._characters
        self._parser.StartDoctypeDeclHandler = self._doctype

    def read(self) -> None:
        try:
            self._parser.Parse(self.file.read_bytes(), True)
        except OSError as error:
            raise FlightError(f"{self.file}: the aircraft model cannot be read: {error.strerror}") from None
        except expat.ExpatError as error:
            raise FlightError(f"{self.file}: not well-formed XML: {error}") from None

    def _refuse(self, what: str) -> None:
        raise FlightError(f"{self.file}:{self._parser.CurrentLineNumber}: {what}; the model is refused")

    def _doctype(self, *_: object) -> None:
        self._refuse("a document type declaration may expand without end")

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        depth = len(self._path)
        if depth == 0 and name != "fdm_config":
            self._refuse(f"the root element is <{name}>, not <fdm_config>")
        # Inside a flight control component, <input> and <output> hold a property's name and no attribute.
        if name in {"input", "output"} and (depth < 3 or attributes):
            self._refuse(f"<{name}> opens a port or writes a file")
        if self._path and self._path[-1] in {"input", "output"}:
            self._refuse(f"<{self._path[-1]}> opens a port or writes a file")
        if "file" in attributes:
            self._refuse(f'<{name} file="{attributes["file"]}"> brings in another file, unseen')
        self._path.append(name)
        self._text = []

    def _end(self, name: str) -> None:
        line = self._parser.CurrentLineNumber
        text = "".join(self._text).strip()
        self._path.pop()
        self._text = []
        # A property with a value attribute, or outside functions, declares it; JSBSim creates it as it loads.
        if name in _READERS and (match := _NAME.fullmatch(text)):
            self.uses.append(PropertyUse(match[1], line))

    def _characters(self, text: str) -> None:
        self._text.append(text)


def check_model(file: Path) -> tuple[PropertyUse, ...]:
    """Return the properties that a model's file reads.

    Raises FlightError, naming file and line, for a file that cannot be read or is not well formed, for a document
    type declaration, for an ``<input>`` or ``<output>`` channel, and for an element that includes another file.
    """
    reader = _Reader(file)
    reader.read()
    return tuple(reader.uses)
