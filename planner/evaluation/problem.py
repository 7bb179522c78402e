"""A scenario and its limits as a planning problem: arrays for compiled code, and the space that encodings search."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import Limits, PerformanceTable, derated, within_rates
from aircraft.tracking import no_tracking
from planner.airspace.airspace_arrays import KeptAirspace, keep_airspace
from planner.airspace.kept_zones import ZoneMargins
from planner.evaluation.encoding import Space
from planner.evaluation.missile_index import make_missile_index
from planner.evaluation.problem_arrays import ProblemArrays, SlopeBounds, sphere_records, threat_records
from planner.evaluation.threat_grid import make_threat_cells
from world.errors import ScenarioError
from world.scenario import Scenario
from world.terrain import TILE, Terrain, steepest_slopes

Floats = NDArray[np.float64]

# Plans keep this inside turn and slope limits.
ANGLE_MARGIN = math.radians(0.5)
# Course changes that a plan may ask of the aircraft where no number limits them.
AIRCRAFT_TURN = math.radians(150.0)
# m above the required clearance, and outside kill spheres, that the search aims for and the certificate asks for.
# What is between the two covers the search's terrain samples and chords; what the certificate keeps covers the
# height error of a flight (1.3 m worst of 120 flights) and its cross-track error (2 m).
SEARCH_BUFFER, CERTIFIED_BUFFER = 8.0, 5.0
SEARCH_KILL_MARGIN, CERTIFIED_KILL_MARGIN = 15.0, 10.0
# The same beside zones, and under a greatest height above ground: of what the certificate leaves between that and the
# required clearance, a search keeps no more than this share on either side.
SEARCH_ZONE_MARGIN, CERTIFIED_ZONE_MARGIN = 15.0, 10.0
BAND_SHARE = 0.25
# Of what a fixed end leaves of the buffer, the share that the certificate asks for.
CERTIFIED_END_SHARE = 0.75
# More buffer for each attempt after the first, m: the search had not sampled all ground.
ATTEMPT_BUFFER = 5.0
# Of the aircraft's steepest climb and dive, the share that a plan uses: holding a path in gusts takes the rest.
TURBULENCE_SHARE = {"none": 1.0, "light": 0.9, "moderate": 0.8}
# m inside the map, and inside floor and ceiling, that a search keeps where the fixed ends do.
MAP_MARGIN, HEIGHT_MARGIN = 10.0, 4.0


@dataclass(frozen=True, slots=True)
class Problem:
    """What a search works on.

    search: arrays with the margins that a search aims for.
    certified: arrays with those that the certificate asks for.
    space: where a path may go.
    """

    scenario: Scenario
    limits: Limits
    search: ProblemArrays
    certified: ProblemArrays
    space: Space


def make_problem(scenario: Scenario, limits: Limits, attempt: int = 0) -> Problem:
    """A scenario in the form of compiled code.  Raises ScenarioError if nothing can be planned on it.

    attempt: how many searches have failed; each adds to the clearance that the next one keeps.
    """
    terrain = scenario.terrain
    if terrain is None:
        raise ScenarioError(
            f"{scenario.name}: terrain: none given; a path is planned over terrain", file=scenario.name, field="terrain"
        )
    for name in ("max_turn", "max_climb", "max_dive"):
        value = getattr(limits, name)
        if value is not None and value <= ANGLE_MARGIN:
            allowed = 'a plan keeps 0.5 inside it; allowed: above 0.5, or "aircraft"'
            raise ScenarioError.at(
                scenario.name, f"limits.{name}_deg", math.degrees(value), f"{allowed}", shown=f"{math.degrees(value):g}"
            )
    certified = _certified_arrays(scenario, limits, terrain)
    across, up = (certified.tracking.across, certified.tracking.up) if certified.tracking.strays else (0.0, 0.0)
    # What the ground rises across the way comes on top; the certificate looks at the ground there.
    buffer = SEARCH_BUFFER + attempt * ATTEMPT_BUFFER + up + across * certified.slope_bounds.steepest
    airspace = _search_airspace(scenario, certified, attempt, up)
    if airspace.max_height < math.inf:
        buffer = min(buffer, _most_buffer(certified))
    search = _inset(
        certified._replace(
            buffer=buffer,
            airspace=airspace,
            kill_margin=SEARCH_KILL_MARGIN + across,
            start_buffer=_end_buffer(terrain, limits, scenario.start, buffer),
            destination_buffer=_end_buffer(terrain, limits, scenario.destination, buffer),
        ),
        MAP_MARGIN,
        HEIGHT_MARGIN,
    )
    return Problem(scenario, limits, search, certified, _space(scenario, search))


def _certified_arrays(scenario: Scenario, limits: Limits, terrain: Terrain) -> ProblemArrays:
    """Arrays with the margins of the certificate."""
    units = threat_records(scenario.threats)
    radius = np.maximum(scenario.threats.kill_radius, scenario.threats.detection_radius)
    tracking = no_tracking() if limits.tracking is None else limits.tracking.record
    buffer, share = CERTIFIED_BUFFER + float(tracking.up), CERTIFIED_END_SHARE
    arrays = ProblemArrays(
        heights=terrain.heights,
        to_pixel=terrain.to_pixel.record,
        threats=units,
        spheres=sphere_records(units),
        aircraft=_performance(scenario, limits),
        **_edges(scenario.bounds),
        start=scenario.start,
        destination=scenario.destination,
        floor=float(scenario.floor),
        ceiling=float(scenario.ceiling),
        max_turn=AIRCRAFT_TURN if limits.max_turn is None else limits.max_turn - ANGLE_MARGIN,
        legs_hold_turns=limits.max_turn is None,
        fly_over=scenario.flight.fly_over,
        max_climb=_or_nan(limits.max_climb),
        max_dive=_or_nan(limits.max_dive),
        angle_margin=ANGLE_MARGIN,
        clearance=float(limits.min_clearance),
        buffer=buffer,
        kill_margin=CERTIFIED_KILL_MARGIN,
        sample_pitch=min(50.0, max(15.0, 0.4 * terrain.spacing)),
        start_course=_or_nan(scenario.start_course),
        destination_course=_or_nan(scenario.destination_course),
        start_buffer=_end_buffer(terrain, limits, scenario.start, buffer, share),
        destination_buffer=_end_buffer(terrain, limits, scenario.destination, buffer, share),
        threat_cells=make_threat_cells(scenario.threats.position, radius, scenario.bounds),
        missiles=make_missile_index(units),
        slope_bounds=_slope_bounds(terrain),
        tracking=tracking,
        airspace=keep_airspace(scenario, _zone_margins(scenario, CERTIFIED_ZONE_MARGIN, buffer, share), buffer),
    )
    return _inset(arrays, float(tracking.across), float(tracking.up)) if tracking.strays else arrays


def _search_airspace(scenario: Scenario, certified: ProblemArrays, attempt: int, up: float) -> KeptAirspace:
    """The airspace with the margins of a search."""
    buffer = SEARCH_BUFFER + attempt * ATTEMPT_BUFFER + up
    margins = _zone_margins(scenario, SEARCH_ZONE_MARGIN, buffer, 1.0)
    return keep_airspace(scenario, margins, min(buffer, _most_buffer(certified)))


def _zone_margins(scenario: Scenario, beside: float, beyond: float, share: float) -> ZoneMargins:
    """Margins of zones, m, changed by as much as the scenario asks to keep more or less; in height never less."""
    asked = scenario.planner.zone_margin_m
    more = 0.0 if asked is None else asked - CERTIFIED_ZONE_MARGIN
    return ZoneMargins(beside + more, beyond + max(0.0, more), share)


def _most_buffer(certified: ProblemArrays) -> float:
    """The most that a search keeps from either edge of a band of heights above ground, m; inf without one."""
    space = certified.airspace
    between = space.max_height - certified.clearance - certified.buffer - space.buffer
    return certified.buffer + BAND_SHARE * max(0.0, between)


def _performance(scenario: Scenario, limits: Limits) -> PerformanceTable:
    """What the aircraft can do, of which turbulence leaves a plan a share, and no more than its autopilot asks for."""
    table = derated(limits.performance(), TURBULENCE_SHARE[scenario.wind.turbulence])
    if limits.tracking is not None:
        table = within_rates(table, limits.tracking.climb_rate, limits.tracking.sink_rate)
    return table


def _edges(bounds: Floats) -> dict[str, float]:
    """The edges of a map with these bounds (2, 2) by name."""
    (west, east), (south, north) = bounds.tolist()
    return {"west": west, "east": east, "south": south, "north": north}


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _end_buffer(terrain: Terrain, limits: Limits, point: Floats, buffer: float, share: float = 1.0) -> float:
    """Buffer at a fixed end, m: all of it, or the share of what the end leaves."""
    above = float(point[2] - terrain.height(point[0], point[1]))
    left = above - limits.min_clearance - 0.01
    return buffer if left >= buffer else share * max(0.0, left)


def _slope_bounds(terrain: Terrain) -> SlopeBounds:
    slopes = steepest_slopes(terrain.heights, terrain.spacing)
    steepest = float(slopes.max())
    # Each tile with its neighbours, so that a tile's side from any place of it is known.
    padded = np.pad(slopes, 1)
    shape = slopes.shape
    around = np.max([padded[i : i + shape[0], j : j + shape[1]] for i in range(3) for j in range(3)], axis=0)
    around.setflags(write=False)
    return SlopeBounds(steepest, around, TILE * terrain.spacing)


def _inset(data: ProblemArrays, beside: float, height: float) -> ProblemArrays:
    """Arrays with the map and the heights shrunk by these margins (m), or by what the ends leave of them."""
    ends = np.stack([data.start, data.destination])
    low, high = ends.min(axis=0), ends.max(axis=0)
    return data._replace(
        west=min(data.west + beside, max(data.west, float(low[0]))),
        south=min(data.south + beside, max(data.south, float(low[1]))),
        east=max(data.east - beside, min(data.east, float(high[0]))),
        north=max(data.north - beside, min(data.north, float(high[1]))),
        floor=min(data.floor + height, max(data.floor, float(low[2]))),
        ceiling=max(data.ceiling - height, min(data.ceiling, float(high[2]))),
    )


def _space(scenario: Scenario, data: ProblemArrays) -> Space:
    """Space that a search may use; heights start at the lowest ground that a path may be above."""
    ends = min(scenario.start[2], scenario.destination[2])
    low = min(max(data.floor, float(np.nanmin(data.heights)) + data.clearance), ends)
    high = max(data.ceiling, low + 1.0)
    up = (float(low), float(high))
    bounds = np.array([[data.west, data.east], [data.south, data.north]])
    return Space(scenario.start, scenario.destination, bounds, up, scenario.planner.across_m)
