"""Read and write an autopilot's parameter files in the formats of ground stations.

QGroundControl writes five columns with tabs between: vehicle, component, name, value, type. MAVProxy and ArduPilot's
own default files have a name and a value with blanks between, Mission Planner has a comma.  In all formats a `#` begins
a comment (ArduPilot's documentation, "Saving and Loading Parameters"; QGroundControl's documentation, "Plain-Text File
Format").
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from world.errors import ParameterError
from world.files import TextLine, read_small_file, utf8_text

# Largest file, bytes: a vehicle has some 1,500 parameters in lines of 40 bytes.
MAX_BYTES = 4 * 2**20
# Maximum length of a parameter name (MAVLink, PARAM_VALUE): no autopilot has a longer one.
LONGEST_NAME = 16
# Pattern of a name. Files that were edited by hand contain names that are too long, which ground stations skip. One
# name of ArduPlane 4.7 has small letters.
_NAME_PATTERN = re.compile(r"[A-Z][A-Z0-9_]{0,63}|FOLLP_LkAHD")
_NUMBER_PATTERN = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
# Number of columns in QGroundControl's format: vehicle, component, name, value, type.
_QGC_COLUMN_COUNT = 5
_INTEGER_PATTERN = re.compile(r"[0-9]{1,5}")
# MAV_COMP_ID_AUTOPILOT1; other components (a gimbal, a second computer) may have parameters of the same names.
AUTOPILOT = 1
_SEPARATOR_PATTERN = re.compile(r"[\s,=]+")


@dataclass(frozen=True, slots=True)
class Entry:
    """One parameter of a file.

    where: file and line, for messages.
    component: MAVLink component of the vehicle.
    """

    name: str
    value: float
    where: TextLine
    component: int = 1


def read_parameter_file(path: Path) -> dict[str, Entry]:
    """Read a parameter file; return its entries by name, in the order of the file.

    Raises ParameterError, in one line, if the file cannot be read, and as `parse_parameters` does.
    """
    data = read_small_file(path, MAX_BYTES, "parameter", ParameterError)
    return parse_parameters(utf8_text(data, path, ParameterError), str(path))


def parameters_text(values: Mapping[str, float], title: str) -> str:
    r"""Return the text of a parameter file in a format that every ground station reads.

    The text has a comment, then a name and a value on each line.

    values: values by name.
    title: text of the comment.

    >>> parameters_text({"RTL_ALTITUDE": 180.0, "LAND_FLARE_SEC": 2.5}, "made for a field")
    '# made for a field\nRTL_ALTITUDE 180\nLAND_FLARE_SEC 2.5\n'
    """
    return "\n".join([f"# {title}", *(f"{name} {value:.10g}" for name, value in values.items())]) + "\n"


def parse_parameters(text: str, source: str) -> dict[str, Entry]:
    r"""Parse the text of a parameter file in any known format.

    source: name of the file in messages.

    Raises ParameterError with file, line, field, value and allowed values. The reason is a line of unknown format, a
    value that is not a finite number, a name that occurs twice, or a file without parameters. If several components of
    a vehicle have a parameter of the same name, the autopilot's value is taken. A name that is too long is read like
    any unknown name.

    >>> found = parse_parameters("# Vehicle 1\n1\t1\tWP_RADIUS\t90.0\t9\n", "qgc.params")
    >>> found["WP_RADIUS"].value, str(found["WP_RADIUS"].where)
    (90.0, 'qgc.params:2')
    >>> list(parse_parameters("WP_RADIUS 90  # m\nTHR_MAX,100\n", "any.parm"))
    ['WP_RADIUS', 'THR_MAX']
    """
    entries: dict[str, Entry] = {}
    for number, text_line in enumerate(re.split(r"\r\n|\n|\r", text), 1):
        line = text_line.partition("#")[0].strip()
        if not line:
            continue
        entry = _parse_entry(line, TextLine(source, number))
        if entry.name in entries and entries[entry.name].component != entry.component:
            # Two components of one vehicle: only the autopilot's value affects the flight.
            if entry.component == AUTOPILOT:
                entries[entry.name] = entry
            continue
        if entry.name in entries:
            first_line = entries[entry.name].where.number
            allowed = "name each parameter once"
            raise ParameterError(
                f"{entry.where}: {entry.name}: already on line {first_line}: {allowed}",
                file=source,
                field=entry.name,
                value=entry.value,
                allowed=allowed,
            )
        entries[entry.name] = entry
    if not entries:
        raise ParameterError(f"{source}: no parameter; expected lines with a name and a value", file=source)
    return entries


def _parse_entry(line: str, location: TextLine) -> Entry:
    """Return the parameter in a line without a comment.

    location: position of the line.

    Raises ParameterError.
    """
    fields, component = line.split("\t"), AUTOPILOT
    if len(fields) == _QGC_COLUMN_COUNT and _INTEGER_PATTERN.fullmatch(fields[0].strip()):
        name, text = fields[2].strip(), fields[3].strip()
        component = int(fields[1]) if _INTEGER_PATTERN.fullmatch(fields[1].strip()) else AUTOPILOT
    else:
        fields = _SEPARATOR_PATTERN.split(line)
        if len(fields) != 2:
            allowed = "expected a name and a value, or QGroundControl's five columns"
            message = f"{location}: {_shorten(line)}: {allowed}"
            raise ParameterError(message, file=location.file, value=line, allowed=allowed)
        name, text = fields
    if not _NAME_PATTERN.fullmatch(name):
        allowed = f"expected up to {LONGEST_NAME} capitals, digits and _"
        message = f"{location}: name {_shorten(name)}: {allowed}"
        raise ParameterError(message, file=location.file, field="name", value=name, allowed=allowed)
    value = float(text) if _NUMBER_PATTERN.fullmatch(text) else math.nan
    if not math.isfinite(value):
        allowed = "expected a finite number"
        raise ParameterError(
            f"{location}: {name}: {_shorten(text)}: {allowed}",
            file=location.file,
            field=name,
            value=text,
            allowed=allowed,
        )
    return Entry(name, value, location, component)


def _shorten(text: str) -> str:
    """Return a text in quotes, at most 40 characters long."""
    return repr(text if len(text) <= 40 else text[:37] + "...")
