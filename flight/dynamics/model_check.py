"""Check a JSBSim model's XML before JSBSim reads it, and refuse what could harm the machine.

JSBSim opens a network port for a model with ``<input port=...>`` and writes files for ``<output>``. A function that
names a missing property aborts the process, at the first step or when the model is freed.
"""

import os
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import cache, lru_cache
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from aircraft.catalog import MAX_MODEL_BYTES, Aircraft, model_hash
from world.errors import FlightError
from world.files import read_at_most

# Elements whose text names a property that must exist when the model runs.
_READING_ELEMENTS = frozenset({"p", "property", "independentVar", "input"})
# Elements whose name attribute creates no property; the name of functions, tables and flight control components does.
_ELEMENTS_WITHOUT_PROPERTY = frozenset(
    {"fdm_config", "location", "pointmass", "channel", "axis", "flight_control", "system"}
)
# A property name as an element's text.
_PROPERTY_NAME = re.compile(r"-?\s*([A-Za-z_][\w./\[\]-]*)\Z")


# Properties that JSBSim creates while it loads an engine, a tank or a wheel, so that they cannot be looked up before.
_PART_PROPERTIES = re.compile(
    r"-?(propulsion/(engine|tank)|gear/unit|fcs/(throttle|mixture|advance|feather|propeller-feather)-(cmd|pos)-norm)"
)
# Elements of such parts.
_PART_ELEMENTS = frozenset({"engine", "tank", "contact", "thruster"})


class _Reader:
    """Reader that collects the property names of one XML file, and stops at the first forbidden element.

    main: True for the model itself, False for a file that it includes.
    remove_channels: True to note ``<input>`` and ``<output>`` channels for removal instead of refusing them.
    """

    def __init__(self, file: Path, *, main: bool = True, remove_channels: bool = False) -> None:
        self.file = file
        self.data = b""
        self.used_names: dict[str, int] = {}  # property names, with the line of their first use
        self.created_names: set[str] = set()
        self.included_files: dict[str, str] = {}  # names of included files, and their locations in this file
        self.has_parts = False
        self._main, self._remove_channels = main, remove_channels
        self._channel_start = -1  # first byte of the channel that is being removed
        self._spans: list[tuple[int, int]] = []
        self._path: list[str] = []
        self._text: list[str] = []
        self._declares = False
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start_element
        self._parser.EndElementHandler = self._end_element
        self._parser.CharacterDataHandler = lambda text: self._text.append(text)
        self._parser.StartDoctypeDeclHandler = self._check_doctype

    def read(self) -> None:
        """Read and parse the file. Raises FlightError if it is unreadable, not well formed, or refused."""
        try:
            self.data = read_at_most(self.file, MAX_MODEL_BYTES, "model")
            self._parser.Parse(self.data, True)
        except OSError as error:
            raise FlightError(
                f"{self.file}: the aircraft model cannot be read: {error.strerror}", file=self.file
            ) from None
        except ValueError as error:
            raise FlightError(f"{self.file}: {error}", file=self.file) from None
        except expat.ExpatError as error:
            raise FlightError(f"{self.file}: not well-formed XML: {error}", file=self.file) from None

    def without_channels(self) -> bytes:
        """Return the file's bytes with channels replaced by blanks, so that line numbers do not change."""
        data = bytearray(self.data)
        for start, end in self._spans:
            data[start:end] = bytes(byte if byte == 10 else 32 for byte in data[start:end])
        return bytes(data)

    def _refuse_model(self, reason: str) -> None:
        """Raise FlightError with a reason and the current line of the file."""
        location = f"{self.file}:{self._parser.CurrentLineNumber}"
        raise FlightError(f"{location}: {reason}; the model is refused", file=self.file)

    def _check_doctype(self, _name: str, _system: object, _public: object, internal: int) -> None:
        """Refuse a document type with internal declarations, unless JSBSim ships the model."""
        # A declaration that only names a document type is never read; JSBSim's own files hold a few harmless entities.
        if internal and not self._remove_channels:
            self._refuse_model("a document type declaration may expand without limit")

    def _start_element(self, name: str, attributes: dict[str, str]) -> None:
        """Record the files and properties that an element names; refuse a forbidden element.

        An input or output channel is forbidden, or is noted for removal in a model that JSBSim ships.
        """
        depth = len(self._path)
        self._path.append(name)
        self._text = []
        if self._channel_start >= 0:
            return
        if self._main and depth == 0 and name != "fdm_config":
            self._refuse_model(f"the root element is <{name}>, not <fdm_config>")
        # Inside a flight control component, <input> and <output> hold a property's name and no attribute.
        if name in {"input", "output"} and (depth < 3 or attributes):
            if not self._remove_channels:
                self._refuse_model(f"<{name}> opens a port or writes a file")
            self._channel_start = self._parser.CurrentByteIndex
            return
        if "file" in attributes:
            location = f'{self._parser.CurrentLineNumber}: <{name} file="{attributes["file"]}">'
            self.included_files.setdefault(attributes["file"], location)
        self.has_parts |= name in _PART_ELEMENTS
        # Functions and flight control components create a property of their name; the latter prefix fcs/ to a bare
        # name.
        if name not in _ELEMENTS_WITHOUT_PROPERTY and (property_name := attributes.get("name")):
            self.created_names |= {property_name, "fcs/" + property_name.lower().replace(" ", "-")}
        # A <property> directly below a section declares one; elsewhere it reads one.
        self._declares = name == "property" and depth == (2 if self._main else 1)

    def _end_element(self, name: str) -> None:
        """Handle an end tag of the parsed JSBSim model.

        Inside a channel that is to be removed, the end of the channel completes its span of bytes. Elsewhere, if the
        element's text is the name of a property, the name is recorded as created or as read.
        """
        self._path.pop()
        match = _PROPERTY_NAME.fullmatch("".join(self._text).strip())
        self._text = []
        if self._channel_start >= 0:
            if name in {"input", "output"} and len(self._path) < 3:
                # An empty-element tag ends where it began; otherwise the parser is before the end tag.
                byte_index = self._parser.CurrentByteIndex
                self._spans.append((self._channel_start, self.data.index(b">", byte_index) + 1))
                self._channel_start = -1
            return
        if match is None:
            return
        if self._declares or name == "output":
            self.created_names.add(match[1])
        elif name in _READING_ELEMENTS:
            self.used_names.setdefault(match[1], self._parser.CurrentLineNumber)


def check_model(
    file: Path, provided: Callable[[str], bool], folders: Sequence[Path] = (), *, shipped: bool = False
) -> dict[str, bytes]:
    """Refuse a model that is unsafe for JSBSim; return the contents of its files by file name.

    The files are the model itself and the files that it includes.

    provided: function that returns True if JSBSim itself has a property of this name before a model is loaded.
    folders: folders of the files that the model includes.
    shipped: True for a model that JSBSim ships: its channels are removed, and its property names are not checked.

    Raises FlightError, naming file and line, for each of these: a file that cannot be read or is not well formed; a
    document type declaration; an ``<input>`` or ``<output>`` channel; an included file that is not in the folders; and
    a property that the model reads but that neither JSBSim nor the model creates.
    """
    readers = {file.name: _read_model(file, main=True, remove_channels=shipped)}
    pending_readers = [readers[file.name]]
    while pending_readers:
        reader = pending_readers.pop()
        for name, location in reader.included_files.items():
            # The name may omit the suffix ".xml".
            names = () if Path(name).name != name or name.startswith(".") else (name, f"{name}.xml")
            files = (folder / file_name for folder in folders for file_name in names)
            path = next((file for file in files if file.is_file()), None)
            if path is None:
                message = f"{reader.file}:{location} includes another file, which is not in the aircraft's folder"
                raise FlightError(message, file=reader.file, field="file", value=name)
            if path.name not in readers:
                readers[path.name] = _read_model(path, main=False, remove_channels=shipped)
                pending_readers.append(readers[path.name])
    if not shipped:
        created_names = set().union(*(reader.created_names for reader in readers.values()))
        has_parts = any(reader.has_parts for reader in readers.values())
        for reader in readers.values():
            for name, line in reader.used_names.items():
                if name in created_names or (has_parts and _PART_PROPERTIES.match(name)) or provided(name):
                    continue
                message = (
                    f"{reader.file}:{line}: the property {name} is read, but neither JSBSim nor the model defines it"
                )
                raise FlightError(message, file=reader.file, field=name)
    return {name: reader.without_channels() for name, reader in readers.items()}


def shipped_model(aircraft: Aircraft) -> dict[str, bytes]:
    """Return the contents of the files of a model that JSBSim ships, by file name.

    The contents are in a form that `check_model` accepts: channels are removed, and entities of a document type are
    replaced by their text.
    """
    files = check_model(aircraft.model_file, lambda _: True, aircraft.model_folders, shipped=True)
    return {name: ElementTree.tostring(ElementTree.fromstring(data)) for name, data in files.items()}


def _read_model(file: Path, *, main: bool, remove_channels: bool) -> _Reader:
    """Return a reader that has read a file; an unchanged file is read only once.

    main: True for the model itself, False for a file that it includes.
    remove_channels: True to note input and output channels for removal instead of refusing them.
    """
    status = file.stat() if file.is_file() else None
    stamp = None if status is None else (status.st_mtime_ns, status.st_size, status.st_ino)
    return _read_stamped_model(file, stamp, main, remove_channels)


@lru_cache(maxsize=16)
def _read_stamped_model(file: Path, _stamp: tuple[int, ...] | None, main: bool, remove_channels: bool) -> _Reader:
    """Return a reader that has read a file; the stamp is only a part of the cache's key."""
    reader = _Reader(file, main=main, remove_channels=remove_channels)
    reader.read()
    return reader


# ----------------------------------------------------------------------
# First run of a user's model in a separate process, because JSBSim may abort instead of reporting an error.

# Timeout of that process, s.
_TIMEOUT_S = 60.0
# Its exit code for a refused model.
_REFUSED = 3
# Program of that process.
_TRIAL_PROGRAM = f"""
import contextlib
import sys
from pathlib import Path
from aircraft.catalog import read_aircraft
from flight.dynamics import fdm as loading
from world.errors import FlightError
loading.silence = lambda: contextlib.nullcontext(str)
try:
    fdm = loading.Fdm(read_aircraft(Path(sys.argv[1])), is_tested=True)
    fdm.move_to(500.0)
    fdm.apply_trim(fdm.first_guess())
    fdm.step(10)
    del fdm
except FlightError:
    sys.exit({_REFUSED})
"""


def try_model(aircraft: Aircraft) -> None:
    """Load and step a user's model in another process, once for each version of the model.

    Raises FlightError if that process dies. If the process only refuses the model, nothing is raised here. Loading the
    model in this process then raises an error with the reason.
    """
    code, reason = _run_trial(str(aircraft.folder), model_hash(aircraft))
    if code not in {0, _REFUSED}:
        failure = "hangs" if code is None else "aborts the process"
        reason_text = reason or "probably because of an undefined property"
        raise FlightError(
            f"{aircraft.model_file}: JSBSim {failure} with this model: {reason_text}", file=aircraft.model_file
        )


@cache
def _run_trial(folder: str, _version: str) -> tuple[int | None, str]:
    """Load and step a model in another process; return its exit code, None on timeout, and its output.

    folder: folder of the aircraft.
    _version: hash of the model; it is only used as a part of the cache's key.
    """
    # The child process finds planfly's packages where this process found them.
    root = str(Path(__file__).parents[2])
    paths = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
    try:
        process = subprocess.run(
            [sys.executable, "-c", _TRIAL_PROGRAM, folder],
            env=os.environ | {"PYTHONPATH": paths},
            capture_output=True,
            check=False,
            timeout=_TIMEOUT_S,
        )
    except subprocess.TimeoutExpired:
        return None, ""
    printed = b"\n".join(part for part in (process.stdout, process.stderr) if part)
    return process.returncode, jsbsim_reason(printed.decode(errors="replace"))


# Last line of JSBSim's banner.
_END_OF_BANNER = "JSBSim startup beginning ..."
# Lines that state no reason: notes, and the stack traces of C++ and Python.
_NO_REASON = re.compile(
    r"(?:Engine|Tank) \w+ ignored|terminate called|Traceback|Fatal Python error|\s*File |Current thread"
)
# Folders before a file's name: a model is loaded from a copy.
_FOLDERS = re.compile(r"(?:[^\s\"']*/)+")
# Escape sequences for terminal colors.
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
# Largest number of lines of a reason.
_MAX_REASON_LINES = 4


def jsbsim_reason(printed: str) -> str:
    r"""Return JSBSim's reason for not loading a model as one line; "" if it printed no reason.

    >>> jsbsim_reason("JSBSim startup beginning ...\n\nIn file /tmp/a/m.xml: line 91\n Unknown engine type\n")
    'In file m.xml: line 91 Unknown engine type'
    """
    output_lines = _COLOURS.sub("", printed).rpartition(_END_OF_BANNER)[2].splitlines()
    lines = [
        " ".join(_FOLDERS.sub("", line).split()) for line in output_lines if line.strip() and not _NO_REASON.match(line)
    ]
    return " ".join(line.removeprefix("what(): ") for line in lines[:_MAX_REASON_LINES])
