"""Reads a JSBSim model's XML before JSBSim does, and refuses what it could do to the machine.

JSBSim opens a network port for a model with ``<input port=...>`` and writes files for ``<output>``.  A function that
names a property which does not exist aborts the process, at the first step or when the model is freed.
"""

import re
from collections.abc import Callable
from pathlib import Path
from xml.parsers import expat

from world.errors import FlightError

# Elements whose text names a property that must exist when the model runs.
_READERS = frozenset({"p", "property", "independentVar", "input"})
# Elements whose name attribute makes no property; that of functions, tables and flight control components does.
_NAMELESS = frozenset({"fdm_config", "location", "pointmass", "channel", "axis", "flight_control", "system"})
_NAME = re.compile(r"-?\s*([A-Za-z_][\w./\[\]-]*)\Z")


class _Reader:
    """Collects property names from one file's XML events and stops at the first forbidden element."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.read_names: dict[str, int] = {}  # with the line of the first use
        self.made_names: set[str] = set()
        self._path: list[str] = []
        self._text: list[str] = []
        self._declares = False
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._text_seen
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
        if "file" in attributes:
            self._refuse(f'<{name} file="{attributes["file"]}"> brings in another file, unseen')
        # Functions and flight control components make a property of their name; the latter put fcs/ before a bare one.
        if name not in _NAMELESS and (made := attributes.get("name")):
            self.made_names |= {made, "fcs/" + made.lower().replace(" ", "-")}
        # A <property> right below a section declares one, everywhere else it reads one.
        self._declares = name == "property" and depth == 2
        self._path.append(name)
        self._text = []

    def _end(self, name: str) -> None:
        self._path.pop()
        match = _NAME.fullmatch("".join(self._text).strip())
        self._text = []
        if match is None:
            return
        if self._declares or name == "output":
            self.made_names.add(match[1])
        elif name in _READERS:
            self.read_names.setdefault(match[1], self._parser.CurrentLineNumber)

    def _text_seen(self, text: str) -> None:
        self._text.append(text)


def check_model(file: Path, provided: Callable[[str], bool]) -> None:
    """Refuse a model that is unsafe to give to JSBSim.

    provided: whether JSBSim itself has a property of this name before a model is loaded.
    Raises FlightError, naming file and line, for a file that cannot be read or is not well formed, for a document type
    declaration, for an ``<input>`` or ``<output>`` channel, for an element that includes another file, and for a
    property that is read and that neither JSBSim nor the model makes.
    """
    reader = _Reader(file)
    reader.read()
    for name, line in reader.read_names.items():
        if name not in reader.made_names and not provided(name):
            raise FlightError(f"{file}:{line}: property {name} is read, and neither JSBSim nor the model makes it")
