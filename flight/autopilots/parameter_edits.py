"""Change one value in a parameter file, and keep its other lines, its comments and its format."""

import re
from collections.abc import Collection

from flight.autopilots.parameter_files import AUTOPILOT, parse_parameters

# Name and value in a line of a file without QGroundControl's columns.
_NAME_AND_VALUE = re.compile(r"^(\s*)[^\s,=]+([\s,=]+)[^\s,=#]+")
# MAV_PARAM_TYPE_REAL32, the type of the parameters that planfly suggests.
_REAL_TYPE = 9


def with_parameter(text: str, source: str, name: str, value: float, other_names: Collection[str] = ()) -> str:
    r"""Return the text of a parameter file with another value for one parameter, which is appended if it is missing.

    source: name of the file in messages.
    other_names: names of the same parameter in other releases, one of which the file may use.

    Raises ParameterError for a text that is not a parameter file.

    >>> with_parameter("# Stack: PX4 Pro\n1\t1\tNAV_ACC_RAD\t20\t9\n", "a", "NAV_ACC_RAD", 25.5)
    '# Stack: PX4 Pro\n1\t1\tNAV_ACC_RAD\t25.5\t9\n'
    >>> with_parameter("WP_RADIUS, 90 # m\n", "a", "NAVL1_PERIOD", 12.0)
    'WP_RADIUS, 90 # m\nNAVL1_PERIOD, 12\n'
    """
    entries = parse_parameters(text, source)
    lines = re.split(r"\r\n|\n|\r", text.rstrip("\r\n"))
    stated = next((entries[known] for known in (name, *other_names) if known in entries), None)
    # The line to change, or a line whose format a new one takes.
    model = stated or next(entry for entry in entries.values())
    line, columns = lines[model.where.number - 1], lines[model.where.number - 1].split("\t")
    if len(columns) == 5:
        kind = columns[4] if stated else str(_REAL_TYPE)
        component = columns[1] if stated else str(AUTOPILOT)
        changed = "\t".join([columns[0], component, name, f"{value:.10g}", kind])
    elif stated:
        changed = _NAME_AND_VALUE.sub(rf"\g<1>{name}\g<2>{value:.10g}", line)
    else:
        separator = _NAME_AND_VALUE.match(line)
        changed = f"{name}{separator[2] if separator else ' '}{value:.10g}"
    if stated:
        lines[stated.where.number - 1] = changed
    else:
        lines.append(changed)
    return "\n".join(lines) + "\n"


def px4_parameter_text(name: str, value: float, release: str) -> str:
    """Return a parameter file of PX4 with one parameter, in QGroundControl's format."""
    head = ["Onboard parameters for Vehicle 1", "", "Stack: PX4 Pro", "Vehicle: Fixed Wing", f"Version: {release}", ""]
    head.append("Vehicle-Id Component-Id Name Value Type")
    comments = "".join(f"# {line}".rstrip() + "\n" for line in head)
    return f"{comments}1\t{AUTOPILOT}\t{name}\t{value:.10g}\t{_REAL_TYPE}\n"
