"""Plan a path, again in flight too, and list the scenarios to plan in."""

import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from flight.autopilots.catalog import load_autopilot, program_autopilot
from logs.verdict.conditions import Conditions, conditions_of
from planfly.airframe import choose_seed, cruise_airspeed, find_airframe, load_airframe
from planfly.arguments import check_arguments, is_wind
from planfly.file_autopilots import with_file_autopilot
from planfly.first_start import with_warm_up
from planfly.kernel_units.unit_kernels import PLANNING
from planfly.make_plan import make_plan
from planfly.stages import stage
from planfly.targets import file_target
from planner.plan import Plan, plan_json, read_plan
from planner.search.explain_failure import explain_failure
from planner.search.replan import same_mission
from planner.search.search_state import StopCondition
from world.errors import ArgumentError, ScenarioError
from world.files import whole_path, write_whole
from world.scenario import (
    Scenario,
    at_time,
    embedded_scenarios,
    load_scenario,
    with_flight,
    with_planner,
    with_threats,
    with_wind,
)
from world.scenario_tables import Guidance, Navigation

# ----------------------------------------------------------------------
# A scenario as a call names it, with the changes that its keywords ask for.

# Speed, m/s, and where it comes from, degrees.
Wind = tuple[float, float]


def opened_scenario(scenario: Scenario | str | Path, terrain: str | Path | None = None) -> Scenario:
    """An embedded name, a TOML file's path, or a scenario as it is.  Raises ScenarioError or TerrainError.

    terrain: an elevation file in place of its own.
    """
    if isinstance(scenario, Scenario):
        return scenario
    return load_scenario(str(scenario), None if terrain is None else str(terrain))


def flight_entries(
    *,
    aircraft: str | Path | None = None,
    airspeed: float | None = None,
    params: str | Path | None = None,
    guidance: Guidance | None = None,
    autopilot_law: str | None = None,
    nav: Navigation | None = None,
    autopilot: str | Path | None = None,
) -> dict[str, str | float | None]:
    """Entries of a scenario's [flight] that the keywords of a call state; None for those that were not given.

    Raises ArgumentError for a law that planfly does not know, and for one beside a program.

    >>> entries = flight_entries(autopilot_law="px4-1.16")
    >>> entries["autopilot"], entries["px4_version"]
    ('px4', '1.16')
    """
    check_arguments(autopilot_law=autopilot_law)
    if autopilot is not None and autopilot_law is not None:
        allowed = "not with autopilot: a program flies by its own law"
        raise ArgumentError.of_argument("autopilot_law", autopilot_law, allowed)
    law, _, version = (autopilot_law or "").partition("-")
    return {
        # A `Path` is a folder, and is passed on so that it is known for one.
        "aircraft": str(aircraft.resolve()) if isinstance(aircraft, Path) else aircraft,
        "airspeed_mps": airspeed,
        "autopilot": law or None if autopilot is None else program_autopilot(Path(autopilot)).name,
        "px4_version": version or None,
        "guidance": guidance,
        "nav": nav,
        # Whatever folder the scenario is in.
        "params": None if params is None else whole_path(Path(params)),
    }


def changed_scenario(
    scenario: Scenario,
    *,
    wind: Wind | None = None,
    turbulence: str | None = None,
    at: str | None = None,
    aircraft: str | Path | None = None,
    airspeed: float | None = None,
    params: str | Path | None = None,
    guidance: Guidance | None = None,
    autopilot_law: str | None = None,
    nav: Navigation | None = None,
    autopilot: str | Path | None = None,
) -> Scenario:
    """A scenario in other weather, or flown otherwise; None keeps what it has.

    wind: speed, m/s, and where it comes from, degrees.  aircraft: a name, or a folder.  airspeed: m/s.
    params: a file of the autopilot's parameters.  autopilot_law: whose law flies.  autopilot: an autopilot's program.
    Where nobody names an autopilot, it is the one that the file of parameters was written for.
    Raises ScenarioError for what a scenario file may not have either, and ParameterError for another autopilot's file.

    >>> changed = changed_scenario(load_scenario("tight"), wind=(8.0, 270.0), airspeed=28.0)
    >>> changed.wind.speed, changed.flight.airspeed_mps
    (8.0, 28.0)
    """
    speed, from_deg = (None, None) if wind is None else _two_numbers(wind)
    if from_deg is not None and not is_wind(0.0, from_deg):
        raise ArgumentError.of_argument("wind", wind, "degrees from north that it blows from, -360..360, are expected")
    entries = flight_entries(
        aircraft=aircraft,
        airspeed=airspeed,
        params=params,
        guidance=guidance,
        autopilot_law=autopilot_law,
        nav=nav,
        autopilot=autopilot,
    )
    from_course = None if from_deg is None else math.radians(from_deg)
    changed = with_file_autopilot(with_flight(at_time(scenario, at), **entries))
    return with_wind(changed, speed, from_course, turbulence)


def _two_numbers(wind: Wind) -> Wind:
    """A wind as two numbers.  Raises ArgumentError for anything else."""
    try:
        speed, from_deg = wind
        if isinstance(wind, str | bytes):
            raise TypeError
        return float(speed), float(from_deg)
    except (TypeError, ValueError):
        allowed = "a speed, m/s, and the degrees from north that it blows from are expected, as (8, 270)"
        raise ArgumentError.of_argument("wind", wind, allowed, shown=repr(wind)) from None


# ----------------------------------------------------------------------
# Plan a path.

# A threat that has popped up: east and north, kill and detection radius, m; a radius of 0 for none.
Threat = tuple[float, float, float, float]


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
    at: str | None = None,
    aircraft: str | Path | None = None,
    airspeed: float | None = None,
    params: str | Path | None = None,
    guidance: Guidance | None = None,
    autopilot_law: str | None = None,
    nav: Navigation | None = None,
    out: str | Path | None = None,
    overwrite: bool = True,
    stop: Callable[[], bool] | None = None,
) -> Plan:
    """Plan a path across a scenario's terrain and threats, within what its aircraft can fly.

    scenario: an embedded name (`planfly.scenarios()` lists them), a TOML file's path, or a `Scenario`.
    seed: of the search; None takes the scenario's, or 1.
    algorithm: a name of ``planfly plan --help``; None for the default.
    budget: evaluations at most.  seconds: time at most; the best path so far is given then.
    wind: speed, m/s, and where it comes from, degrees; turbulence: "none", "light" or "moderate".
    at: when it is flown, "START" or "START/END" by ISO 8601 with offsets from UTC: zones that are not active then are
    left out; None leaves none out.
    aircraft: a name, or a folder.  airspeed: m/s.  params: a file of the autopilot's parameters.
    autopilot_law: "ardupilot", "px4" (the newest release that planfly knows), "px4-1.16", "px4-1.17" or "ideal".
    guidance: planfly's own law ("path", "l1", "vector-field") in place of ArduPlane's.  nav: "perfect", "rtk", "gnss".
    out: where to write it as plan.json; {name} and {seed} in it stand for the scenario's name and the seed.
    overwrite: whether an existing file is replaced.
    stop: asked between generations; once it is true, the best path so far is given.

    No feasible path is a plan that says so (`Plan.feasible`, `Plan.safe`), not an error; bad input raises a
    `planfly.PlanflyError`.

    >>> import planfly
    >>> path = planfly.plan("tight", seed=1)
    >>> path
    <Plan tight: 22 waypoints, safe, ...>
    >>> path.waypoints.shape
    (22, 3)
    """
    change = partial(
        changed_scenario, wind=wind, turbulence=turbulence, at=at, aircraft=aircraft, airspeed=airspeed, params=params,
        guidance=guidance, autopilot_law=autopilot_law, nav=nav,
    )  # fmt: skip
    check_arguments(seed=seed, budget=budget, seconds=seconds)
    world = _with_budget(change(opened_scenario(scenario)), budget)
    return _planned(world, scenario, None, seed, algorithm, seconds, out, overwrite, stop)


@with_warm_up(*PLANNING)
def replan(
    scenario: Scenario | str | Path,
    old: Plan | str | Path,
    at_leg: int,
    *,
    threats: Sequence[Threat] = (),
    seed: int | None = None,
    algorithm: str | None = None,
    budget: int | None = None,
    seconds: float | None = None,
    wind: Wind | None = None,
    turbulence: str | None = None,
    at: str | None = None,
    aircraft: str | Path | None = None,
    airspeed: float | None = None,
    params: str | Path | None = None,
    guidance: Guidance | None = None,
    autopilot_law: str | None = None,
    nav: Navigation | None = None,
    out: str | Path | None = None,
    overwrite: bool = True,
    stop: Callable[[], bool] | None = None,
) -> Plan:
    """Plan again in flight: the legs that are flown stay, and what follows goes around threats that have popped up.

    scenario: as of `planfly.plan`; threats that only the old plan knew are kept.
    old: the plan that is being flown, or its file.  at_leg: the leg that is about to be flown, from 0.
    threats: new ones: east, north, kill radius and detection radius of each, m; a radius of 0 for none.
    The other keywords are as of `planfly.plan`.
    Raises a `planfly.PlanflyError` for bad input, and for a plan of another mission.

    >>> import planfly
    >>> path = planfly.plan("tight", seed=1)
    >>> again = planfly.replan("tight", path, 3, seed=1)
    >>> again.flown_legs, bool((again.waypoints[:4] == path.waypoints[:4]).all())
    (3, True)
    """
    change = partial(
        changed_scenario, wind=wind, turbulence=turbulence, at=at, aircraft=aircraft, airspeed=airspeed, params=params,
        guidance=guidance, autopilot_law=autopilot_law, nav=nav,
    )  # fmt: skip
    check_arguments(seed=seed, budget=budget, seconds=seconds, at_leg=at_leg)
    world = _with_budget(change(opened_scenario(scenario)), budget)
    flown = old if isinstance(old, Plan) else read_plan(Path(old))
    same_mission(world, flown)
    return _planned(
        _with_new_threats(world, flown, threats), scenario, (flown, at_leg), seed, algorithm, seconds, out, overwrite,
        stop,
    )  # fmt: skip


def _with_budget(scenario: Scenario, budget: int | None) -> Scenario:
    return scenario if budget is None else with_planner(scenario, "budget", budget=budget)


def _with_new_threats(scenario: Scenario, old: Plan, threats: Sequence[Threat]) -> Scenario:
    """A scenario with those of the old plan's threats that it lacks, and with new ones.  Raises ScenarioError."""
    for east, north, _, _ in threats:
        if scenario.terrain is not None and math.isnan(scenario.terrain.height(east, north)):
            place = f"east {east:g} m, north {north:g} m: outside the terrain that is known"
            raise ScenarioError.of_argument("threats", (east, north), place, shown="")
    kept = [table for table in old.scenario.spec.threats if table not in scenario.spec.threats]
    return with_threats(scenario, threats, "threats", kept)


def _planned(
    world: Scenario,
    source: Scenario | str | Path,
    flown: tuple[Plan, int] | None,
    seed: int | None,
    algorithm: str | None,
    seconds: float | None,
    out: str | Path | None,
    overwrite: bool,
    stop: Callable[[], bool] | None,
) -> Plan:
    """Search, and write the plan.  flown: the plan that is being flown and the leg to plan from; None for a new one."""
    number, target = choose_seed(world, seed), None
    if out is not None:
        read = None if isinstance(source, Scenario) else Path(source)
        target = file_target(out, world.name, number, overwrite=overwrite, source=read)
    airframe, ends = load_airframe(world), stop_condition(seconds, stop)
    with stage(f"planning {world.name}", "planning") as advance:
        made = make_plan(world, airframe, number, algorithm, advance, stop=ends, flown=flown)
    if target is not None:
        target.parent.mkdir(parents=True, exist_ok=True)
        write_whole(target, plan_json(made))
    return made


def stop_condition(seconds: float | None, stop: Callable[[], bool] | None) -> StopCondition:
    """What a search asks between generations: "interrupted", "budget" after so many seconds, or "" to go on."""
    deadline = None if seconds is None else time.monotonic() + seconds

    def ends() -> str:
        if stop is not None and stop():
            return "interrupted"
        return "budget" if deadline is not None and time.monotonic() >= deadline else ""

    return ends


def conditions_of_plan(plan: Plan) -> Conditions:
    """Aircraft, speed, weather, autopilot and ground that a plan is for."""
    aircraft, _ = find_airframe(plan.scenario)
    autopilot = load_autopilot(plan.scenario, aircraft)
    return conditions_of(plan.scenario, aircraft.name, cruise_airspeed(plan.scenario, aircraft, autopilot), autopilot)


def what_blocks(plan: Plan) -> tuple[str, ...]:
    """What is in the way of a plan that is not feasible, a line each; nothing for a feasible one.

    >>> import planfly
    >>> planfly.what_blocks(planfly.plan("tight", seed=1))
    ()
    """
    if plan.feasible:
        return ()
    return tuple(explain_failure(plan, load_airframe(plan.scenario).limits.surely()))


def scenarios() -> dict[str, str]:
    """Name and description of each embedded scenario.

    >>> import planfly
    >>> list(planfly.scenarios())[0]
    'jacksboro'
    """
    return {name: spec.description for name, spec in embedded_scenarios().items()}
