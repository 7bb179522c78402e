"""A scenario and its limits as a planning problem: rules for the judges, and the space that encodings search."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import Limits, derated
from planner.evaluation.encoding import Space
from planner.evaluation.missile_index import make_missiles
from planner.evaluation.problem_arrays import Rules, Steep, pack_spheres
from planner.evaluation.threat_grid import make_cells
from world.errors import ScenarioError
from world.scenario import Scenario
from world.terrain import TILE, Terrain, steepest_slopes

Floats = NDArray[np.float64]

# Plans keep this inside turn and slope limits.
SPARE = math.radians(0.5)
# Course changes that a plan may ask of the aircraft where no number limits them.
AIRCRAFT_TURN = math.radians(150.0)
# m above the required clearance, and outside kill spheres, that the search aims for and the certificate asks for.
# What is between the two covers the search's terrain samples and chords; what the certificate keeps covers the
# height error of a flight (1.3 m worst of 120 flights) and its cross-track error (2 m).
SEARCH_RESERVE, CERTIFIED_RESERVE = 8.0, 5.0
SEARCH_KILL_MARGIN, CERTIFIED_KILL_MARGIN = 15.0, 10.0
# Of what a fixed end leaves of the reserve, the share that the certificate asks for.
CERTIFIED_SLACK = 0.75
# More reserve for each attempt after the first, m: the search had not seen all ground between its samples.
ATTEMPT_RESERVE = 5.0
# Of the aircraft's steepest climb and dive, the share that a plan uses: holding a path in gusts takes the rest.
TURBULENCE_SHARE = {"none": 1.0, "light": 0.9, "moderate": 0.8}
# m inside the map, and inside floor and ceiling, that a search keeps where the fixed ends do.
MAP_MARGIN, HEIGHT_MARGIN = 10.0, 4.0


@dataclass(frozen=True, slots=True)
class Problem:
    """What a search works on.

    search: rules with the margins that a search aims for.  certified: with those that the certificate asks for.
    """

    scenario: Scenario
    limits: Limits
    search: Rules
    certified: Rules
    space: Space


def make_problem(scenario: Scenario, limits: Limits, attempt: int = 0) -> Problem:
    """Put a scenario into the form of the compiled judges.  Raises ScenarioError if nothing can be planned on it.

    attempt: how many searches have failed; each adds to the clearance that the next one keeps.
    """
    if scenario.terrain is None:
        raise ScenarioError(f"{scenario.name}: terrain: none given; a path is planned over terrain")
    for name in ("max_turn", "max_climb", "max_dive"):
        value = getattr(limits, name)
        if value is not None and value <= SPARE:
            allowed = 'a plan keeps 0.5 inside it; allowed: above 0.5, or "aircraft"'
            raise ScenarioError(f"{scenario.name}: limits.{name}_deg: {math.degrees(value):g}: {allowed}")
    certified = _rules(scenario, limits)
    reserve = SEARCH_RESERVE + attempt * ATTEMPT_RESERVE
    search = _inset(_with_margins(certified, scenario, limits, reserve, SEARCH_KILL_MARGIN))
    return Problem(
        scenario=scenario,
        limits=limits,
        search=search,
        certified=certified,
        space=_space(scenario, search),
    )


def _rules(scenario: Scenario, limits: Limits) -> Rules:
    """Rules of the certificate."""
    terrain, threats = scenario.terrain, scenario.threats
    if terrain is None:  # pragma: no cover - make_problem has checked
        raise ScenarioError(f"{scenario.name}: terrain: none given")
    units = np.column_stack(
        [threats.position, threats.kill_radius, threats.kill_scale, threats.detection_radius, threats.detection_scale]
    )

    reach = np.maximum(threats.kill_radius, threats.detection_radius)

    def or_nan(value: float | None) -> float:
        return math.nan if value is None else float(value)

    return Rules(
        heights=terrain.heights,
        to_pixel=terrain.to_pixel.record,
        threats=units,
        spheres=pack_spheres(units),
        aircraft=derated(limits.performance(), TURBULENCE_SHARE[scenario.wind.turbulence]),
        bounds=scenario.bounds,
        start=scenario.start,
        destination=scenario.destination,
        floor=float(scenario.floor),
        ceiling=float(scenario.ceiling),
        max_turn=AIRCRAFT_TURN if limits.max_turn is None else limits.max_turn - SPARE,
        room=limits.max_turn is None,
        fly_over=scenario.flight.fly_over,
        climb=or_nan(limits.max_climb),
        dive=or_nan(limits.max_dive),
        spare=SPARE,
        clearance=float(limits.min_clearance),
        reserve=CERTIFIED_RESERVE,
        kill_margin=CERTIFIED_KILL_MARGIN,
        pitch=min(50.0, max(15.0, 0.4 * terrain.spacing)),
        start_course=or_nan(scenario.start_course),
        destination_course=or_nan(scenario.destination_course),
        start_slack=_slack(scenario, limits, scenario.start, CERTIFIED_RESERVE, CERTIFIED_SLACK),
        destination_slack=_slack(scenario, limits, scenario.destination, CERTIFIED_RESERVE, CERTIFIED_SLACK),
        near=make_cells(threats.position, reach, scenario.bounds),
        missiles=make_missiles(units),
        steep=_steep(terrain),
    )


def _with_margins(rules: Rules, scenario: Scenario, limits: Limits, reserve: float, kill_margin: float) -> Rules:
    """The same rules with another reserve and another distance from missiles."""
    return rules._replace(
        reserve=reserve,
        kill_margin=kill_margin,
        start_slack=_slack(scenario, limits, scenario.start, reserve),
        destination_slack=_slack(scenario, limits, scenario.destination, reserve),
    )


def _slack(scenario: Scenario, limits: Limits, point: Floats, reserve: float, share: float = 1.0) -> float:
    """Reserve at a fixed end, m: all of it, or the share of what the end leaves."""
    if scenario.terrain is None:  # pragma: no cover - make_problem has checked
        return reserve
    above = float(point[2] - scenario.terrain.height(point[0], point[1]))
    left = above - limits.min_clearance - 0.01
    return reserve if left >= reserve else share * max(0.0, left)


def _steep(terrain: Terrain) -> Steep:
    slopes = steepest_slopes(terrain.heights, terrain.spacing)
    most = float(slopes.max())
    # Each tile with its neighbours, so that a tile's side from any place of it is known.
    padded = np.pad(slopes, 1)
    shape = slopes.shape
    around = np.max([padded[i : i + shape[0], j : j + shape[1]] for i in range(3) for j in range(3)], axis=0)
    around.setflags(write=False)
    return Steep(most, around, TILE * terrain.spacing)


def _inset(rules: Rules) -> Rules:
    """Shrink the map of some rules by the margins, or by what the ends leave of them."""
    ends = np.stack([rules.start, rules.destination])
    low, high = ends.min(axis=0), ends.max(axis=0)
    bounds = rules.bounds.copy()
    bounds[:, 0] = np.minimum(bounds[:, 0] + MAP_MARGIN, np.maximum(bounds[:, 0], low[:2]))
    bounds[:, 1] = np.maximum(bounds[:, 1] - MAP_MARGIN, np.minimum(bounds[:, 1], high[:2]))
    bounds.setflags(write=False)
    return rules._replace(
        bounds=bounds,
        floor=min(rules.floor + HEIGHT_MARGIN, max(rules.floor, float(low[2]))),
        ceiling=max(rules.ceiling - HEIGHT_MARGIN, min(rules.ceiling, float(high[2]))),
    )


def _space(scenario: Scenario, rules: Rules) -> Space:
    """Space that a search may use; heights start at the lowest ground that a path may be above."""
    ends = min(scenario.start[2], scenario.destination[2])
    low = min(max(rules.floor, float(np.nanmin(rules.heights)) + rules.clearance), ends)
    high = max(rules.ceiling, low + 1.0)
    up = (float(low), float(high))
    return Space(scenario.start, scenario.destination, rules.bounds, up, scenario.planner.across_m)
