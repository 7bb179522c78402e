"""Which of ArduPlane's parameters decides a flight that fails: found by flying with one of them changed at a time."""

from collections.abc import Callable
from typing import NamedTuple

from flight.ardupilot.parameters import ArduPilotParameters
from logs.verdict.findings import Finding
from logs.verdict.levels import DecidingParameter
from logs.verdict.summary import first_failed


class Candidate(NamedTuple):
    """A parameter that may decide.

    name: ArduPlane's.
    step: the increment that its parameter reference gives, or a few of them.
    far: the farthest value that is tried, within the range that the reference gives.
    unit: of both.
    """

    name: str
    step: float
    far: float
    unit: str


# Names, units, ranges and increments: ArduPlane's complete parameter list (ardupilot.org, Plane, version 4.6).
_HEIGHT = (
    Candidate("TECS_HDEM_TCONST", 0.2, 1.0, "s"),
    Candidate("TECS_CLMB_MAX", 0.5, 10.0, "m/s"),
    Candidate("TECS_SINK_MAX", 0.5, 10.0, "m/s"),
    Candidate("TECS_TIME_CONST", 0.2, 3.0, "s"),
)
_SIDE = (
    Candidate("NAVL1_PERIOD", 1.0, 10.0, "s"),
    Candidate("WP_RADIUS", 5.0, 30.0, "m"),
    Candidate("WP_RADIUS", 5.0, 150.0, "m"),
    Candidate("ROLL_LIMIT_DEG", 1.0, 60.0, "deg"),
)
# Rules that a height off the plan breaks before a track beside it does.
_OF_HEIGHT = ("clearance", "height", "bounds", "slope", "energy", "stall", "speed")

Passes = Callable[[ArduPilotParameters], bool]


def deciding_parameter(
    parameters: ArduPilotParameters, findings: tuple[Finding, ...], passes: Passes
) -> DecidingParameter | None:
    """The first candidate that passes with another value, and the nearest value that does; None where none does.

    findings: of the flight that failed.
    passes: flies with other parameters and says whether that flight passes; called about ten times.

    The candidates of what failed come first, heights or sides.  Of each the farthest value is flown, and where that
    passes the values between, by halves: the value that is named was flown and passed.

    >>> from flight.ardupilot.parameters import default_parameters
    >>> from logs.verdict.findings import make_finding
    >>> from logs.verdict.places import Place
    >>> low = make_finding("clearance", Place("leg", 4), ok=False, reason="", flown=52.0, limit=60.0, margin=-8.0)
    >>> found = deciding_parameter(default_parameters(), (low,), lambda new: new.tecs_height_demand_time < 1.3)
    >>> found.name, found.current, found.passing
    ('TECS_HDEM_TCONST', 3.0, 1.2)
    """
    failed = first_failed(findings)
    if failed is None:
        return None
    values = {parameter.name: parameter.value for parameter in parameters.values}
    for name, step, far, unit in (*_HEIGHT, *_SIDE) if failed.rule in _OF_HEIGHT else (*_SIDE, *_HEIGHT):
        current = values[name]

        def with_value(value: float, name: str = name) -> bool:
            return passes(parameters.changed(**{name: value}))

        passing = _nearest(current, step, far, with_value)
        if passing is not None:
            off = _off(failed, findings)
            return DecidingParameter(name, current, passing, unit, failed.rule, failed.place, off)
    return None


def _nearest(current: float, step: float, far: float, passes: Callable[[float], bool]) -> float | None:
    """The value nearest to the current one, in steps towards the farthest, that passes; None where that fails."""
    steps = int(abs(far - current) / step + 1e-6)
    sign = 1.0 if far > current else -1.0

    def value(count: int) -> float:
        return round(current + sign * count * step, 6)

    if not steps or not passes(value(steps)):
        return None
    fails, works = 0, steps
    while works - fails > 1:
        middle = (fails + works) // 2
        fails, works = (fails, middle) if passes(value(middle)) else (middle, works)
    return value(works)


def _off(failed: Finding, findings: tuple[Finding, ...]) -> float | None:
    """How far off (m) the flight was where it failed, as `DecidingParameter` has it."""
    if failed.rule == "corridor":
        return failed.flown
    if failed.place.kind != "leg" or failed.rule not in ("clearance", "height"):
        return None
    beside = [item for item in findings if item.rule == "slope" and item.place == failed.place]
    errors = [fact.value for item in beside for fact in item.facts if fact.what == "height error"]
    return errors[0] if errors else None
