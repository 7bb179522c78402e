"""Plan a path, plan again in flight, and list the built-in scenarios."""

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from flight.autopilots.catalog import load_autopilot
from logs.verdict.conditions import Conditions, plan_conditions
from planfly.api.api_function import api_function
from planfly.arguments import check_arguments
from planfly.flight_options import PlanOptions, load_scenario_with_options
from planfly.kernel_units.unit_kernels import PLANNING
from planfly.planning.expected_failures import expected_failures
from planfly.runtime.stages import stage
from planfly.threat_tables import GivenThreats, threat_tables
from planfly.workflow.make_plan import make_given_plan, make_plan
from planfly.workflow.output_paths import check_output_file, expand_path_pattern
from planfly.workflow.uav import choose_seed, cruise_airspeed, load_uav, scenario_aircraft
from planner.plan import GIVEN_WAYPOINTS, Plan, nearest_missile_text, plan_json, read_plan
from planner.search.explain_failure import explain_failure
from planner.search.replan import check_same_mission
from planner.search.search_state import StopCondition
from world.argument_types import checks_types
from world.arrays import Floats
from world.compile_events import COMPILE_TIMER
from world.errors import ArgumentError
from world.files import write_atomically
from world.scenario import Scenario, embedded_scenarios, with_planner, with_threats
from world.scenario_tables import MAP_EXTENT

# ----------------------------------------------------------------------
# Plan a path through a scenario.


@api_function(*PLANNING)
def plan(
    scenario: Scenario | str | Path,
    *,
    waypoints: ArrayLike | None = None,
    out: str | Path | None = None,
    overwrite: bool = True,
    **options: Unpack[PlanOptions],
) -> Plan:
    """Plan a path across a scenario's terrain and around its threats, within the limits of its aircraft.

    scenario: a built-in scenario's name (`planfly.scenarios()` lists them), a TOML file's path, or a `Scenario`.
    waypoints: your own path instead of a search, (w, 3): east and north of the scenario's origin and altitude AMSL, m,
    from the scenario's start to its destination.  The path is scored and certified without changes.  If it misses a
    margin of the planner, the plan is "not feasible"; the verdict names the margin, but judges only the flight.
    `Plan.margins` has all margins as numbers, also for a path that leaves the terrain.
    out: file for the plan.json, in which {name} and {seed} stand for the scenario's name and the seed.
    overwrite: True replaces an existing file.

    seed: seed of the search; None takes the seed of the scenario, or 1.  The default algorithm seldom uses random
    numbers: most of its plans are the same for every seed.
    algorithm: a name of ``planfly plan --help``; None for the default.
    budget: maximum number of evaluations.
    seconds: time limit, after which the best path found is returned.
    stop: called between generations; once it returns True, the best path found is returned.
    terrain to nav: the flight to plan for, see `planfly.fly`.

    If no feasible path is found, the returned plan says so (`Plan.feasible`, `Plan.safe`); bad input raises a
    `planfly.PlanflyError`.  A safe plan keeps to the limits of its scenario, also where numbers in [limits] are looser
    than the limits of the aircraft or its autopilot; `planfly.what_may_fail` names such numbers.

    >>> import planfly
    >>> path = planfly.plan("tight", seed=1)
    >>> path
    <Plan tight: 22 waypoints, safe by [limits], ...>
    >>> path.waypoints.shape
    (22, 3)
    >>> mine = path.waypoints + [[0.0, 0.0, 0.0], *[[0.0, 100.0, 0.0]] * 20, [0.0, 0.0, 0.0]]
    >>> planfly.plan("tight", waypoints=mine)
    <Plan tight: 22 waypoints, not feasible, ...>
    """
    world = _with_budget(load_scenario_with_options(scenario, options), options["budget"])
    if waypoints is None:
        return _search_and_write(
            world, scenario, flown_plan_and_leg=None, options=options, out=out, overwrite=overwrite
        )
    path, target = (
        _check_waypoints(world, waypoints, options),
        _find_plan_target(world, scenario, options, out, overwrite),
    )
    return _write_plan(make_given_plan(world, load_uav(world), choose_seed(world, options["seed"]), path), target)


# Options that apply only to a search, not to waypoints that the user names.
_SEARCH_OPTIONS = ("algorithm", "budget", "seconds", "stop")
# Largest distance of the user's first and last waypoint from the scenario's start and destination, m.
_END_TOLERANCE_M = 1.0


def _check_waypoints(scenario: Scenario, waypoints: ArrayLike, options: PlanOptions) -> Floats:
    """Check the user's waypoints, and return them as an array (w, 3), m.

    options: options of the plan.

    Raises ArgumentError for another shape, for a value that is not finite or outside the map, for a path that does not
    lead from the scenario's start to its destination, and for an option of a search.
    """
    for name, value in options.items():
        if name in _SEARCH_OPTIONS and value is not None:
            raise ArgumentError.of_argument(
                name, value, "cannot be combined with waypoints, because nothing is then searched"
            )
    expected = "expected an array (w, 3) of at least 2 rows: east, north and altitude AMSL, m"
    coordinates: Any = waypoints
    names = list(getattr(waypoints, "columns", ()))
    if any(isinstance(name, str) for name in names):
        # A data frame; the order of other names is unknown.
        known_names = next((known for known in _COLUMN_NAMES if set(known) <= set(names)), None)
        if known_names is None:
            allowed = "expected columns east_m, north_m and amsl_m"
            raise ArgumentError.of_argument("waypoints", names, allowed, shown=f"columns {', '.join(map(str, names))}")
        coordinates = coordinates[list(known_names)]
    try:
        path = np.array(coordinates, dtype=np.float64)
    except (TypeError, ValueError):
        raise ArgumentError.of_argument("waypoints", type(waypoints).__name__, expected) from None
    if path.ndim != 2 or path.shape[1] != 3 or len(path) < 2:
        raise ArgumentError.of_argument("waypoints", path, expected, shown=f"of shape {path.shape}")
    for row, point in enumerate(path):
        for column, value in zip(("east", "north", "altitude"), point.tolist(), strict=True):
            if not abs(value) <= MAP_EXTENT:
                allowed = f"allowed -{MAP_EXTENT:.0f}..{MAP_EXTENT:.0f} m"
                raise ArgumentError.of_argument(f"waypoints row {row}: {column}", value, allowed)
    for row, name, end in ((0, "start", scenario.start), (len(path) - 1, "destination", scenario.destination)):
        if (distance := math.dist(path[row], end)) > _END_TOLERANCE_M:
            place = f"row {row}: {distance:.0f} m from the scenario's {name}"
            allowed = f"expected ({end[0]:.1f}, {end[1]:.1f}, {end[2]:.1f}); planfly.make_scenario makes another {name}"
            raise ArgumentError.of_argument("waypoints", path[row], allowed, shown=place)
    return path


# Names of the coordinates in the columns of a data frame of waypoints.
_COLUMN_NAMES = (("east_m", "north_m", "amsl_m"), ("east", "north", "amsl"), ("east_m", "north_m", "up_amsl_m"))


@api_function(*PLANNING)
def replan(
    scenario: Scenario | str | Path,
    old: Plan | str | Path,
    at_leg: int,
    *,
    threats: GivenThreats = (),
    out: str | Path | None = None,
    overwrite: bool = True,
    **options: Unpack[PlanOptions],
) -> Plan:
    """Plan again in flight, keeping the flown legs and routing the rest around new threats.

    scenario: see `planfly.plan`; threats that only the old plan has are kept.
    old: the plan that is being flown, or its file.
    at_leg: the leg that is about to be flown, from 0.
    threats: new threats, as for `planfly.make_scenario`, such as an array (n, 4) of east, north, kill radius and
    detection radius, m; a radius of 0 means no such zone.
    For the other keywords, see `planfly.plan`.
    Raises a `planfly.PlanflyError` for bad input, and for a plan of another mission.

    >>> import planfly
    >>> path = planfly.plan("tight", seed=1)
    >>> again = planfly.replan("tight", path, 3, seed=1)
    >>> again.flown_legs, bool((again.waypoints[:4] == path.waypoints[:4]).all())
    (3, True)
    """
    check_arguments(at_leg=at_leg)
    world = _with_budget(load_scenario_with_options(scenario, options), options["budget"])
    old_plan = old if isinstance(old, Plan) else read_plan(Path(old))
    check_same_mission(world, old_plan)
    old_threats = [threat for threat in old_plan.scenario.spec.threats if threat not in world.spec.threats]
    world = with_threats(world, threat_tables(threats), "threats", old_threats)
    return _search_and_write(world, scenario, (old_plan, at_leg), options, out, overwrite)


def _with_budget(scenario: Scenario, budget: int | None) -> Scenario:
    """Return a scenario with another maximum number of evaluations; None returns the scenario unchanged."""
    return scenario if budget is None else with_planner(scenario, "budget", budget=budget)


def _search_and_write(
    world: Scenario,
    source: Scenario | str | Path,
    flown_plan_and_leg: tuple[Plan, int] | None,
    options: PlanOptions,
    out: str | Path | None,
    overwrite: bool,
) -> Plan:
    """Search for a plan, write it if a file is named, and return it.

    source: the scenario as the caller named it; its file must not be overwritten.
    flown_plan_and_leg: the plan being flown and the leg to plan from; None for a new plan.
    """
    seed, target = choose_seed(world, options["seed"]), _find_plan_target(world, source, options, out, overwrite)
    uav, should_stop = load_uav(world), stop_condition(options["seconds"], options["stop"])
    with stage(f"planning {world.name}", "planning") as advance:
        plan = make_plan(
            world,
            uav,
            seed,
            options["algorithm"],
            advance,
            stop=should_stop,
            flown_plan_and_leg=flown_plan_and_leg,
        )
    return _write_plan(plan, target)


def _find_plan_target(
    world: Scenario, source: Scenario | str | Path, options: PlanOptions, out: str | Path | None, overwrite: bool
) -> Path | None:
    """Return the checked path of the plan.json to write; None if `out` is None.

    world, source: the scenario, and the name, file or `Scenario` that the caller passed.  Its file is not overwritten.
    out: path in which {name} and {seed} are still to be replaced.
    """
    if out is None:
        return None
    source_file = None if isinstance(source, Scenario) else Path(source)
    target = expand_path_pattern(out, world.name, choose_seed(world, options["seed"]))
    check_output_file(target, overwrite, source_file, suffix=".json", folder_must_exist=target == Path(out))
    return target


def _write_plan(plan: Plan, target: Path | None) -> Plan:
    """Write a plan if a file is named, and return it."""
    if target is not None:
        target.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(target, plan_json(plan))
    return plan


def stop_condition(seconds: float | None, stop: Callable[[], bool] | None) -> StopCondition:
    """Make the function that a search calls to find out if it has to stop.

    The function returns "interrupted" as soon as `stop` returns True, "budget" after a number of seconds, and otherwise
    "".  The time in which kernels are compiled is not included.
    """

    def measure_working_time() -> float:
        """Return a clock reading, s, that excludes the time in which kernels were compiled."""
        return time.monotonic() - COMPILE_TIMER.seconds

    start = measure_working_time()

    def should_stop() -> str:
        """Return the reason to stop the search now; "" to continue."""
        if stop is not None and stop():
            return "interrupted"
        return "budget" if seconds is not None and measure_working_time() - start >= seconds else ""

    return should_stop


def conditions_of_plan(plan: Plan) -> Conditions:
    """Return the conditions for which a plan was made: aircraft, airspeed, weather, autopilot and terrain."""
    aircraft = scenario_aircraft(plan.scenario)
    autopilot = load_autopilot(plan.scenario, aircraft)
    return plan_conditions(plan.scenario, aircraft.name, cruise_airspeed(plan.scenario, aircraft, autopilot), autopilot)


@checks_types
def what_blocks(plan: Plan) -> tuple[str, ...]:
    """Return the reasons why a plan is not safe, one line each; empty for a safe plan.

    `planfly.what_may_fail` returns the reasons why flights of a safe plan may fail.

    >>> import planfly
    >>> planfly.what_blocks(planfly.plan("tight", seed=1))
    ()
    """
    if plan.safe:
        return ()
    missile_texts = () if plan.certificate.kill_distance > 0.0 else (nearest_missile_text(plan),)
    if plan.feasible:
        return missile_texts
    if plan.algorithm == GIVEN_WAYPOINTS and plan.certificate.problems:
        return (*plan.certificate.problems, *missile_texts)
    return tuple(explain_failure(plan, load_uav(plan.scenario).limits.with_margin()))


@checks_types
def what_may_fail(plan: Plan) -> tuple[str, ...]:
    """Return why flights of a safe plan may fail, one line each; empty if no cause is known.

    A safe plan keeps to the numbers in [limits], which may be looser than the limits of the aircraft or its autopilot;
    a strip may be too short; a final may be steep.  Only causes that are known without flights of the whole plan are
    found.  The result is empty for a plan that is not safe.  For a plan with a steep final approach, the landing is
    flown 40 times, which takes up to half a minute.

    >>> import planfly
    >>> planfly.what_may_fail(planfly.plan("tight", seed=1))[0][:76]
    'flights are expected to fail: the limits of the scenario are looser than the'
    """
    from planfly.campaigns.landing_trial import steep_landing_failures

    if not plan.safe:
        return ()
    uav = load_uav(plan.scenario)
    return (*expected_failures(plan, uav), *steep_landing_failures(plan, uav))


def scenarios() -> dict[str, str]:
    """Return the name and description of each built-in scenario.

    >>> import planfly
    >>> list(planfly.scenarios())[0]
    'jacksboro'
    """
    return {name: spec.description for name, spec in embedded_scenarios().items()}
