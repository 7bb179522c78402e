"""A scenario as a script names it, with the changes that its keywords ask for."""

import math
from pathlib import Path

from world.scenario import Scenario, load_scenario
from world.scenario_types import Guidance, Navigation
from world.scenario_variants import with_flight, with_wind

# Speed, m/s, and where it comes from, degrees.
Wind = tuple[float, float]


def opened_scenario(scenario: Scenario | str | Path) -> Scenario:
    """An embedded name, a TOML file's path, or a scenario as it is.  Raises ScenarioError or TerrainError."""
    return scenario if isinstance(scenario, Scenario) else load_scenario(str(scenario))


def changed_scenario(
    scenario: Scenario,
    *,
    wind: Wind | None = None,
    turbulence: str | None = None,
    aircraft: str | Path | None = None,
    airspeed: float | None = None,
    params: str | Path | None = None,
    guidance: Guidance | None = None,
    nav: Navigation | None = None,
) -> Scenario:
    """A scenario in other weather, or flown otherwise; None keeps what it has.

    wind: speed, m/s, and where it comes from, degrees.  aircraft: a name, or a folder.  airspeed: m/s.
    params: a file of ArduPlane's parameters.  Raises ScenarioError for what a scenario file may not have either.

    >>> changed = changed_scenario(load_scenario("tight"), wind=(8.0, 270.0), airspeed=28.0)
    >>> changed.wind.speed, changed.flight.airspeed_mps
    (8.0, 28.0)
    """
    speed, source = (None, None) if wind is None else wind
    flown = with_flight(
        scenario,
        aircraft=None if aircraft is None else _named(aircraft),
        airspeed_mps=airspeed,
        params=None if params is None else str(Path(params).resolve()),
        guidance=guidance,
        nav=nav,
    )
    return with_wind(flown, speed, None if source is None else math.radians(source), turbulence)


def _named(aircraft: str | Path) -> str:
    """A name as it is; a folder, which a `Path` always is, so that it is known for one."""
    return str(aircraft.resolve()) if isinstance(aircraft, Path) else aircraft
