"""Represent a scenario and its limits as a planning problem.

It has arrays for compiled code and a search space.

`make_problem` makes two sets of arrays. `certified` has the margins that a certificate requires, which cover the errors
of a flight. `search` has larger margins, which also cover what lies between the samples of the search. Near fixed ends
that do not have these margins both require less.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from aircraft.path_limits import Limits, PerformanceTable, derate, limit_rates
from aircraft.tracking import zero_tracking_error
from planner.airspace.zone_limits import PlannerAirspace, ZoneMargins, make_airspace
from planner.evaluation.encoding import Space
from planner.evaluation.threat_index import MissileIndex, ThreatCells, make_missile_index, make_threat_cells
from planner.evaluation.travel_cost import LENGTH_COST, TravelCost, make_wind_grid
from planner.plan import Objective, Violation
from world.arrays import Floats, Heights
from world.by_reference import by_reference
from world.errors import ScenarioError
from world.frames import PolyMapRecord
from world.kernels import Record, Records, inlined, inner
from world.scenario import Scenario
from world.terrain import TILE_PIXELS, Terrain, steepest_slopes
from world.threats import Threats

# --- Arrays for compiled code ---


# A threat: its position (m), and radius and scale (m) of its missile and its radar.
THREAT = np.dtype(
    [
        (name, np.float64)
        for name in ("east", "north", "up", "kill_radius", "kill_scale", "detection_radius", "detection_scale")
    ]
)
# A threat in the form in which points are tested: its position (m), squared radii, scales to the power of four, and
# padding to the length of a cache line.
SPHERE = np.dtype(
    [
        (name, np.float64)
        for name in ("east", "north", "up", "kill_radius2", "kill_scale4", "detection_radius2", "detection_scale4")
    ]
    + [("padding", np.float64)]
)
# Violations and objectives of one path, in the order of `Violation` and `Objective`.
VIOLATIONS = np.dtype([(column.name.lower(), np.float64) for column in Violation])
OBJECTIVES = np.dtype([(column.name.lower(), np.float64) for column in Objective])


@by_reference
class SlopeBounds(NamedTuple):
    """Upper bounds on the slope of the ground, m per m.

    steepest: bound for the whole map.
    tiles: bounds within `tile_side` m of each tile of `world.terrain.TILE_PIXELS` pixels a side.
    """

    steepest: float
    tiles: Heights
    tile_side: float


@by_reference
class ProblemArrays(NamedTuple):
    """Data that paths are evaluated against; lengths in m, angles in rad.

    heights: raster of the ground.
    to_pixel: map from positions to its pixels.
    threats: `THREAT` records (m,).
    spheres: `SPHERE` records (m,) of the same threats.
    aircraft: performance of the aircraft, reduced in turbulence.
    west, east, south, north: edges of the map. floor, ceiling: lowest and highest waypoint.
    start, destination: (3,) fixed ends.
    max_turn: largest course change.
    legs_hold_turns: True if a leg must be as long as its turns.
    fly_over: True if a turn begins at its waypoint, not before it.
    max_climb, max_dive: NaN if the aircraft limits them.
    angle_margin: margin to slope limits.
    clearance: required height above ground. buffer: additional height; start_buffer and destination_buffer at the ends.
    buffer_growth: growth of the buffer away from an end that has less, m per m.
    kill_margin: required distance between the path and missile spheres.
    sample_spacing: spacing of terrain samples along a leg, in the graded scores.
    start_course, destination_course: NaN if none is prescribed.
    threat_cells: the threats by the points that they may reach.
    missiles: the missiles by position.
    slope_bounds: bounds on the slope of the ground.
    tracking: a record of `aircraft.tracking.TRACKING`, the autopilot's tracking error.
    airspace: zones and the maximum height above ground.
    travel: the cost that shortening reduces, which is a path's length, time or energy.
    """

    heights: Heights
    to_pixel: PolyMapRecord
    threats: Records
    spheres: Records
    aircraft: PerformanceTable
    west: float
    east: float
    south: float
    north: float
    start: Floats
    destination: Floats
    floor: float
    ceiling: float
    max_turn: float
    legs_hold_turns: bool
    fly_over: bool
    max_climb: float
    max_dive: float
    angle_margin: float
    clearance: float
    buffer: float
    kill_margin: float
    sample_spacing: float
    start_course: float
    destination_course: float
    start_buffer: float
    destination_buffer: float
    buffer_growth: float
    threat_cells: ThreatCells
    missiles: MissileIndex
    slope_bounds: SlopeBounds
    tracking: Record
    airspace: PlannerAirspace
    travel: TravelCost


def threat_records(threats: Threats) -> Records:
    """Return the threats of a scenario as `THREAT` records (m,)."""
    records = np.zeros(len(threats.position), dtype=THREAT)
    for axis, name in enumerate(("east", "north", "up")):
        records[name] = threats.position[:, axis]
    for name in ("kill_radius", "kill_scale", "detection_radius", "detection_scale"):
        records[name] = getattr(threats, name)
    records.setflags(write=False)
    return records


def sphere_records(threats: Records) -> Records:
    """Convert `THREAT` records to `SPHERE` records (m,).

    The radii are squared, and the scales have their fourth powers.
    """
    spheres = np.zeros(len(threats), dtype=SPHERE)
    for name in ("east", "north", "up"):
        spheres[name] = threats[name]
    for kind in ("kill", "detection"):
        radius = threats[f"{kind}_radius"]
        # A radius of 0 means no weapon, and no squared distance is below -1.
        spheres[f"{kind}_radius2"] = np.where(radius > 0.0, radius * radius, -1.0)
        spheres[f"{kind}_scale4"] = threats[f"{kind}_scale"] ** 4
    spheres.setflags(write=False)
    return spheres


def as_columns(records: Records) -> Floats:
    """Return records (n,) whose fields are all float64 as a table (n, fields)."""
    return records.view(np.float64).reshape(len(records), -1)


# --- Required clearance ---

# Growth of the clearance buffer away from an end without it, m per m.
BUFFER_GROWTH_RATIO = 0.05
# Upper limit of this growth as a fraction of the remaining slopes of an aircraft with a climb reserve.
MAX_GROWTH_FRACTION = 0.5


class RequiredClearance(NamedTuple):
    """The height above ground that a path requires at each point; lengths in m.

    clearance: height required everywhere. buffer: additional height away from the ends.
    start_east, start_north, destination_east, destination_north: the ends.
    start_buffer, destination_buffer: buffer at the ends.
    same_everywhere: True if the ends have the full buffer.
    growth: slope of the required height due to the buffer, m per m.
    steepest_loss: fastest possible loss of height above the required height, m per m.
    sample_spacing: spacing of terrain samples.
    """

    clearance: float
    buffer: float
    start_east: float
    start_north: float
    start_buffer: float
    destination_east: float
    destination_north: float
    destination_buffer: float
    same_everywhere: bool
    growth: float
    steepest_loss: float
    sample_spacing: float


@inner
def required_clearance(data: ProblemArrays) -> RequiredClearance:
    """Return the height above ground that a problem requires at each point of a path."""
    return _make_required_clearance(data, data.clearance, data.buffer, data.start_buffer, data.destination_buffer)


@inner
def required_headroom(data: ProblemArrays) -> RequiredClearance:
    """Express the maximum height above ground as a required clearance above the ground turned upside down.

    If the heights of the path and of the ground are negated, a path below the maximum height becomes a path above this
    clearance, so that the same code checks both.
    """
    space = data.airspace
    return _make_required_clearance(data, -space.max_height, space.buffer, space.start_buffer, space.destination_buffer)


@inlined
def _make_required_clearance(
    data: ProblemArrays, clearance: float, buffer: float, start_buffer: float, destination_buffer: float
) -> RequiredClearance:
    """Make a required clearance with different buffers at the two ends and away from them.

    clearance: height above ground, m.
    buffer, start_buffer, destination_buffer: additional heights away from the ends and at them, m.
    """
    same_everywhere = min(start_buffer, destination_buffer) >= buffer
    growth = 0.0 if same_everywhere else data.buffer_growth
    return RequiredClearance(
        clearance,
        buffer,
        data.start[0],
        data.start[1],
        start_buffer,
        data.destination[0],
        data.destination[1],
        destination_buffer,
        same_everywhere,
        growth,
        data.slope_bounds.steepest + growth,
        data.sample_spacing,
    )


@inlined
def clearance_at(required: RequiredClearance, east: float, north: float) -> float:
    """Return the required height above ground (the clearance plus the buffer) at a position, m.

    required: clearance, and buffers at both ends and between them, m.
    east, north: m.

    If an end has less than the full buffer, the buffer grows with the distance from this end.
    """
    # Without branches, so that loops over many points become vector instructions: an end with the full buffer never
    # reduces it.
    dx, dy = east - required.start_east, north - required.start_north
    buffer = required.start_buffer + required.growth * math.sqrt(dx * dx + dy * dy)
    dx, dy = east - required.destination_east, north - required.destination_north
    destination_buffer = required.destination_buffer + required.growth * math.sqrt(dx * dx + dy * dy)
    buffer = destination_buffer if destination_buffer < buffer else buffer
    buffer = buffer if buffer < required.buffer else required.buffer
    return required.clearance + buffer


# --- Margins ---

# Margin of plans to turn and slope limits, rad.
ANGLE_MARGIN_RAD = math.radians(0.5)
# Largest course change of a plan if no number limits it, rad.
MAX_AIRCRAFT_TURN_RAD = math.radians(150.0)
# Margins of the search are larger than the certificate's margins by the effect of its terrain samples and chords; the
# certificate's margins cover the altitude error of a flight (1.3 m worst of 120 flights) and its cross-track error
# (2 m).
# Height above the required clearance in a search, m.
SEARCH_BUFFER_M = 8.0
# Height above the required clearance in the certificate, m.
CERTIFIED_BUFFER_M = 5.0
# Distance from kill spheres in a search, m.
SEARCH_KILL_MARGIN_M = 15.0
# Distance from kill spheres in the certificate, m.
CERTIFIED_KILL_MARGIN_M = 10.0
# Distance from zones, and below a maximum height above ground, in a search, m.
SEARCH_ZONE_MARGIN_M = 15.0
# Distance from zones in the certificate, m.
CERTIFIED_ZONE_MARGIN_M = 10.0
# Largest margin of a search on either side of a band, as a fraction of the band between the certificate's limits.
BAND_FRACTION = 0.25
# Fraction of the height available above the clearance at a fixed end that the certificate requires as a buffer.
CERTIFIED_END_FRACTION = 0.75
# Additional buffer per attempt after the first, m, because the samples of the previous search missed ground.
ATTEMPT_BUFFER_M = 5.0
# Fraction of the aircraft's steepest climb and dive that a plan uses; the rest is reserved for gusts.
SLOPE_FRACTION_BY_TURBULENCE = {"none": 1.0, "light": 0.9, "moderate": 0.8}
# Margin of a search to the map's edges, m, if the fixed ends allow it.
MAP_MARGIN_M = 10.0
# Margin of a search to floor and ceiling, m, if the fixed ends allow it.
HEIGHT_MARGIN_M = 4.0


@dataclass(frozen=True, slots=True)
class Problem:
    """A scenario, the limits of the UAV, and the arrays that compiled code searches and certifies with.

    search: arrays with the margins that a search aims for.
    certified: arrays with the margins that the certificate requires.
    space: search space of the encodings.
    """

    scenario: Scenario
    limits: Limits
    search: ProblemArrays
    certified: ProblemArrays
    space: Space


def make_problem(scenario: Scenario, limits: Limits, attempt: int = 0) -> Problem:
    """Make the planning problem of a scenario.

    attempt: number of searches that have already failed; each failure increases the clearance of the next search.

    Raises ScenarioError without terrain, or for a turn or slope limit within the margin that a plan keeps to it.
    """
    terrain = scenario.terrain
    if terrain is None:
        raise ScenarioError(
            f"{scenario.name}: terrain: missing; a path can only be planned over terrain",
            file=scenario.name,
            field="terrain",
        )
    for field in ("max_turn", "max_climb", "max_dive"):
        value = getattr(limits, field)
        if value is not None and value <= ANGLE_MARGIN_RAD:
            allowed = 'a plan keeps a margin of 0.5 degrees to this limit; allowed: above 0.5, or "aircraft"'
            raise ScenarioError.at(
                scenario.name,
                f"limits.{field}_deg",
                math.degrees(value),
                allowed,
                shown=f"{math.degrees(value):g}",
            )
    certified = _certified_arrays(scenario, limits, terrain)
    across, up = (certified.tracking.across, certified.tracking.up) if certified.tracking.has_error else (0.0, 0.0)
    # Include the rise of the ground across the tracking error, where the certificate measures the ground.
    extra_buffer = limits.reserve_height + up + across * certified.slope_bounds.steepest
    buffer = SEARCH_BUFFER_M + attempt * ATTEMPT_BUFFER_M + extra_buffer
    # The margins of a search exceed those of the certificate, and grow with each attempt.
    zone_buffer = SEARCH_BUFFER_M + attempt * ATTEMPT_BUFFER_M + up
    margins = _zone_margins(scenario, SEARCH_ZONE_MARGIN_M, zone_buffer + limits.reserve_threats, 1.0)
    airspace = make_airspace(
        scenario, margins, min(zone_buffer + limits.reserve_above, _max_buffer(certified, certified.airspace.buffer))
    )
    if airspace.max_height < math.inf:
        buffer = min(buffer, _max_buffer(certified, certified.buffer))
    # A search avoids unknown ground, because it has the height of the ceiling there. The certificate uses the original
    # terrain.
    heights, slope_bounds = terrain.heights, certified.slope_bounds
    is_unknown = np.isnan(heights)
    if is_unknown.any():
        # A height depends on the four pixels around it, so a pixel next to an unknown one is filled too.
        padded, (rows, cols) = np.pad(is_unknown, 1), is_unknown.shape
        is_filled = np.any([padded[i : i + rows, j : j + cols] for i in range(3) for j in range(3)], axis=0)
        filled = replace(terrain, heights=np.where(is_filled, np.float32(certified.ceiling), heights))
        heights = filled.heights
        slope_bounds = _make_slope_bounds(filled)._replace(steepest=slope_bounds.steepest)
    search = _shrink_area(
        certified._replace(
            heights=heights,
            slope_bounds=slope_bounds,
            buffer=buffer,
            airspace=airspace,
            kill_margin=SEARCH_KILL_MARGIN_M + limits.reserve_threats + across,
            start_buffer=_end_buffer(terrain, limits, scenario.start, buffer),
            destination_buffer=_end_buffer(terrain, limits, scenario.destination, buffer),
        ),
        MAP_MARGIN_M,
        HEIGHT_MARGIN_M,
    )
    # The lowest altitude of the search is the lowest one that the ground allows.
    lowest_end = min(scenario.start[2], scenario.destination[2])
    min_altitude = min(max(search.floor, float(np.nanmin(search.heights)) + search.clearance), lowest_end)
    altitude_range = (float(min_altitude), float(max(search.ceiling, min_altitude + 1.0)))
    bounds = np.array([[search.west, search.east], [search.south, search.north]])
    space = Space(scenario.start, scenario.destination, bounds, altitude_range, scenario.planner.across_m)
    return Problem(scenario, limits, search, certified, space)


def _certified_arrays(scenario: Scenario, limits: Limits, terrain: Terrain) -> ProblemArrays:
    """Return the arrays of a problem with the margins of the certificate.

    The margins cover the errors of a flight, the autopilot's tracking error and the reserves that `limits` state.
    """
    threats = threat_records(scenario.threats)
    radius = np.maximum(scenario.threats.kill_radius, scenario.threats.detection_radius)
    tracking = zero_tracking_error() if limits.tracking is None else limits.tracking.record
    vertical, end_fraction = CERTIFIED_BUFFER_M + float(tracking.up), CERTIFIED_END_FRACTION
    buffer, vertical_zone_margin = vertical + limits.reserve_height, vertical + limits.reserve_threats
    # The aircraft's performance, reduced for turbulence and by the autopilot's vertical rates.
    climb_fraction = sink_fraction = SLOPE_FRACTION_BY_TURBULENCE[scenario.wind.turbulence]
    if limits.tracking is not None:
        climb_fraction = min(climb_fraction, limits.tracking.own_climb_share)
        sink_fraction = min(sink_fraction, limits.tracking.own_sink_share)
    aircraft = derate(limits.performance(), climb_fraction, sink_fraction, limits.reserve_climb, limits.reserve_sink)
    if limits.tracking is not None:
        aircraft = limit_rates(aircraft, limits.tracking.climb_rate, limits.tracking.sink_rate)
    # With a reserve above or below the path, the growth of the buffer is also limited by the slopes that the aircraft
    # has left at both ends, so that it can follow the growth.
    buffer_growth = BUFFER_GROWTH_RATIO
    if limits.reserve_height or limits.reserve_above:
        slopes = [
            float(np.interp(point[2], aircraft.amsl, angles))
            for point in (scenario.start, scenario.destination)
            for angles in (aircraft.climb, aircraft.descent)
        ]
        buffer_growth = min(BUFFER_GROWTH_RATIO, MAX_GROWTH_FRACTION * max(0.0, math.tan(min(slopes))))
    (west, east), (south, north) = scenario.bounds.tolist()
    arrays = ProblemArrays(
        heights=terrain.heights,
        to_pixel=terrain.to_pixel.record,
        threats=threats,
        spheres=sphere_records(threats),
        aircraft=aircraft,
        west=west,
        east=east,
        south=south,
        north=north,
        start=scenario.start,
        destination=scenario.destination,
        floor=float(scenario.floor),
        ceiling=float(scenario.ceiling),
        max_turn=MAX_AIRCRAFT_TURN_RAD if limits.max_turn is None else limits.max_turn - ANGLE_MARGIN_RAD,
        legs_hold_turns=limits.max_turn is None,
        fly_over=scenario.flight.fly_over,
        max_climb=_none_to_nan(limits.max_climb),
        max_dive=_none_to_nan(limits.max_dive),
        angle_margin=ANGLE_MARGIN_RAD,
        clearance=float(limits.min_clearance),
        buffer=buffer,
        kill_margin=CERTIFIED_KILL_MARGIN_M + limits.reserve_threats,
        # Less than half the spacing of the elevation data, so that no cell is skipped; limited for very fine or coarse
        # data.
        sample_spacing=min(50.0, max(15.0, 0.4 * terrain.spacing)),
        start_course=_none_to_nan(scenario.start_course),
        destination_course=_none_to_nan(scenario.destination_course),
        start_buffer=_end_buffer(terrain, limits, scenario.start, buffer, end_fraction),
        destination_buffer=_end_buffer(terrain, limits, scenario.destination, buffer, end_fraction),
        buffer_growth=buffer_growth,
        threat_cells=make_threat_cells(scenario.threats.position, radius, scenario.bounds),
        missiles=make_missile_index(threats),
        slope_bounds=_make_slope_bounds(terrain),
        tracking=tracking,
        airspace=make_airspace(
            scenario,
            _zone_margins(scenario, CERTIFIED_ZONE_MARGIN_M, vertical_zone_margin, end_fraction),
            vertical + limits.reserve_above,
        ),
        travel=LENGTH_COST._replace(winds=make_wind_grid(scenario, aircraft)),
    )
    return _shrink_area(arrays, float(tracking.across), float(tracking.up)) if tracking.has_error else arrays


def _zone_margins(scenario: Scenario, horizontal: float, vertical: float, end_fraction: float) -> ZoneMargins:
    """Return the required margins to zones, changed by the scenario's `zone_margin_m` if it is stated.

    horizontal, vertical: margins without `zone_margin_m`, m.
    end_fraction: as in `ZoneMargins`.

    `zone_margin_m` changes the horizontal margin by its difference from `CERTIFIED_ZONE_MARGIN_M`. An increase also
    applies to the vertical margin, a reduction does not.
    """
    requested_margin = scenario.planner.zone_margin_m
    extra_margin = 0.0 if requested_margin is None else requested_margin - CERTIFIED_ZONE_MARGIN_M
    return ZoneMargins(horizontal + extra_margin, vertical + max(0.0, extra_margin), end_fraction)


def _max_buffer(certified: ProblemArrays, certified_margin: float) -> float:
    """Return the largest buffer of a search above the required clearance, or below the maximum height, m.

    certified_margin: margin of the certificate to the same limit, m.

    A path has to stay in the band between these two limits. A search may exceed the certificate's margin by a fraction
    of the height of this band. The buffer is inf without a maximum height.
    """
    space = certified.airspace
    band_height = space.max_height - certified.clearance - certified.buffer - space.buffer
    return certified_margin + BAND_FRACTION * max(0.0, band_height)


def _none_to_nan(value: float | None) -> float:
    """Return a number, or NaN for None."""
    return math.nan if value is None else float(value)


def _end_buffer(terrain: Terrain, limits: Limits, point: Floats, buffer: float, fraction: float = 1.0) -> float:
    """Return the buffer (height required above the clearance) at a fixed end, m.

    point: position of the end, (3,) m.
    buffer: full buffer, m.
    fraction: fraction of the available height that becomes the buffer if the end is too low for the full buffer.
    """
    height_above_ground = float(point[2] - terrain.height(point[0], point[1]))
    # 1 cm less, against rounding.
    available_height = height_above_ground - limits.min_clearance - 0.01
    return buffer if available_height >= buffer else fraction * max(0.0, available_height)


def _make_slope_bounds(terrain: Terrain) -> SlopeBounds:
    """Return upper bounds on the terrain's slope: everywhere, and within each tile and its neighbours."""
    slopes = steepest_slopes(terrain.heights, terrain.spacing)
    max_slope = float(slopes.max())
    # Each tile with its neighbours, so that the bound holds within a tile's side of any of its points.
    padded = np.pad(slopes, 1)
    shape = slopes.shape
    neighbourhood_max = np.max([padded[i : i + shape[0], j : j + shape[1]] for i in range(3) for j in range(3)], axis=0)
    neighbourhood_max.setflags(write=False)
    return SlopeBounds(max_slope, neighbourhood_max, TILE_PIXELS * terrain.spacing)


def _shrink_area(data: ProblemArrays, lateral: float, height: float) -> ProblemArrays:
    """Reduce the arrays' area and range of altitudes by margins.

    Both fixed ends stay inside.

    lateral: margin to the edges of the map, m.
    height: margin to floor and ceiling, m.
    """
    ends = np.stack([data.start, data.destination])
    min_end, max_end = ends.min(axis=0), ends.max(axis=0)
    return data._replace(
        west=min(data.west + lateral, max(data.west, float(min_end[0]))),
        south=min(data.south + lateral, max(data.south, float(min_end[1]))),
        east=max(data.east - lateral, min(data.east, float(max_end[0]))),
        north=max(data.north - lateral, min(data.north, float(max_end[1]))),
        floor=min(data.floor + height, max(data.floor, float(min_end[2]))),
        ceiling=max(data.ceiling - height, min(data.ceiling, float(max_end[2]))),
    )
