"""Change one value in a parameter file, and keep its other lines, its comments and its format."""

import re
from collections.abc import Mapping

from flight.autopilots.parameter_files import AUTOPILOT, parse_parameters

# Name and value in a line of a file without QGroundControl's columns.
_NAME_AND_VALUE = re.compile(r"^(\s*[^\s,=]+([\s,=]+))[^\s,=#]+")
# Number of QGroundControl's columns.
_QGC_COLUMN_COUNT = 5
# MAV_PARAM_TYPE_REAL32, the type of the parameters that planfly suggests.
_REAL_TYPE = 9


def with_parameter(text: str, source: str, values: Mapping[str, float]) -> str:
    r"""Return the text of a parameter file with another value of one parameter.

    The value is changed under each name that the file uses for the parameter. A missing parameter is appended.

    source: name of the file in messages.
    values: value under each name of the parameter, in the unit of that name. The present name comes first; a missing
        parameter is appended under this name.

    Raises ParameterError for a text that is not a parameter file.

    >>> with_parameter("# Stack: PX4 Pro\n1\t1\tNAV_ACC_RAD\t20\t9\n", "a", {"NAV_ACC_RAD": 25.5})
    '# Stack: PX4 Pro\n1\t1\tNAV_ACC_RAD\t25.5\t9\n'
    >>> with_parameter("WP_RADIUS, 90 # m\n", "a", {"NAVL1_PERIOD": 12.0})
    'WP_RADIUS, 90 # m\nNAVL1_PERIOD, 12\n'
    """
    entries = parse_parameters(text, source)
    lines = re.split(r"\r\n|\n|\r", text.rstrip("\r\n"))
    stated_names = [name for name in values if name in entries]
    for name in stated_names:
        index = entries[name].where.number - 1
        line, value = lines[index], values[name]
        columns = line.split("\t")
        if len(columns) == _QGC_COLUMN_COUNT:
            lines[index] = "\t".join([*columns[:3], f"{value:.10g}", columns[4]])
        else:
            lines[index] = _NAME_AND_VALUE.sub(rf"\g<1>{value:.10g}", line)
    if not stated_names:
        # The new line has the format of the file's first one.
        model_line = lines[next(iter(entries.values())).where.number - 1]
        columns, (name, value) = model_line.split("\t"), next(iter(values.items()))
        if len(columns) == _QGC_COLUMN_COUNT:
            lines.append("\t".join([columns[0], str(AUTOPILOT), name, f"{value:.10g}", str(_REAL_TYPE)]))
        else:
            separator = _NAME_AND_VALUE.match(model_line)
            lines.append(f"{name}{separator[2] if separator else ' '}{value:.10g}")
    return "\n".join(lines) + "\n"


def px4_parameter_text(name: str, value: float, release: str) -> str:
    """Return the text of a parameter file of PX4 with one parameter, in QGroundControl's format.

    name, value: the parameter, in PX4's unit.
    release: release of PX4 that the header states, such as "1.16".
    """
    head = ["Onboard parameters for Vehicle 1", "", "Stack: PX4 Pro", "Vehicle: Fixed Wing", f"Version: {release}", ""]
    head.append("Vehicle-Id Component-Id Name Value Type")
    comments = "".join(f"# {line}".rstrip() + "\n" for line in head)
    return f"{comments}1\t{AUTOPILOT}\t{name}\t{value:.10g}\t{_REAL_TYPE}\n"
