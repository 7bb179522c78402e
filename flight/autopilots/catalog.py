"""List all autopilots that planfly knows; add a new autopilot here."""

import math
from collections.abc import Mapping
from pathlib import Path

from aircraft.catalog import Aircraft
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane_sitl.autopilot import ArduPlaneSitl
from flight.autopilots.autopilot import Autopilot, StoredAutopilot
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from flight.autopilots.program import ProgramAutopilot
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4_sitl.autopilot import Px4Sitl
from world.errors import ScenarioError
from world.files import did_you_mean
from world.scenario import Scenario

# Simulated autopilots stand before the programs that they model.  The first program that recognises a file is used.
AUTOPILOTS: tuple[type[Autopilot], ...] = (
    ArduPlane,
    PlanflyGuidance,
    Px4,
    Px4Sitl,
    ArduPlaneSitl,
)
# Simulated autopilots by their names in a scenario.
_SIMULATED = {kind.name: kind for kind in AUTOPILOTS if not issubclass(kind, ProgramAutopilot)}
_PROGRAMS = tuple(kind for kind in AUTOPILOTS if issubclass(kind, ProgramAutopilot))


def load_autopilot(scenario: Scenario, aircraft: Aircraft) -> Autopilot:
    """Return the autopilot that a scenario names, with its settings.

    Raises ScenarioError if the name is not listed, and as `Autopilot.load` does.

    >>> from aircraft.catalog import load_aircraft
    >>> from world.scenario import load_scenario
    >>> load_autopilot(load_scenario("paper-07"), load_aircraft("aerosonde")).title
    'ArduPlane'
    """
    name = scenario.flight.steering.autopilot
    if name not in _SIMULATED:
        known_names = " or ".join(f"'{known_names}'" for known_names in _SIMULATED)
        allowed = f"expected {known_names}{did_you_mean(name, sorted(_SIMULATED))}"
        raise ScenarioError.at(scenario.name, "flight.autopilot", name, allowed, shown=repr(name))
    autopilot, return_settings = _SIMULATED[name].load(scenario.flight, aircraft, scenario.name), scenario.returns
    rtl_settings = (
        (None, None) if return_settings is None else (return_settings.rtl_altitude, return_settings.rtl_autoland)
    )
    with_rtl_settings = autopilot.with_scenario_rtl_settings(
        *rtl_settings, lands=scenario.landing is not None, lower=_field_depth_below_home(scenario)
    )
    _check_no_conflict(scenario, autopilot, with_rtl_settings)
    return with_rtl_settings


def _field_depth_below_home(scenario: Scenario) -> float:
    """Return the height of home above the ground at the landing point, m; 0 if either altitude is unknown."""
    landing, home = scenario.landing, scenario.home
    if landing is None or home is None or scenario.terrain is None:
        return 0.0
    depth = float(home[2] - scenario.terrain.height(landing.east, landing.north))
    return 0.0 if math.isnan(depth) else depth


def _check_no_conflict(scenario: Scenario, autopilot: Autopilot, with_rtl_settings: Autopilot) -> None:
    """Raise ScenarioError if a scenario and the user's parameter file state different values.

    with_rtl_settings: the autopilot with the RTL settings of the scenario.
    """
    if autopilot.parameters is None or with_rtl_settings.parameters is None:
        return
    values = with_rtl_settings.parameters.by_origin("file")
    for name, stated_value in autopilot.parameters.by_origin("file").items():
        if not math.isclose(values[name], stated_value, rel_tol=1e-6, abs_tol=1e-6):
            allowed = f"{autopilot.parameters.source} states {name} {stated_value:g}"
            raise ScenarioError.at(scenario.name, f"returns ({name})", values[name], allowed, shown=f"{values[name]:g}")


def program_autopilot(program: Path) -> type[ProgramAutopilot]:
    """Return the autopilot of a program.

    >>> program_autopilot(Path("arduplane")).name
    'ardupilot'
    """
    return next(kind for kind in _PROGRAMS if kind.recognises(program))


def autopilot_of_log(
    program: str, parameters: Mapping[str, float], source: str
) -> tuple[Autopilot, tuple[str, ...]] | None:
    """Return the autopilot that wrote a flight log, and notes on its parameters; None if planfly does not know it.

    The notes name the parameters that could not be used.

    program: name of the flown program in the log.
    source: the log's file.
    """
    return next(filter(None, (kind.of_flight_log(program, parameters, source) for kind in _SIMULATED.values())), None)


def restore_autopilot(name: str | None, stored: StoredAutopilot) -> Autopilot:
    """Return the autopilot that a log stores.

    name: None if the stored settings imply it.

    Raises ParameterError if a value is not allowed, and KeyError if the name is unknown.
    """
    classes = _SIMULATED if stored.program is None else {kind.name: kind for kind in _PROGRAMS}
    return classes[name or _implied_name(stored)].restore(stored)


def stored_name(autopilot: Autopilot) -> str | None:
    """Return the name that a log must state for an autopilot, or None if its settings imply the name.

    >>> stored_name(PlanflyGuidance("l1")) is None
    True
    """
    return None if _implied_name(autopilot.store()) == autopilot.name else autopilot.name


def _implied_name(stored: StoredAutopilot) -> str:
    """Return the autopilot of a log without its name: ArduPlane if it has parameters or a program, else planfly."""
    return (PlanflyGuidance if stored.parameters is None and stored.program is None else ArduPlane).name
