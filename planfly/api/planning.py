"""Plan a path, and what it is planned for: scenarios and aircraft."""

import math
import time
from pathlib import Path
from typing import overload

from aircraft.catalog import Aircraft, aircraft_names, find_aircraft, load_aircraft
from planfly import pipeline
from planfly.airframe import choose_seed, load_airframe
from planfly.first_start import with_warm_up
from planfly.kernel_units.unit_kernels import BOTH, PLANNING
from planner.plan import Plan, plan_json
from planner.search.plan_path import plan_path
from world.files import write_whole
from world.scenario import Scenario, embedded_scenarios, load_scenario, with_flight, with_planner, with_wind
from world.scenario_tables import Guidance, Navigation

# ----------------------------------------------------------------------
# A scenario as a script names it, with the changes that its keywords ask for.

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


# ----------------------------------------------------------------------
# Plan a path.

plan_then_fly = with_warm_up(*BOTH)(pipeline.plan_then_fly)


@with_warm_up(*PLANNING)
def plan(
    scenario: Scenario | str | Path,
    *,
    seed: int | None = None,
    algorithm: str | None = None,
    budget: int | None = None,
    seconds: float | None = None,
    wind: Wind | None = None,
    turbulence: str | None = None,
    aircraft: str | Path | None = None,
    airspeed: float | None = None,
    params: str | Path | None = None,
    guidance: Guidance | None = None,
    nav: Navigation | None = None,
    out: str | Path | None = None,
) -> Plan:
    """Plan a path across a scenario's terrain and threats, within what its aircraft can fly.

    scenario: an embedded name (`planfly.scenarios()` lists them), a TOML file's path, or a `Scenario`.
    seed: of the search; None takes the scenario's, or 1.
    algorithm: a name of ``planfly plan --help``; None for the default.
    budget: evaluations at most.  seconds: time at most; the best path so far is given then.
    wind: speed, m/s, and where it comes from, degrees; turbulence: "none", "light" or "moderate".
    aircraft: a name, or a folder.  airspeed: m/s.  params: a file of ArduPlane's parameters.
    guidance: planfly's own law ("path", "l1", "vector-field") in place of ArduPlane's.  nav: "perfect", "rtk", "gnss".
    out: where to write it as plan.json, replaced if it exists.

    No feasible path is a plan that says so (`Plan.feasible`, `Plan.safe`), not an error; bad input raises a
    `planfly.PlanflyError`.

    >>> import planfly
    >>> path = planfly.plan("tight", seed=1)
    >>> path
    <Plan tight: 22 waypoints, safe, ...>
    >>> path.waypoints.shape
    (22, 3)
    """
    world = changed_scenario(
        opened_scenario(scenario), wind=wind, turbulence=turbulence, aircraft=aircraft, airspeed=airspeed,
        params=params, guidance=guidance, nav=nav,
    )  # fmt: skip
    if budget is not None:
        world = with_planner(world, "budget", budget=budget)
    until = None if seconds is None else time.monotonic() + seconds
    made = plan_path(
        world,
        load_airframe(world).limits,
        seed=choose_seed(world, seed),
        algorithm=algorithm,
        stop=lambda: "budget" if until is not None and time.monotonic() >= until else "",
    )
    if out is not None:
        write_whole(Path(out), plan_json(made))
    return made


def scenarios() -> dict[str, str]:
    """Name and description of each embedded scenario.

    >>> import planfly
    >>> list(planfly.scenarios())[0]
    'jacksboro'
    """
    return {name: spec.description for name, spec in embedded_scenarios().items()}


# ----------------------------------------------------------------------
# The aircraft that planfly knows, and one's own.


@overload
def aircraft() -> dict[str, Aircraft]: ...
@overload
def aircraft(name: str | Path) -> Aircraft: ...
def aircraft(name: str | Path | None = None) -> Aircraft | dict[str, Aircraft]:
    """An aircraft by its name, or by the folder of one's own: masses, speeds and limits, in SI units and radians.

    name: None for all embedded ones by name.
    Raises a `planfly.PlanflyError` for a name that is none and a folder that holds no aircraft.

    >>> import planfly
    >>> planfly.aircraft("aerosonde").airspeed
    25.0
    >>> list(planfly.aircraft())
    ['aerosonde', 'c172x']
    """
    if name is None:
        return {known: load_aircraft(known) for known in aircraft_names()}
    return find_aircraft(str(name.resolve()) if isinstance(name, Path) else name)
