"""List all autopilots that planfly knows; add a new autopilot here.

The list names the classes instead of importing them, so that the command line reads the names without loading any
control law.
"""

import importlib
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, cast

from world.errors import ScenarioError
from world.files import did_you_mean

if TYPE_CHECKING:
    from aircraft.catalog import Aircraft
    from flight.autopilots.autopilot import Autopilot, StoredAutopilot
    from flight.autopilots.program import ProgramAutopilot
    from world.scenario import Scenario


class Entry(NamedTuple):
    """Name, class and releases of a simulated autopilot.

    name: name in a scenario.
    autopilot: module, below `flight.autopilots`, and class, such as "px4.autopilot.Px4".
    releases: releases that fly differently, as the `[flight]` table names them.
    """

    name: str
    autopilot: str
    releases: tuple[str, ...] = ()


AUTOPILOTS = (
    Entry("ardupilot", "arduplane.autopilot.ArduPlane", ("4.6", "4.7")),
    Entry("px4", "px4.autopilot.Px4", ("1.16", "1.17")),
    Entry("planfly", "planfly.autopilot.PlanflyGuidance"),
)
# External programs. The first one whose `accepts_program` is True for a file is used.
PROGRAMS = (
    "px4_sitl.autopilot.Px4Sitl",
    "arduplane_sitl.autopilot.ArduPlaneSitl",
)


def autopilot_names() -> tuple[str, ...]:
    """Return the names that `--autopilot` accepts: each simulated autopilot, alone and with each release.

    >>> autopilot_names()
    ('ardupilot', 'ardupilot-4.6', 'ardupilot-4.7', 'px4', 'px4-1.16', 'px4-1.17', 'planfly')
    """
    return tuple(
        name
        for entry in AUTOPILOTS
        for name in (entry.name, *(f"{entry.name}-{release}" for release in entry.releases))
    )


def autopilot_classes() -> "Mapping[str, type[Autopilot]]":
    """Return the classes of the simulated autopilots by name."""
    return {entry.name: _load_class(entry.autopilot) for entry in AUTOPILOTS}


def program_classes() -> "Iterator[type[ProgramAutopilot]]":
    """Yield the autopilot class of each external program, importing it first."""
    return (cast("type[ProgramAutopilot]", _load_class(path)) for path in PROGRAMS)


def _load_class(path: str) -> "type[Autopilot]":
    """Import and return an autopilot class, from its path below `flight.autopilots`."""
    module, _, name = path.rpartition(".")
    return cast("type[Autopilot]", getattr(importlib.import_module(f"flight.autopilots.{module}"), name))


def load_autopilot(scenario: "Scenario", aircraft: "Aircraft") -> "Autopilot":
    """Return the autopilot that a scenario names, with its settings and the RTL settings of the scenario.

    If the scenario has a landing, parameters that the landing needs get assumed values, unless the user's file states
    them.

    Raises ScenarioError if the name is not listed, or if the scenario and the parameter file state different values of
    an RTL parameter; also raises the errors of `Autopilot.load`.

    >>> from aircraft.catalog import load_aircraft
    >>> from world.scenario import load_scenario
    >>> load_autopilot(load_scenario("paper-07"), load_aircraft("aerosonde")).title
    'ArduPlane'
    """
    from flight.autopilots.parts import RtlSettings

    name, paths = scenario.flight.steering.autopilot, {entry.name: entry.autopilot for entry in AUTOPILOTS}
    if name not in paths:
        known_names = " or ".join(f"'{known_name}'" for known_name in paths)
        allowed = f"expected {known_names}{did_you_mean(name, sorted(paths))}"
        raise ScenarioError.at(scenario.name, "flight.autopilot", name, allowed, shown=repr(name))
    autopilot = _load_class(paths[name]).load(scenario.flight, aircraft, scenario.name)
    return_table = scenario.returns
    if return_table is not None:
        settings = RtlSettings(return_table.rtl_altitude, return_table.rtl_autoland)
        rtl_parameters = autopilot.returns.make_parameters(settings)
        for parameter, value in rtl_parameters.items():
            file_value = autopilot.stated_value(parameter)
            if file_value is not None and not math.isclose(value, file_value, rel_tol=1e-6, abs_tol=1e-6):
                source = "" if autopilot.parameters is None else autopilot.parameters.source
                allowed = f"{source} sets {parameter} to {file_value:g}; the two values must be equal"
                raise ScenarioError.at(scenario.name, f"returns ({parameter})", value, allowed, shown=f"{value:g}")
        autopilot = autopilot.with_parameters(**rtl_parameters) if rtl_parameters else autopilot
    landing, home, depth = scenario.landing, scenario.home, 0.0
    if landing is not None and home is not None and scenario.terrain is not None:
        depth = float(home[2] - scenario.terrain.height(landing.east, landing.north))
    assumed_parameters = autopilot.returns.make_parameters(
        RtlSettings(lands=landing is not None, field_depth=0.0 if math.isnan(depth) else depth)
    )
    return autopilot.with_parameters("assumed", **assumed_parameters) if assumed_parameters else autopilot


def find_program_class(program: Path) -> "type[ProgramAutopilot]":
    """Return the autopilot class of a SITL executable, such as ArduPlane for "arduplane".

    program: path of an executable built for software in the loop (SITL).

    >>> find_program_class(Path("arduplane")).name
    'ardupilot'
    """
    return next(kind for kind in program_classes() if kind.accepts_program(program))


def autopilot_from_log(
    program: str, parameters: Mapping[str, float], source: str
) -> "tuple[Autopilot, tuple[str, ...]] | None":
    """Return the autopilot that wrote a flight log, and notes on its parameters.

    The autopilot of an unknown program is None.

    The notes name the parameters that could not be used.

    program: name of the flown program in the log.
    source: the log's file.
    """
    candidates = (kind.from_flight_log(program, parameters, source) for kind in autopilot_classes().values())
    return next(filter(None, candidates), None)


def restore_autopilot(name: str | None, stored: "StoredAutopilot") -> "Autopilot":
    """Return the autopilot that a log stores.

    name: name of the autopilot in the log; None if the log states no name, because the stored settings imply it.

    Raises ParameterError if a value is not allowed, and KeyError if the name is unknown.
    """
    name = name or _implied_autopilot_name(stored)
    if stored.program is None:
        return _load_class({entry.name: entry.autopilot for entry in AUTOPILOTS}[name]).restore(stored)
    return {kind.name: kind for kind in program_classes()}[name].restore(stored)


def stored_name(autopilot: "Autopilot") -> str | None:
    """Return the autopilot name that a log must store; None if the stored settings imply the name.

    >>> from flight.autopilots.planfly.autopilot import PlanflyGuidance
    >>> stored_name(PlanflyGuidance("l1")) is None
    True
    """
    return None if _implied_autopilot_name(autopilot.store()) == autopilot.name else autopilot.name


def _implied_autopilot_name(stored: "StoredAutopilot") -> str:
    """Return the autopilot's name for a log that stores no name.

    Stored parameters or a stored program imply ArduPlane. Any other settings imply planfly's guidance.
    """
    return "planfly" if stored.parameters is None and stored.program is None else "ardupilot"
