"""Find the volumes and the ground risk class of a mission by SORA 2.5.

They follow from many flights and from formulas.

Each flight of a campaign gives two areas: the area below the flight and its simulated returns to launch (here:
returns), and the area in which the aircraft can fall from them.  The flight geography is a corridor around the planned
path and around the path of the flight without variations; it contains a fraction of the flights.  Contingency volume
and ground risk buffer contain all flights, returns and falls, and the volumes by the formulas of SORA's annex A.  Each
volume has one width along the whole path: the largest width that is needed anywhere.
"""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from aircraft.catalog import Aircraft
from flight.autopilots.simulated_returns import RETURN_GROUND_IMPACT
from flight.mission.itinerary import Position
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, fly_to_end
from flight.simulation.track import Track
from logs.verdict.measures.route_requirements import true_airspeed_route
from logs.verdict.returns.glide_map import glide_slopes
from logs.verdict.returns.judge_returns import engine_out_world, make_return_world
from logs.verdict.returns.return_starts import flown_starts
from planfly.campaigns.campaign_base import CampaignBase, GivenWind, vary_flight
from planfly.campaigns.dispersions import draw_flight
from planfly.campaigns.fall import impact_points, plate_drag
from planfly.campaigns.flight_requests import FlightRequest
from planfly.campaigns.flight_row import FlightRow, Outcome
from planfly.campaigns.sora import (
    ContingencyFormula,
    ballistic_buffer,
    glide_buffer,
    ground_risk_class,
    min_geography_half_width,
    one_to_one_buffer,
)
from planfly.campaigns.worker_pool import Workers, worker_pool
from planfly.runtime.stages import Advance
from world.airspace.zones_on_map import zone_parts
from world.arrays import Floats
from world.errors import ArgumentError, FlightError, ScenarioError, StartError
from world.population import Population, PopulationUnit, read_population
from world.terrain import Terrain
from world.wind import Wind

# Time between the positions of a flight from which falls begin, s.
_SAMPLE_INTERVAL_S = 1.0
# Number of rows of a return's path, one each second, between the positions from which falls begin.
_RETURN_SAMPLE_ROWS = 5
# Angle between the course and the bearing of the target at which the turn of a return ends, rad.
_TURN_END_ANGLE_RAD = math.radians(5.0)
# Largest deviation of a simplified outline from the exact outline, m.
_OUTLINE_TOLERANCE_M = 0.5
# End reason of a flight that flew its mission to the end.
_COMPLETED = "completed"


@dataclass(frozen=True, slots=True)
class GroundRiskGoal:
    """Request for the ground risk of a mission.

    probability: fraction of the flights that the flight geography contains.
    flights: number of flights.
    interval: time between the starts of two simulated returns, s.
    glide: True to include the glide after an engine failure.
    speed: highest speed of the aircraft, m/s; None for the highest airspeed of its model.
    controlled: True for a controlled ground area.
    population: file of the population raster, or None.
    unit: unit of the raster's numbers.
    """

    probability: float = 0.95
    flights: int = 100
    interval: float = 10.0
    glide: bool = False
    speed: float | None = None
    controlled: bool = False
    population: Path | None = None
    unit: PopulationUnit = "per-cell"


@dataclass(frozen=True, slots=True)
class ExcursionRow(FlightRow):
    """Row of a flight with the areas that it needs.

    deviation: largest horizontal distance of the flight from the nominal paths, m.  The nominal paths are the planned
        path and the path of the flight without variations.
    turn_deviation: largest horizontal distance from the nominal paths in flight or in the first turn of a return, m.
    height: largest height above ground in flight, m.
    return_height: largest height above ground in flight or in a return, m.
    ground_speed: highest speed over the ground, m/s.
    flown: area below the flight and its returns, on the map, m, as well-known binary (WKB).
    fallen: area in which falls from the flight and its returns end, including `flown`, in the same format.
    """

    deviation: float = math.nan
    turn_deviation: float = math.nan
    height: float = math.nan
    return_height: float = math.nan
    ground_speed: float = math.nan
    flown: bytes = b""
    fallen: bytes = b""


def fly_for_excursions(
    base: CampaignBase, index: int, wind: GivenWind | None = None, *, path: BaseGeometry, interval: float, glide: bool
) -> ExcursionRow:
    """Fly one flight of a campaign and its returns.

    Return its row with the area below them and the area of falls.

    index: number of the flight, from 0.
    wind: mean wind that replaces the scenario's wind; None for the scenario's wind.
    path: planned path, and path of the flight without variations, m.
    interval: time between the starts of two returns, s.
    glide: True to include the glide after an engine failure.

    Without terrain, and for a flight that ends at its start, the row contains only draw, outcome and reason of the end.
    """
    draw = draw_flight(base.dispersions, base.seed, index)
    varied = vary_flight(base, draw, wind)
    setup, off_nominal = varied.setup, varied.off_nominal
    try:
        flight = Flight(setup, varied.uav.aircraft, off_nominal.variation, start_offset=off_nominal.start_offset)
    except StartError as error:
        return ExcursionRow(draw=draw, outcome="not flyable", ended=str(error))
    flown_mission = fly_to_end(flight)
    outcome: Outcome = "flyable" if flown_mission.ended == _COMPLETED else "not flyable"
    row = ExcursionRow(draw=draw, outcome=outcome, ended=flown_mission.ended)
    terrain = setup.scenario.terrain
    if len(flown_mission.track) < 2 or terrain is None:
        return row
    times, positions, velocities = _sample_flight(flown_mission.track)
    paths = _return_paths(setup, flown_mission.track, interval, glide=glide)
    uav = varied.uav.aircraft
    # Positions of flight and returns, and ground velocities, (n, 3) each; a return is sampled at every
    # `_RETURN_SAMPLE_ROWS`-th position, one each second, and at its last one.
    sampled = [(positions, velocities)]
    for return_path in paths.returns:
        rows = np.union1d(np.arange(0, len(return_path), _RETURN_SAMPLE_ROWS), [len(return_path) - 1])
        sampled.append((return_path[rows], np.gradient(return_path, axis=0)[rows]))
    half_span = 0.5 * uav.wing_span
    lines = [shapely.LineString(each[:, :2]) for each in (positions, *paths.returns)]
    turns = turn_areas(times, positions, paths.times, paths.turns, interval)
    areas = [*shapely.buffer(lines, half_span), *paths.loiters, *areas_between(paths.returns), *turns]
    flown_area = shapely.union_all(areas)
    # Falls use the wind of the forecast at half the flight's duration.
    half_time = 0.5 * float(flown_mission.track.time[-1])

    def find_wind(places: Floats) -> Floats:
        """Return the wind at places, m, (n, 3), at half the flight's duration, m/s, (n, 2)."""
        return setup.scenario.wind_velocities(places, np.full(len(places), half_time))

    # Areas in which the aircraft can fall from each path: unions of hulls, each of which contains a piece of the path
    # and the impact points of falls from that piece.
    all_positions, all_velocities = (np.concatenate(values) for values in zip(*sampled, strict=True))
    impacts = [
        impact_points(all_positions, all_velocities, drag, find_wind, terrain) for drag in (0.0, plate_drag(uav))
    ]
    points = np.stack([all_positions[:, :2], *impacts], axis=1)
    falls = []
    for path_points in np.split(points, np.cumsum([len(places) for places, _ in sampled])[:-1]):
        corners = np.concatenate([path_points[:-1], path_points[1:]], axis=1)
        falls.append(shapely.union_all(shapely.convex_hull(shapely.multipoints(shapely.points(corners)))))
    glides = shapely.buffer([shapely.LineString(glide_path[:, :2]) for glide_path in paths.glides], 1.0)
    fallen_area = shapely.union_all([flown_area, *falls, *glides])
    height = _largest_height(positions, terrain)
    deviation = float(shapely.distance(shapely.points(positions[:, :2]), path).max())
    return replace(
        row,
        duration=float(flown_mission.track.time[-1]),
        deviation=deviation,
        turn_deviation=max([deviation, *(_distance_beyond(area, path) for area in turns)]),
        height=height,
        return_height=max([height, *(_largest_height(each, terrain) for each in paths.returns)]),
        ground_speed=float(np.hypot(velocities[:, 0], velocities[:, 1]).max()),
        flown=shapely.to_wkb(flown_area.simplify(_OUTLINE_TOLERANCE_M)),
        fallen=shapely.to_wkb(fallen_area.buffer(half_span).simplify(_OUTLINE_TOLERANCE_M)),
    )


def _sample_flight(track: Track) -> tuple[Floats, Floats, Floats]:
    """Sample a track every `_SAMPLE_INTERVAL_S`, and at its end; rows that are not finite are left out.

    Return times, s, (n,), positions, m, (n, 3), and ground velocities, m/s, (n, 3).
    """
    is_usable = np.isfinite(track.position).all(axis=1) & np.isfinite(track.velocity).all(axis=1)
    rows = np.flatnonzero(is_usable)
    steps = np.floor(track.time[rows] / _SAMPLE_INTERVAL_S + 1e-9)
    is_kept = np.concatenate([[True], np.diff(steps) > 0.0])
    is_kept[-1] = True
    sampled_rows = rows[is_kept]
    return track.time[sampled_rows], track.position[sampled_rows], track.velocity[sampled_rows].astype(np.float64)


class _ReturnPaths(NamedTuple):
    """Paths of the simulated returns to launch from a flight, in the order of their starts.

    times: start time of each return, s, (n,).
    returns: positions of each return, m, (k, 3).
    turns: positions of each return up to where it heads for its target, m, (k, 3).
    loiters: areas of the loiters around the targets, m.
    glides: positions of each glide that ends at the ground, m, (k, 3).
    """

    times: Floats
    returns: list[Floats]
    turns: list[Floats]
    loiters: list[BaseGeometry]
    glides: list[Floats]


def _return_paths(setup: FlightSetup, track: Track, interval: float, *, glide: bool) -> _ReturnPaths:
    """Simulate the returns to launch from a track, and return their paths.

    There are none for a mission without home.

    interval: time between the starts of two returns, s.
    glide: True to simulate also returns after an engine failure; only their glides that reach the ground are kept.
    """
    no_returns = _ReturnPaths(np.zeros(0), [], [], [], [])
    if setup.mission.home is None:
        return no_returns
    world, starts = make_return_world(setup), flown_starts(setup, track, interval)
    if not len(starts):
        return no_returns
    targets = [world.target(row) for row in starts.rows]
    paths = world.fly(starts.rows, targets, store_positions=True).tracks
    radius = abs(world.autopilot.returns.rules.radius)
    positions = {target.position[:2] for target in targets if not target.straight}
    glides: list[Floats] = []
    if glide and world.aircraft.glides:
        gliding_world = engine_out_world(world)
        gliding_targets = [gliding_world.target(row) for row in starts.rows]
        gliding = gliding_world.fly(starts.rows, gliding_targets, store_positions=True, engine_out=True)
        glides = [
            glide_path
            for glide_path, result in zip(gliding.tracks, gliding.results, strict=True)
            if len(glide_path) > 1 and result["outcome"] == RETURN_GROUND_IMPACT
        ]
    loiters = [shapely.Point(position).buffer(radius) for position in positions]
    flown_indices = [k for k, path in enumerate(paths) if len(path) > 1]
    returns = [paths[k] for k in flown_indices]
    radii = [0.0 if target.straight else radius for target in targets]
    turns = [turn_of_return(paths[k], targets[k].position, radii[k]) for k in flown_indices]
    return _ReturnPaths(starts.time[flown_indices], returns, turns, loiters, glides)


def turn_of_return(path: Floats, target: Position, radius: float) -> Floats:
    """Return the positions of a return until the aircraft heads for its target, m, (n, 3).

    path: positions of the return, m, (n, 3).
    target: center of the loiter at the end of the return, m.
    radius: radius of this loiter, m; 0 without a loiter.  A course that meets the loiter also heads for the target.
    """
    steps, to_target = np.diff(path[:, :2], axis=0), np.array(target[:2]) - path[:-1, :2]
    along = np.sum(steps * to_target, axis=1)
    across = np.abs(steps[:, 0] * to_target[:, 1] - steps[:, 1] * to_target[:, 0])
    allowed = np.maximum(math.sin(_TURN_END_ANGLE_RAD) * np.linalg.norm(to_target, axis=1), radius)
    is_headed = (along > 0.0) & (across <= allowed * np.linalg.norm(steps, axis=1))
    return path[: int(np.argmax(is_headed)) + 1] if is_headed.any() else path


def turn_areas(
    times: Floats, positions: Floats, start_times: Floats, turns: list[Floats], interval: float
) -> list[BaseGeometry]:
    """Return areas that contain the first turns of returns.

    The returns are those that may start between two simulated returns.

    Each area is the path flown between two successive starts, widened by the larger extent of their turns from it.

    times, positions: times, s, (n,), and positions, m, (n, 3), of the flight.
    start_times: times of the returns' starts, s, (m,).
    turns: positions of each return in its first turn, m, (k, 3).
    interval: time after the last start over which returns may start, s.
    """
    areas = []
    for k, (start, end) in enumerate(itertools.pairwise([*start_times, *(start_times[-1:] + interval)])):
        first = max(0, int(np.searchsorted(times, start, side="right")) - 1)
        part = positions[first : int(np.searchsorted(times, end)) + 1, :2]
        line = shapely.LineString(part) if len(part) > 1 else shapely.Point(part[0])
        width = shapely.distance(shapely.points(np.concatenate(turns[k : k + 2])[:, :2]), line).max()
        areas.append(line.simplify(_OUTLINE_TOLERANCE_M).buffer(float(width)))
    return areas


def areas_between(paths: list[Floats]) -> list[BaseGeometry]:
    """Return an area for each pair of successive returns, bounded by the paths of the two.

    It is taken to contain the returns that start between the two.

    paths: positions of each return, m, (k, 3).
    """
    lines = [shapely.get_coordinates(shapely.LineString(path[:, :2]).simplify(_OUTLINE_TOLERANCE_M)) for path in paths]
    rings = [np.concatenate([line, next_line[::-1]]) for line, next_line in itertools.pairwise(lines)]
    return [shapely.make_valid(shapely.Polygon(ring)) for ring in rings]


def _largest_height(positions: Floats, terrain: Terrain) -> float:
    """Return the largest height of positions above ground, m; -inf if no ground is known."""
    heights = positions[:, 2] - terrain.height(positions[:, 0], positions[:, 1])
    return float(np.max(heights, where=np.isfinite(heights), initial=-math.inf))


class FlownVolumes(NamedTuple):
    """Dimensions of the volumes that the flights need, m.

    deviation: distance from the path that the goal's fraction of the flights does not exceed.
    height: height above ground that the same fraction of the flights does not exceed.
    contingency_width: largest distance of a flight, or of the turn of a return, beyond the flight geography.
    return_distance: largest distance of a flight or a return beyond the flight geography.
    contingency_height: largest height above ground of a flight or a return.
    buffer_width: largest distance of an impact beyond flights, returns and flight geography.
    """

    deviation: float
    height: float
    contingency_width: float
    return_distance: float
    contingency_height: float
    buffer_width: float


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class GroundRiskResult:
    """Result of `planfly.ground_risk`.

    flown: dimensions that the flights need.
    formula: contingency volume by formula.
    glide_ratio: best glide ratio of the aircraft; None if glides are not requested.
    speed: highest speed of the aircraft, m/s.
    geography: area of the flight geography, on the map, m.
    volume: area of the operational volume, which is flight geography and contingency volume.
    footprint: area of the operational volume and the ground risk buffer.
    population: population in the footprint; None without a raster.
    ground_class: intrinsic ground risk class; None if it is not judged, or if the operation is not part of SORA.
    files: files written; empty if no folder was named.
    """

    goal: GroundRiskGoal
    base: CampaignBase
    rows: tuple[ExcursionRow, ...]
    flown: FlownVolumes
    formula: ContingencyFormula
    glide_ratio: float | None
    speed: float
    geography: BaseGeometry
    volume: BaseGeometry
    footprint: BaseGeometry
    population: Population | None = None
    ground_class: int | None = None
    files: tuple[Path, ...] = ()

    def __repr__(self) -> str:
        return f"<GroundRiskResult {self.base.name}: {self.ground_class}>"

    @property
    def aircraft(self) -> Aircraft:
        """Aircraft of the mission."""
        return self.base.uav.aircraft

    @property
    def lost(self) -> int:
        """Number of flights that have no row, because they could not be flown."""
        return self.goal.flights - len(self.rows)

    @property
    def half_width(self) -> float:
        """Distance from the path to the edge of the flight geography, m."""
        return max(self.flown.deviation, min_geography_half_width(self.aircraft.wing_span))

    @property
    def volume_height(self) -> float:
        """Height of the operational volume above ground, m: the larger of the flown and the calculated height."""
        return max(self.flown.contingency_height, self.formula.height)

    @property
    def contingency_width(self) -> float:
        """Width of the contingency volume, m: the larger of the flown and the calculated width."""
        return max(self.flown.contingency_width, self.formula.width)

    @property
    def one_to_one_buffer(self) -> float:
        """Width of the ground risk buffer by the 1:1 rule, m."""
        return one_to_one_buffer(self.volume_height, self.aircraft.wing_span)

    @property
    def ballistic_buffer(self) -> float:
        """Width of the ground risk buffer for a fall without drag, m; for comparison only."""
        return ballistic_buffer(self.volume_height, self.aircraft.wing_span, self.speed)

    @property
    def glide_buffer(self) -> float | None:
        """Width of the ground risk buffer for an unpowered glide, m; None if glides are not requested."""
        return None if self.glide_ratio is None else glide_buffer(self.volume_height, self.glide_ratio)

    @property
    def buffer_width(self) -> float:
        """Width of the ground risk buffer, m: the largest of the flown and the calculated widths."""
        return max(self.flown.buffer_width, self.one_to_one_buffer, self.glide_buffer or 0.0)

    @property
    def is_judged(self) -> bool:
        """True if the ground risk class is decided.

        Also True if the operation is decided not to be part of SORA.

        It needs a home for the returns, and a controlled ground area or population data for the whole footprint.
        """
        is_populated = self.goal.controlled or (self.population is not None and self.population.is_complete)
        return is_populated and self.base.mission.home is not None

    @property
    def entered_zones(self) -> tuple[str, ...]:
        """Names of the scenario's zones that overlap the operational volume on the map, at any altitude."""
        names = []
        for zone in self.base.scenario.zones:
            parts = [shapely.Polygon(outline, holes) for outline, *holes in zone_parts(zone)]
            if shapely.union_all(parts).intersects(self.volume):
                names.append(zone.name)
        return tuple(names)


def find_ground_risk(base: CampaignBase, goal: GroundRiskGoal, workers: Workers, advance: Advance) -> GroundRiskResult:
    """Fly a campaign to find the volumes of a mission, and its ground risk class if it can be judged.

    Raises ScenarioError without terrain, FlightError if no flight can be flown, and PlanflyError for a population
    raster that cannot be used.
    """
    scenario, aircraft = base.scenario, base.uav.aircraft
    if scenario.terrain is None:
        message = f"{base.name}: the heights above ground need terrain: name an elevation file (--terrain)"
        raise ScenarioError(message, file=base.name, field="terrain")
    commanded = float(true_airspeed_route(base.nominal_setup()).leg_airspeeds.max())
    if goal.speed is not None and goal.speed < commanded:
        allowed = f"expected at least {commanded:.1f} m/s, the highest true airspeed that the mission commands"
        raise ArgumentError.of_argument("max_speed", goal.speed, allowed)
    path = nominal_path(base)
    if goal.population is not None:
        # A bad raster is refused before the flights.
        least_area = path.buffer(min_geography_half_width(aircraft.wing_span))
        read_population(goal.population, goal.unit, scenario.origin, least_area)
    rows = _fly_excursions(base, goal, path, workers, advance)
    # Best glide ratio in calm air: the horizontal distance divided by the lost height.
    glide_ratio = None
    if goal.glide:
        from flight.autopilots.point_mass import make_point_mass

        setup = base.nominal_setup()
        model = make_point_mass(aircraft, setup.envelope, setup.airspeed, Wind())
        if not model.glides:
            message = f"{aircraft.name}: its model has no trim with the throttle closed, so its glide is unknown"
            raise FlightError(message, file=aircraft.name)
        altitude = float(setup.route.positions[0, 2])
        airspeeds = np.linspace(aircraft.airspeed_min, aircraft.airspeed_max, 20)
        glide_ratio = max(
            1.0 / float(glide_slopes(model, float(airspeed), altitude, altitude + 1.0).table.min())
            for airspeed in airspeeds
        )
    return with_ground_class(make_volumes(base, goal, path, rows, glide_ratio))


def with_ground_class(result: GroundRiskResult) -> GroundRiskResult:
    """Return a result with the population of its footprint and its ground risk class added.

    The class stays None if the result is not judged, see `GroundRiskResult.is_judged`.

    Raises PlanflyError for a population raster that cannot be used.
    """
    goal, aircraft = result.goal, result.aircraft
    if goal.population is not None:
        origin = result.base.scenario.origin
        population = read_population(goal.population, goal.unit, origin, result.footprint)
        result = replace(result, population=population)
    if not result.is_judged:
        return result
    density = 0.0 if result.population is None else result.population.max_density
    found_class = ground_risk_class(
        density, aircraft.wing_span, result.speed, aircraft.mass, controlled=goal.controlled
    )
    return replace(result, ground_class=found_class)


def nominal_path(base: CampaignBase) -> BaseGeometry:
    """Return the two nominal paths on the map, m: the flight without variations, and the planned path.

    Raises FlightError if the flight ends where it starts.
    """
    setup = base.nominal_setup()
    track = fly_to_end(Flight(setup, base.uav.aircraft)).track
    if len(track) < 2:
        raise FlightError(f"{base.name}: the flight ends where it starts", file=base.name)
    _, positions, _ = _sample_flight(track)
    return shapely.MultiLineString([positions[:, :2], setup.route.positions[:, :2]]).simplify(0.1)


def _fly_excursions(
    base: CampaignBase, goal: GroundRiskGoal, path: BaseGeometry, workers: Workers, advance: Advance
) -> tuple[ExcursionRow, ...]:
    """Fly the flights of a campaign, and return their rows in the order of the draws.

    A flight that ended at its start, or whose worker died, is left out.

    path: planned path, and path of the flight without variations, m.
    Raises FlightError if no flight could be flown.
    """
    indices: Iterator[int] = iter(range(goal.flights))

    def next_request() -> FlightRequest | None:
        """Return the request of the next flight; None if all flights are requested."""
        index = next(indices, None)
        return None if index is None else FlightRequest(index)

    fly = partial(fly_for_excursions, path=path, interval=goal.interval, glide=goal.glide)
    rows: dict[int, ExcursionRow] = {}
    with worker_pool(workers, base, fly) as pool:
        for count, finished in enumerate(pool.fly(next_request), 1):
            advance(count, goal.flights, f"{count} of {goal.flights} flights")
            if isinstance(finished.row, ExcursionRow) and finished.row.flown:
                rows[finished.request.index] = finished.row
    if not rows:
        raise FlightError(f"{base.name}: no flight could be flown", file=base.name)
    return tuple(rows[index] for index in sorted(rows))


def make_volumes(
    base: CampaignBase,
    goal: GroundRiskGoal,
    path: BaseGeometry,
    rows: tuple[ExcursionRow, ...],
    glide_ratio: float | None,
) -> GroundRiskResult:
    """Make flight geography, contingency volume and ground risk buffer from the rows of the flights.

    Raises ScenarioError if the ground is unknown below some flights.

    path: planned path, and path of the flight without variations, m.
    glide_ratio: best glide ratio; None if glides are not requested.
    """
    aircraft = base.uav.aircraft
    if not all(math.isfinite(row.height) for row in rows):
        message = f"{base.name}: no ground is known below some flights; name an elevation file that covers them"
        raise ScenarioError(message, file=base.name, field="terrain")
    deviation, height = (
        float(np.quantile(values, goal.probability, method="median_unbiased"))
        for values in ([row.deviation for row in rows], [row.height for row in rows])
    )
    half_width = max(deviation, min_geography_half_width(aircraft.wing_span))
    geography = path.buffer(half_width)
    flown_area = shapely.union_all([geography, *shapely.from_wkb([row.flown for row in rows])])
    fallen_area = shapely.union_all(shapely.from_wkb([row.fallen for row in rows]))
    flown_volumes = FlownVolumes(
        deviation=deviation,
        height=height,
        contingency_width=max(0.0, max(row.turn_deviation for row in rows) - half_width),
        return_distance=_distance_beyond(flown_area, geography),
        contingency_height=max(row.return_height for row in rows),
        buffer_width=_distance_beyond(fallen_area, flown_area),
    )
    speed = goal.speed or aircraft.airspeed_max
    formula = ContingencyFormula(speed, height)
    result = GroundRiskResult(
        goal, base, rows, flown_volumes, formula, glide_ratio, speed, geography, volume=geography, footprint=geography
    )
    volume = shapely.union_all([flown_area, geography.buffer(result.contingency_width)])
    footprint = shapely.union_all([volume.buffer(result.buffer_width), fallen_area])
    return replace(result, volume=_without_filled_holes(volume, footprint), footprint=footprint)


def _without_filled_holes(area: BaseGeometry, footprint: BaseGeometry) -> BaseGeometry:
    """Return an area without the holes that a footprint fills, such as gaps between returns.

    >>> ring = shapely.Point(0.0, 0.0).buffer(10.0) - shapely.Point(0.0, 0.0).buffer(2.0)
    >>> len(_without_filled_holes(ring, shapely.box(-20.0, -20.0, 20.0, 20.0)).interiors)
    0
    """
    holes = [shapely.Polygon(ring) for part in shapely.get_parts(area) for ring in part.interiors]
    return shapely.union_all([area, *(hole for hole in holes if footprint.covers(hole))])


def _distance_beyond(outer: BaseGeometry, inner: BaseGeometry) -> float:
    """Return the largest distance from the outline of an outer area to an inner area, m.

    Return 0 for an empty outer area.
    """
    return float(shapely.distance(shapely.points(shapely.get_coordinates(outer)), inner).max(initial=0.0))
