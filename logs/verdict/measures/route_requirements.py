"""Compute the demands of a route on the aircraft, the limits that apply, and the energy it needs."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY, ground_speed
from aircraft.path_limits import (
    BLEND_ACCELERATION,
    Limits,
    PerformanceTable,
    aircraft_slopes,
    arc_slope,
    downwind_vector,
    fly_over_run,
    ground_speed_on,
    roll_reversal_length,
    turn_radius_between,
)
from flight.guidance.path import path_polyline
from flight.mission.fences import fence_zones
from flight.mission.ground_phases import GroundPhases
from flight.mission.route import Route
from flight.mission.surveys import Survey, camera_spacing, find_surveys
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.places import Place
from logs.verdict.tolerances import MAX_FLY_BY_OFFSET_RADII, POSSIBLE_BANK_RAD, SPEED_TOLERANCE_MPS, U_TURN_RAD
from world.airspace.inclusions import unite_inclusions
from world.airspace.zone_kernels import ZoneRecords, zone_records
from world.airspace.zones import Zone
from world.arrays import Floats
from world.errors import MissionError, StartError
from world.geometry import fly_by_offset, leg_courses, leg_runs, leg_slopes, signed_turns, tangent_length
from world.wind import Wind

# ----------------------------------------------------------------------
# The zones by which a flight is judged: the scenario's zones, then the zones of the mission's own fence.


# Margin around the bounding boxes of straight pieces, m; an arc deviates from its chord by far less.
_BOX_MARGIN_M = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class Airspace:
    """Zones in the order in which findings number them.

    zones: the scenario's, then the fence's.
    records: the same zones, for compiled code.
    scenario_zone_count: number of zones from the scenario.
    fence_fault: reason why the mission's fence gives no zones; "" if it does, or if there is no fence.
    """

    zones: tuple[Zone, ...]
    records: ZoneRecords
    fence_fault: str = ""
    scenario_zone_count: int = 0

    def place(self, index: int) -> Place:
        """Return the place of a finding on a zone."""
        zone = self.zones[index]
        return Place(zone.kind, index, name=zone.name)

    def zones_near(self, points: Floats) -> NDArray[np.int64]:
        """Return the numbers of all inclusion zones, and of the exclusion zones near a path (n, 3), m.

        >>> from world.airspace.zones import Cylinder
        >>> zones = tuple(Zone(str(k), "exclusion", Cylinder(1000.0 * k, 0.0, 50.0)) for k in range(4))
        >>> way = np.array([[1900.0, 900.0, 80.0], [2100.0, -900.0, 80.0]])
        >>> Airspace(zones, zone_records(zones)).zones_near(way).tolist()
        [2]
        """
        boxes = self.records.zones
        min_corner = np.minimum(points[:-1], points[1:]) - _BOX_MARGIN_M
        max_corner = np.maximum(points[:-1], points[1:]) + _BOX_MARGIN_M
        east = (boxes["west"][:, None] <= max_corner[:, 0]) & (boxes["east"][:, None] >= min_corner[:, 0])
        north = (boxes["south"][:, None] <= max_corner[:, 1]) & (boxes["north"][:, None] >= min_corner[:, 1])
        return np.flatnonzero(~boxes["exclusion"] | (east & north).any(axis=1))


def judged_airspace(setup: FlightSetup) -> Airspace:
    """Return the exclusion and inclusion zones that apply to a setup's flight.

    A fence that cannot be converted to zones is omitted; `fence_fault` then states the reason.

    >>> from logs.recording.example_log import example_log
    >>> judged_airspace(example_log().setup).zones
    ()
    """
    fence_fault, mission_zones = "", tuple[Zone, ...]()
    try:
        stated_zones = fence_zones(setup.mission.fences, setup.scenario.origin, "the mission")
        unites = setup.autopilot.checks.any_inclusion_suffices
        mission_zones = unite_inclusions(stated_zones) if unites else stated_zones
    # ValueError: a union of zones may have more corners than a zone may have.
    except (MissionError, ValueError) as error:
        fence_fault = str(error)
    zones = (*setup.scenario.zones, *mission_zones) if mission_zones else setup.scenario.zones
    records = next((records for cached_zones, records in _last_records if cached_zones is zones), None)
    if records is None:
        records = zone_records(zones)
        _last_records[:] = [(zones, records)]
    return Airspace(zones, records, fence_fault, len(setup.scenario.zones))


# Zones converted last and their records: converting a thousand zones takes longer than judging them.
_last_records: list[tuple[tuple[Zone, ...], ZoneRecords]] = []


def with_fence_zones(setup: FlightSetup) -> FlightSetup:
    """Return the setup with the mission's fence zones added to the scenario's zones, for drawing.

    >>> from logs.recording.example_log import example_log
    >>> with_fence_zones(example_log().setup).scenario.zones
    ()
    """
    if not setup.mission.fences:
        return setup
    return setup.in_scenario(replace(setup.scenario, zones=judged_airspace(setup).zones))


# ----------------------------------------------------------------------
# The length that a route's turns use of their legs, and the sharpest turn that fits next to its neighbours.


@dataclass(frozen=True, slots=True)
class TurnRequirements:
    """Turns of a route with w waypoints.

    turns: (w,) rad, positive to the right, 0 at the ends.
    min_radius: (w,) m, radius of the arc at the bank limit.
    radius: (w,) m, radius of the arc that is flown: `min_radius`, or the radius of a loiter.
    length_before, length_after: (w,) m of leg that the turn uses on either side, inf for a U-turn.
    reversal: (w - 1,) m of leg on which the aircraft rolls from a turn to one side into a turn to the other side; 0 on
        all other legs.
    limit: (w,) rad, the sharpest turn at each waypoint that fits both legs next to the neighbouring turns.
    """

    turns: Floats
    min_radius: Floats
    radius: Floats
    length_before: Floats
    length_after: Floats
    reversal: Floats
    limit: Floats


# Function that returns the aircraft's performance on a leg at an airspeed, m/s.
LegPerformance = Callable[[int, float], PerformanceTable]


def leg_performance(limits: Limits, winds: Sequence[Wind] = ()) -> LegPerformance:
    """Return a function that computes the aircraft's performance on a leg at an airspeed, m/s.

    winds: wind of each leg; () for the wind of the limits on all legs.
    """
    leg_limits = [replace(limits, wind=wind) for wind in winds]
    return lambda leg, speed: (leg_limits[leg] if leg_limits else limits).performance(speed)


def find_leg_winds(setup: FlightSetup, route: Route) -> tuple[Wind, ...]:
    """Return the forecast wind of each leg; () without a forecast.

    It is the wind at the leg's midpoint, at the estimated time there.

    The time is estimated from the legs before, flown at the ground speed in their wind, and the first half of the leg,
    flown at its airspeed.  If the wind leaves at most 1 m/s of ground speed on a leg, the airspeed replaces the ground
    speed.
    """
    if setup.scenario.wind.field is None:
        return ()
    points, courses, winds, time = route.positions, leg_courses(route.positions), [], 0.0
    for leg, length in enumerate(np.linalg.norm(np.diff(points, axis=0), axis=1).tolist()):
        middle = 0.5 * (points[leg] + points[leg + 1])
        airspeed = float(route.leg_airspeeds[leg])
        wind = setup.scenario.local_wind(middle.tolist(), time + 0.5 * length / airspeed)
        components = wind.components_on_course(float(courses[leg]), float(middle[2]))
        speed = ground_speed(airspeed, *components)
        time += length / (speed if speed > 1.0 else airspeed)
        winds.append(wind)
    return tuple(winds)


def turn_requirements(route: Route, performance: LegPerformance) -> TurnRequirements:
    """Compute each turn's radius, the lengths of leg that it uses, and the sharpest turn that fits there.

    performance: function that returns the aircraft's performance on a leg at an airspeed.
    """
    points = route.positions
    courses, runs, count = leg_courses(points), leg_runs(points), len(points)
    turns = np.zeros(count)
    if count > 2:
        turns[1:-1] = signed_turns(points)
    min_radius, radius, length_before, length_after = (np.zeros(count) for _ in range(4))
    for waypoint in range(1, count - 1):
        speed = float(max(route.leg_airspeeds[waypoint - 1], route.leg_airspeeds[waypoint]))
        min_radius[waypoint] = turn_radius_between(
            performance(waypoint, speed), courses[waypoint - 1], courses[waypoint], points[waypoint, 2]
        )
        radius[waypoint] = route.arc_radii[waypoint] or min_radius[waypoint]
        length_before[waypoint], length_after[waypoint] = turn_lengths(
            abs(float(turns[waypoint])), float(radius[waypoint]), bool(route.fly_over[waypoint])
        )
    # Length that the roll between turns to opposite sides uses on each leg, m.
    up = points[:, 2]
    reversal = np.zeros(len(courses))
    for leg in range(1, len(courses) - 1):
        are_fly_bys = not route.fly_over[leg : leg + 2].any() and np.isfinite(radius[leg : leg + 2]).all()
        if turns[leg] * turns[leg + 1] < 0.0 and are_fly_bys:
            table = performance(leg, float(route.leg_airspeeds[leg]))
            course_east, course_north = math.sin(courses[leg]), math.cos(courses[leg])
            min_altitude = float(min(up[leg], up[leg + 1]))
            reversal[leg] = roll_reversal_length(
                table, course_east, course_north, min_altitude, radius[leg], radius[leg + 1], *downwind_vector(table)
            )
    # The sharpest turn that fits between the neighbouring turns: 0 if the radius is infinite, pi at the route's ends.
    limit = np.full(count, math.pi)
    for waypoint in range(1, count - 1):
        before, after = available_lengths(runs, length_before, length_after, reversal, waypoint)
        if not math.isfinite(min_radius[waypoint]):
            limit[waypoint] = 0.0
        elif route.fly_over[waypoint]:
            limit[waypoint] = sharpest_fly_over_turn(after / min_radius[waypoint])
        else:
            limit[waypoint] = 2.0 * math.atan(min(before, after) / min_radius[waypoint])
    return TurnRequirements(turns, min_radius, radius, length_before, length_after, reversal, limit)


def turn_lengths(turn: float, radius: float, fly_over: bool) -> tuple[float, float]:
    """Return the lengths, m, that a turn (rad) uses of the legs before and after its waypoint.

    A fly-over uses only the leg after its waypoint.  Both lengths are 0 without a turn, and infinite for a fly-by with
    a turn larger than `U_TURN_RAD`.

    radius: turn radius, m.
    fly_over: True if the turn begins only at its waypoint.
    """
    if turn < 1e-9:
        return 0.0, 0.0
    if fly_over:
        return 0.0, radius * fly_over_run(turn)
    if turn > U_TURN_RAD:
        return math.inf, math.inf
    tangent = tangent_length(turn, radius)
    return tangent, tangent


def available_lengths(
    runs: Floats, length_before: Floats, length_after: Floats, reversal: Floats, waypoint: int
) -> tuple[float, float]:
    """Return the lengths, m, that the turn at a waypoint may use of the legs before and after it.

    Each turn may use at least half of a leg, less the length for the roll between opposite turns.  If a leg is too
    short for both of its turns, a turn that needs more than half of the leg is therefore the one that does not fit.

    runs, reversal: length of each leg, and the length that the roll between opposite turns uses, m, (w - 1,).
    length_before, length_after: lengths that the turn at each waypoint uses, m, (w,).
    """
    return (
        max(runs[waypoint - 1] - length_after[waypoint - 1], 0.5 * runs[waypoint - 1]) - reversal[waypoint - 1],
        max(runs[waypoint] - length_before[waypoint + 1], 0.5 * runs[waypoint]) - reversal[waypoint],
    )


def sharpest_fly_over_turn(radii: float) -> float:
    """Return the sharpest fly-over turn that fits the leg after its waypoint, rad, at most pi.

    This is the inverse of `fly_over_run`.  With half the turn h and z = (cos h + sqrt(1 + cos^2 h))^2, the square of
    the length is 6 z - z^2 - 1.

    radii: length of the leg in turn radii.

    >>> round(math.degrees(sharpest_fly_over_turn(fly_over_run(math.radians(70.0)))), 6)
    70.0
    """
    if radii <= 0.0:
        return 0.0
    if radii >= math.sqrt(8.0):
        return math.pi
    z = 3.0 + math.sqrt(8.0 - radii * radii)
    return 2.0 * math.acos(min(1.0, (z - 1.0) / (2.0 * math.sqrt(z))))


@dataclass(frozen=True, slots=True, eq=False)
class PlannedPath:
    """Fly-by path as a polyline of n points.

    points: m, (n, 3).
    legs: leg of each segment, (n - 1,).
    times: planned time at each point, s, (n,).
    """

    points: Floats
    legs: NDArray[np.int64]
    times: Floats


@dataclass(frozen=True, slots=True)
class FlownGround:
    """Ground phases of a flight: its take-off and its landing.

    procedures: the planned ground phases.
    whole_route: requirements of the whole route, with take-off and landing.
    track: track of the whole flight.
    takeoff_end_row: row of the track at which the take-off ended; 0 without a take-off.
    landing_start_row: row of the track at which the landing began; the last row without a landing.
    """

    procedures: GroundPhases
    whole_route: "RouteRequirements"
    track: Track
    takeoff_end_row: int
    landing_start_row: int

    @property
    def takeoff_track(self) -> Track:
        """Track of the take-off."""
        return self.track.rows(0, self.takeoff_end_row + 1)

    @property
    def landing_track(self) -> Track:
        """Track of the landing."""
        return self.track.rows(self.landing_start_row, len(self.track))


@dataclass(frozen=True, slots=True, eq=False)
class RouteRequirements:
    """Numbers of a route for its verdict, computed once.

    They describe its turns, its legs, the limits, and the planned path.

    route: the setup's route, with true airspeeds if the autopilot treats commanded airspeeds as equivalent airspeeds.

    For w waypoints:

    points: (w, 3) m.
    runs: (w - 1,) horizontal lengths of the legs, m.
    courses, slopes: (w - 1,) rad.
    turns, min_radius, radius, length_before, length_after, reversal: as in `TurnRequirements`.
    blend: (w,) m of leg beyond each turn on which the slope still changes.
    fly_by_offset: (w,) m by which the fly-by passes the waypoint.
    turn_limit: (w,) rad, as `TurnRequirements.limit`; inf if the envelope is omitted.
    climb, dive: (w - 1,) steepest climb and descent over the ground that the aircraft can fly everywhere on the leg,
        rad; inf if the envelope is omitted.
    certain_climb, certain_dive: (w - 1,) the same, lowered by the uncertainty of the aircraft's model.
    ground_speed: (w - 1,) m/s, NaN if the wind leaves no ground speed.
    possible_bank: largest bank limit that the aircraft may have, rad; the setup's bank limit unless it is a guess.
    possible_turn_limit, possible_min_radius: (w,) as `turn_limit` and `min_radius`, with this bank limit.
    envelope: True if the aircraft's limits apply; otherwise only the ability shown by the flight applies.
    airspace: the zones of scenario and mission.
    surveys: surveys of a user's mission, if the scenario judges surveys by their lines.
    zone_check_legs: for a quick answer, the first and last leg on which zones are checked; None to check all legs and
        all zones.
    winds: (w - 1,) wind of each leg in a forecast; () for the scenario's wind on all legs.
    ground_phases: take-off and landing of the flight, to whose airborne part the other fields belong; None without.
    shortcuts: results of `logs.verdict.measures.acceptance.shortcut_distance` so far, by the first and last waypoint
        that the shortcut omits; neighbouring waypoints have most shortcuts in common.
    """

    setup: FlightSetup
    route: Route
    points: Floats
    runs: Floats
    courses: Floats
    slopes: Floats
    turns: Floats
    min_radius: Floats
    radius: Floats
    length_before: Floats
    length_after: Floats
    reversal: Floats
    blend: Floats
    fly_by_offset: Floats
    turn_limit: Floats
    climb: Floats
    dive: Floats
    certain_climb: Floats
    certain_dive: Floats
    possible_bank: float
    possible_turn_limit: Floats
    possible_min_radius: Floats
    ground_speed: Floats
    path: PlannedPath
    envelope: bool
    airspace: Airspace
    surveys: tuple[Survey, ...]
    ground_phases: FlownGround | None = None
    zone_check_legs: tuple[int, int] | None = None
    winds: tuple[Wind, ...] = ()
    shortcuts: dict[tuple[int, int], float | None] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def limits(self) -> Limits:
        """Limits of scenario and aircraft."""
        return self.setup.limits

    @property
    def legs(self) -> int:
        """Number of legs."""
        return len(self.runs)

    @property
    def limits_source(self) -> str:
        """Source of the scenario's limits: planfly's defaults if the mission came without a scenario."""
        return "default" if self.setup.scenario.external else "scenario"

    def wind_on(self, leg: int) -> Wind:
        """Return the mean wind on a leg."""
        return self.winds[leg] if self.winds else self.setup.scenario.wind

    def waypoint_place(self, index: int) -> Place:
        """Return the place of a finding on a waypoint."""
        return Place("waypoint", index, self._item_number(index), number=int(self.setup.route.stops[index]))

    def leg_place(self, index: int) -> Place:
        """Return the place of a finding on a leg, with the item to which the leg leads."""
        # This is `Route.leg_numbers[index]`, but that property is too slow to read for each leg of a long mission.
        number = max(int(self.setup.route.stops[index + 1]) - 1, 0)
        return Place("leg", index, to_item=self._item_number(index + 1), number=number)

    def _item_number(self, waypoint: int) -> int | None:
        """Return the mission item of a waypoint, or None if the waypoint has no item."""
        item = int(self.setup.route.items[waypoint])
        return None if item < 0 else item

    def turnaround_waypoints(self) -> set[int]:
        """Return the waypoints of the turnarounds of all surveys, including ends, entries and exits.

        The autopilot decides the path of a turnaround.
        """
        return {
            waypoint
            for survey in self.surveys
            for first, last in survey.transitions()
            for waypoint in range(first, last + 1)
        }

    def turnaround_legs(self) -> set[int]:
        """Return the legs of the turnarounds of all surveys, including entries and exits."""
        return {leg for survey in self.surveys for first, last in survey.transitions() for leg in range(first, last)}

    def leg_unit(self, leg: int) -> Floats:
        """Return the unit vector (east, north) of a leg's course, (2,)."""
        return np.array([math.sin(self.courses[leg]), math.cos(self.courses[leg])])

    def straight_start(self, leg: int) -> Floats:
        """Return the point where a leg leaves a loiter's circle, or else its first waypoint, (3,) m.

        The waypoints of a loiter are corners outside its circle; the leg leaves the circle at a tangent point.
        """
        start = self.points[leg].copy()
        start[:2] += (float(self.runs[leg]) - self.straight_length(leg)) * self.leg_unit(leg)
        return start

    def straight_length(self, leg: int) -> float:
        """Return the horizontal length of a leg from `straight_start`, m."""
        run = float(self.runs[leg])
        return max(0.0, run - float(self.length_after[leg])) if self.setup.route.arc_radii[leg] > 0.0 else run

    def apexes(self) -> Floats:
        """Return the midpoints of the fly-by arcs, where the path passes each waypoint, (w, 3) m."""
        apexes = self.points.copy()
        for waypoint in range(1, len(apexes) - 1):
            if self.fly_by_offset[waypoint] > 0.0:
                inward = self.leg_unit(waypoint) - self.leg_unit(waypoint - 1)
                apexes[waypoint, :2] += self.fly_by_offset[waypoint] * inward / math.hypot(*inward)
                # The altitude is halfway between the altitudes at the ends of the arc.
                tangent = min(self.length_before[waypoint], self.runs[waypoint - 1], self.runs[waypoint])
                apexes[waypoint, 2] += (
                    0.5 * tangent * (math.tan(self.slopes[waypoint]) - math.tan(self.slopes[waypoint - 1]))
                )
        return apexes


def route_requirements(setup: FlightSetup, *, envelope: bool = True) -> RouteRequirements:
    """Compute the requirements of a setup's route, and the aircraft's limits on each turn and leg.

    envelope: False to judge by the flight alone; the aircraft's limits on turns and slopes are then inf.
    """
    route, limits = true_airspeed_route(setup), setup.limits
    points = route.positions
    winds = find_leg_winds(setup, route)
    performance = leg_performance(limits, winds)
    turns = turn_requirements(route, performance)
    courses, runs = leg_courses(points), leg_runs(points)
    climb, dive, speeds = _leg_limits(route, performance, points, courses)
    certain_limits = limits.with_margin()
    certain_climb, certain_dive = climb, dive
    if certain_limits.envelope is not limits.envelope:
        certain_climb, certain_dive, _ = _leg_limits(route, leg_performance(certain_limits, winds), points, courses)
    # The largest bank limit that may apply, rad: more than the setup's only if that is a guess.
    setup_envelope, stated_bank = setup.envelope, setup.scenario.flight.max_bank_deg
    if not setup_envelope.bank_guessed or setup.max_bank < setup_envelope.max_bank:
        possible_bank = setup.max_bank
    else:
        other_limit = math.inf if stated_bank is None else math.radians(stated_bank)
        possible_bank = min(POSSIBLE_BANK_RAD, setup.autopilot.turns.max_bank, other_limit)
    possible_turns = turns
    if possible_bank > limits.max_bank:
        possible_limits = replace(limits, max_bank=possible_bank)
        possible_turns = turn_requirements(route, leg_performance(possible_limits, winds))
    # Distance at which the fly-by path passes each waypoint.
    fly_by_offsets = np.zeros(len(points))
    for waypoint in np.flatnonzero(np.isfinite(turns.radius) & ~route.fly_over).tolist():
        radius = float(turns.radius[waypoint])
        offset = fly_by_offset(abs(float(turns.turns[waypoint])), radius)
        fly_by_offsets[waypoint] = min(offset, MAX_FLY_BY_OFFSET_RADII * radius)
    # The fly-by path with the time at each point.  The airspeed replaces a ground speed that is not finite.
    path_points, path_legs = path_polyline(setup.path)
    path_speeds = np.where(np.isfinite(speeds), speeds, route.leg_airspeeds)[path_legs]
    path_times = np.cumsum(np.hypot(*np.diff(path_points[:, :2], axis=0).T) / path_speeds)
    if not envelope:
        climb, dive = np.full_like(climb, math.inf), np.full_like(dive, math.inf)
    return RouteRequirements(
        setup=setup,
        route=route,
        points=points,
        runs=runs,
        courses=courses,
        slopes=leg_slopes(points),
        turns=turns.turns,
        min_radius=turns.min_radius,
        radius=turns.radius,
        length_before=turns.length_before,
        length_after=turns.length_after,
        reversal=turns.reversal,
        blend=_blend_lengths(setup, route, points, runs, turns),
        fly_by_offset=fly_by_offsets,
        turn_limit=turns.limit if envelope else np.full(len(points), math.inf),
        climb=climb,
        dive=dive,
        certain_climb=certain_climb,
        certain_dive=certain_dive,
        winds=winds,
        possible_bank=possible_bank,
        possible_turn_limit=possible_turns.limit if envelope else np.full(len(points), math.inf),
        possible_min_radius=possible_turns.min_radius,
        ground_speed=speeds,
        path=PlannedPath(path_points, path_legs, np.concatenate([[0.0], path_times])),
        envelope=envelope,
        airspace=judged_airspace(setup),
        surveys=judged_surveys(setup),
    )


# Cache of the setups whose surveys were searched last, with these surveys: several parts of one verdict need them.
_last_surveys: list[tuple[FlightSetup, tuple[Survey, ...]]] = []
# Number of setups whose surveys are kept.
_MAX_KEPT_SURVEYS = 4


def judged_surveys(setup: FlightSetup) -> tuple[Survey, ...]:
    """Return the surveys of a setup's mission whose photo lines are judged, cached for the last setups.

    A plan made by planfly has no surveys, nor has a mission whose scenario states `surveys = "path"`.  In other
    missions, these are the surveys that switch the camera.  If the scenario states `surveys = "lines"`, all legs that
    form a survey pattern are included.
    """
    for cached_setup, cached_surveys in tuple(_last_surveys):
        if cached_setup is setup:
            return cached_surveys
    mode = setup.scenario.limits.surveys
    surveys: tuple[Survey, ...] = ()
    if setup.plan is None and mode != "path":
        camera = camera_spacing(setup.mission, setup.route)
        # If no item switches the camera, no line takes photos.
        if mode == "lines" or camera.any():
            photo_plans = [
                (survey.photo, survey.turn_around) for survey in setup.mission.survey_plans if survey.photo is not None
            ]
            found_surveys = find_surveys(setup.route, camera, photo_plans)
            surveys = tuple(survey for survey in found_surveys if mode == "lines" or survey.takes_photos())
    _last_surveys[:] = [(setup, surveys), *_last_surveys[: _MAX_KEPT_SURVEYS - 1]]
    return surveys


def true_airspeed_route(setup: FlightSetup) -> Route:
    """Return a setup's demanded route with true airspeeds.

    ArduPlane's commands are equivalent airspeeds, which are converted to true airspeeds at each leg's mean altitude.

    >>> from flight.autopilots.arduplane.autopilot import ArduPlane
    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> from logs.recording.example_log import example_log
    >>> setup = example_log().setup
    >>> true_airspeed_route(setup) is setup.route
    True
    >>> faster = true_airspeed_route(replace(setup, autopilot=ArduPlane(ArduPilotParameters.defaults())))
    >>> bool((faster.leg_airspeeds > setup.route.leg_airspeeds).all())
    True
    """
    route = setup.demanded_route
    speeds = setup.autopilot.speeds
    if not speeds.equivalent:
        return route
    mean_altitudes = 0.5 * (route.positions[1:, 2] + route.positions[:-1, 2])
    factors = [speeds.true_airspeed_factor(altitude) for altitude in mean_altitudes]
    return route.with_fields(airspeed=route.leg_airspeeds * factors)


def _leg_limits(
    route: Route, performance: LegPerformance, points: Floats, courses: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return each leg's climb and dive limits over the ground (rad) and ground speed (m/s), (legs,) each.

    Each value is the minimum of the values at the start, the middle and the end of the leg.  The ground speed is NaN if
    one of the three is unknown.
    """
    legs = len(courses)
    climb, dive, speeds = np.zeros(legs), np.zeros(legs), np.zeros(legs)
    for leg in range(legs):
        table = performance(leg, float(route.leg_airspeeds[leg]))
        course = float(courses[leg])
        altitudes = (points[leg, 2], 0.5 * (points[leg, 2] + points[leg + 1, 2]), points[leg + 1, 2])
        speeds[leg] = min(ground_speed_on(table, course, altitude) for altitude in altitudes)
        if any(math.isnan(ground_speed_on(table, course, altitude)) for altitude in altitudes):
            speeds[leg] = math.nan
        climb[leg], dive[leg] = np.min([aircraft_slopes(table, course, altitude) for altitude in altitudes], axis=0)
    return climb, dive, speeds


def _blend_lengths(setup: FlightSetup, route: Route, points: Floats, runs: Floats, turns: TurnRequirements) -> Floats:
    """Return the length beyond each turn, on either side, over which the slope still changes, m, (w,).

    The altitude follows a parabola about each end of the arc, or about the waypoint if there is no arc.
    """
    slopes = np.diff(points[:, 2]) / np.maximum(runs, 1.0)
    blend = np.zeros(len(points))
    speed = float(route.leg_airspeeds.max()) + setup.scenario.wind.max_speed_at(points[:, 2])
    for waypoint in range(1, len(points) - 1):
        slope_changes = [abs(slopes[waypoint] - slopes[waypoint - 1])]
        turn = abs(float(turns.turns[waypoint]))
        arc = float(turns.radius[waypoint]) * turn if turn > 0.0 else 0.0
        if 0.0 < arc < math.inf and math.isfinite(turns.length_after[waypoint]) and not setup.route.fly_over[waypoint]:
            # The arc is shorter than its two tangents, so that its slope is steeper than the slopes of the legs.
            arc_slope_ = (slopes[waypoint - 1] + slopes[waypoint]) * turns.length_after[waypoint] / arc
            slope_changes = [abs(arc_slope_ - slopes[waypoint - 1]), abs(arc_slope_ - slopes[waypoint])]
        blend[waypoint] = max(slope_changes) * speed**2 / (2.0 * BLEND_ACCELERATION)
    return blend


# ----------------------------------------------------------------------
# Limit at each turn, leg and fly-by arc: the lower of the scenario's limit and the aircraft's limit.


@dataclass(frozen=True, slots=True)
class SteepArc:
    """Fly-by arc that is steeper than the aircraft can climb or sink.

    tangent: tangent of the arc's slope.
    limit: tangent of the aircraft's limit, positive; mean of the limits on both legs.
    missing_height: height by which a climb or descent at the limit misses the arc's end, m.
    """

    tangent: float
    limit: float
    missing_height: float


def turn_limit(requirements: RouteRequirements, waypoint: int) -> tuple[float, str]:
    """Return the turn limit at a waypoint, rad, and its source.

    The source is the scenario or the aircraft, whichever limits it more.
    """
    return tighter_turn_limit(requirements, waypoint, float(requirements.turn_limit[waypoint]))


def tighter_turn_limit(requirements: RouteRequirements, waypoint: int, aircraft_limit: float) -> tuple[float, str]:
    """Return the lower of the scenario's turn limit and `aircraft_limit`, rad, and its source.

    The source is "scenario", "aircraft" or "none".  The scenario's limit does not apply to the corners of a loiter.
    """
    scenario_limit = requirements.limits.max_turn
    # The corners of a loiter are planfly's drawing, not turns of the mission.
    if (
        scenario_limit is not None
        and scenario_limit <= aircraft_limit
        and requirements.setup.route.arc_radii[waypoint] == 0.0
    ):
        return scenario_limit, "scenario"
    return aircraft_limit, "aircraft" if math.isfinite(aircraft_limit) else "none"


def slope_limits(requirements: RouteRequirements, leg: int) -> tuple[float, float]:
    """Return the lower of the scenario's and the aircraft's limits on climb and dive along a leg, rad."""
    return (
        slope_limit(requirements, leg, is_climb=True)[0],
        slope_limit(requirements, leg, is_climb=False)[0],
    )


def slope_limit(requirements: RouteRequirements, leg: int, *, is_climb: bool | None = None) -> tuple[float, str]:
    """Return the limit on a climb or a dive along a leg, rad, positive, and its source.

    It is the scenario's or the aircraft's limit, whichever is lower.  The source is "scenario", "aircraft" or "none".

    is_climb: True for a climb, False for a dive, None for the direction of the leg itself.
    """
    is_climb = bool(requirements.slopes[leg] >= 0.0) if is_climb is None else is_climb
    scenario_limit = requirements.limits.max_climb if is_climb else requirements.limits.max_dive
    aircraft_limit = float((requirements.climb if is_climb else requirements.dive)[leg])
    if scenario_limit is not None and scenario_limit <= aircraft_limit:
        return scenario_limit, "scenario"
    return aircraft_limit, "aircraft" if math.isfinite(aircraft_limit) else "none"


class GroundSlopeLimit(NamedTuple):
    """Limit on the slope between the ground and a waypoint.

    limit: rad, positive.
    certain: the limit lowered by the uncertainty of the aircraft's model, rad.
    source: "scenario" or "aircraft".
    airspeed: true airspeed to which the limit applies, m/s.
    """

    limit: float
    certain: float
    source: str
    airspeed: float


def ground_slope_limit(
    requirements: RouteRequirements, leg: int, altitudes: tuple[float, float], *, is_climb: bool, is_landing: bool
) -> GroundSlopeLimit:
    """Return the slope limit of a climb from the ground, or of a descent to it, on a leg's course.

    The limit is the lower of the limits at both ends of the leg.  A take-off uses the leg's airspeed.  A landing uses
    the autopilot's airspeed on the glide, but at least the minimum airspeed of level flight.  ArduPlane flies this
    airspeed as soon as it is lined up on the leg (AP_Landing_Slope.cpp, `type_slope_verify_land` and
    `type_slope_get_target_airspeed_cm`).

    altitudes: altitudes of both ends, m AMSL.
    """
    limits, course = requirements.limits, float(requirements.courses[leg])
    airspeed, side = float(requirements.route.leg_airspeeds[leg]), 0 if is_climb else 1
    if is_landing:
        ground = min(altitudes)
        tail_wind = limits.wind.components_on_course(course, ground)[0]
        glide_airspeed = requirements.setup.autopilot.ground.airspeed(airspeed, tail_wind, ground)
        airspeed = max(glide_airspeed, min(airspeed, limits.envelope.level_speeds(ground)[0]))
    able, certain = (
        min(limit_set.slopes(course, altitude, airspeed)[side] for altitude in altitudes)
        for limit_set in (limits, limits.with_margin())
    )
    scenario_limit = (limits.max_climb, limits.max_dive)[side]
    if scenario_limit is not None and scenario_limit < able:
        return GroundSlopeLimit(scenario_limit, min(certain, scenario_limit), "scenario", airspeed)
    return GroundSlopeLimit(able, certain, "aircraft", airspeed)


def steep_arc(requirements: RouteRequirements, leg: int) -> SteepArc | None:
    """Return the fly-by arc at a leg's end if it is steeper than the aircraft can fly, otherwise None.

    A climb or descent at the aircraft's limit misses the arc's end by a height dh, which changes the airspeed V by
    g dh / V.  The arc is too steep if this change exceeds `SPEED_TOLERANCE_MPS`.
    """
    corner = leg + 1
    if (
        corner == requirements.legs
        or requirements.setup.route.fly_over[corner]
        or requirements.setup.route.arc_radii[corner] > 0.0
    ):
        return None
    turn_length = float(requirements.length_before[corner])
    length = float(requirements.radius[corner]) * abs(float(requirements.turns[corner]))
    if not 0.0 < turn_length < min(requirements.runs[leg : leg + 2]):
        return None
    slope_before = math.tan(requirements.slopes[leg])
    slope_after = math.tan(requirements.slopes[corner])
    tangent = arc_slope(slope_before, slope_after, turn_length, float(requirements.radius[corner]))
    limits = (requirements.climb if tangent > 0.0 else requirements.dive)[leg : leg + 2]
    if not np.isfinite(limits).all() or not (limits > 0.0).all():
        return None
    limit = float(np.tan(limits).mean())
    speed = float(requirements.route.leg_airspeeds[leg])
    missing_height = (abs(tangent) - limit) * length
    return SteepArc(tangent, limit, missing_height) if GRAVITY * missing_height / speed > SPEED_TOLERANCE_MPS else None


# ----------------------------------------------------------------------
# Predicted energy of steady flight along the route, from the aircraft's envelope.

# A mission is not flown if its predicted energy exceeds this multiple of the energy carried, because the flight would
# show nothing new.
MAX_ENERGY_RATIO = 2.0


def predicted_energy(requirements: RouteRequirements) -> tuple[float, float]:
    """Predict the energy, Wh, and the peak current, A, of steady flight along a route.

    Both are NaN without power data, or if a leg cannot be held in the wind; the current also without a voltage.

    Each leg is flown at its commanded airspeed, its slope over the ground in the mean wind, and its mean altitude.  The
    prediction leaves out turns and gusts, which take a few per cent more.
    """
    volts = requirements.setup.envelope.volts
    energies, peak_power = leg_energies(requirements)
    return float(sum(energies)), peak_power / volts if volts else math.nan


def leg_energies(requirements: RouteRequirements) -> tuple[list[float], float]:
    """Predict the energy of steady flight on each leg, Wh, and the peak power, W.

    All are NaN without power data, or if the course of a leg cannot be held in the wind.
    """
    envelope, route = requirements.setup.envelope, requirements.route
    if not np.isfinite(requirements.ground_speed).all():
        return [math.nan] * requirements.legs, math.nan
    energies, peak_power = [], 0.0
    # The laps of a loiter have equal legs, so each power is computed only once.
    power_at = cache(envelope.power)
    leg_durations = np.bincount(
        requirements.path.legs, weights=np.diff(requirements.path.times), minlength=requirements.legs
    )
    for leg, duration in enumerate(leg_durations):
        speed = float(route.leg_airspeeds[leg])
        altitude = float(0.5 * (requirements.points[leg, 2] + requirements.points[leg + 1, 2]))
        power = power_at(speed, altitude, air_climb_angle(requirements, leg, speed, altitude))
        energies.append(power * float(duration) / 3600.0)
        peak_power = max(peak_power, power) if math.isfinite(power) else math.nan
    return energies, peak_power


def air_climb_angle(requirements: RouteRequirements, leg: int, speed: float, altitude: float) -> float:
    """Return the climb angle relative to the air on a leg in the mean wind, rad; negative in a descent.

    The angle is found by iteration, because the ground speed depends on it.

    speed: true airspeed, m/s.
    altitude: altitude at which the wind is taken, m AMSL.
    """
    tailwind, crosswind = requirements.wind_on(leg).components_on_course(float(requirements.courses[leg]), altitude)
    slope, angle = math.tan(float(requirements.slopes[leg])), 0.0
    for _ in range(4):
        ground_track_speed = ground_speed(speed * math.cos(angle), tailwind, crosswind)
        angle = math.asin(min(1.0, max(-1.0, slope * ground_track_speed / speed)))
    return angle


def check_energy(requirements: RouteRequirements) -> None:
    """Raise StartError if the predicted energy exceeds `MAX_ENERGY_RATIO` times the energy carried.

    The prediction is skipped if even full power throughout the flight would not exceed this energy.
    """
    setup = requirements.setup
    duration = setup.path.length / float(setup.demanded_route.leg_airspeeds.min())
    full_power = setup.envelope.power_full
    full_energy = float(np.nanmax(full_power, initial=0.0)) * duration / 3600.0
    if full_energy <= MAX_ENERGY_RATIO * setup.battery:
        return
    energy_ratio = predicted_energy(requirements)[0] / setup.battery
    if energy_ratio > MAX_ENERGY_RATIO:
        reason = f"the mission needs {energy_ratio:.0f} times the energy carried"
        raise StartError(setup.mission.source, reason, field="energy", value=energy_ratio)
