"""ArduPlane's parameters as a log holds them, by their names of any release."""

from flight.ardupilot.parameters import DEFINITIONS, ArduPilotParameters, Origin, stored_parameters
from logs.field_logs.raw_log import RawLog
from world.errors import ParameterError

_ARDUPLANE = "ArduP"
# What has to be in order.
_PAIRS = (("THR_MIN", "THR_MAX"), ("AIRSPEED_MIN", "AIRSPEED_MAX"))


def logged_parameters(raw: RawLog) -> tuple[ArduPilotParameters | None, tuple[str, ...]]:
    """The parameters that ArduPlane flew with, and what could not be used of them, in sentences.

    None for a log of another autopilot, or of none.  A log of ArduPlane without parameters has its defaults, and says
    so.

    >>> from logs.field_logs.example_raw_log import example_raw_log
    >>> logged_parameters(example_raw_log())[0].wp_radius
    60.0
    """
    if not raw.program.startswith(_ARDUPLANE):
        return None, ()
    values: dict[str, float] = {}
    notes = []
    for definition in DEFINITIONS.values():
        old = definition.old
        if definition.name in raw.parameters:
            value = raw.parameters[definition.name]
        elif old is not None and old[0] in raw.parameters:
            value = raw.parameters[old[0]] * old[1]
        else:
            continue
        if definition.low <= value <= definition.high:
            values[definition.name] = value
        else:
            notes.append(f"{definition.name} {value:g} of the log is not allowed: the default is taken")
    for least, most in _PAIRS:
        if least in values and most in values and values[least] >= values[most]:
            notes.append(f"{least} {values[least]:g} and {most} {values[most]:g} of the log: the defaults are taken")
            del values[least], values[most]
    if not values:
        notes.append("the log holds no parameters: ArduPlane's defaults are taken")
    origin: Origin = "file"
    stated = [(name, value, origin) for name, value in values.items()]
    try:
        return stored_parameters(stated, (), raw.source), tuple(notes)
    except ParameterError as error:
        return stored_parameters([], (), raw.source), (*notes, f"{error}: ArduPlane's defaults are taken")
