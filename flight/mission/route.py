"""Lay out a mission's route as the aircraft flies it: waypoints, airspeeds and unrolled jumps."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aircraft.path_limits import Limits, turn_radius_between
from flight.mission.items import LANDINGS, OVER_TERRAIN, PLACES, Command, Mission, Notes, command_name
from flight.mission.itinerary import (
    GATES_ARE_NO_WAYPOINTS,
    NEVER_REACHED,
    NO_ITEM,
    Itinerary,
    OpenItem,
    RoutePoint,
    stated_loiter,
)
from flight.mission.loiter_circles import (
    DEFAULT_LOITER_RULES,
    DEFAULT_SPIRAL_SLOPE,
    DefaultRadius,
    LoiterRules,
    SpiralSlopes,
    UnjoinedStop,
    lay_out_waypoints,
)
from flight.mission.placing import (
    MAX_ALTITUDE_M,
    MIN_ALTITUDE_M,
    SAME_POSITION_DISTANCE_M,
    PlacedLanding,
    PlacedMission,
    place_stops,
)
from flight.mission.return_path import (
    DEFAULT_RETURN_RULES,
    RTL_NOT_CONTINUED_TEXT,
    ReturnAbility,
    ReturnCircle,
    ReturnRules,
    choose_target,
    nearest_landing_sequence,
    rtl_note,
    rtl_waypoints,
)
from world.arrays import Flags, Floats, Ints
from world.errors import MissionError
from world.frames import GeoOrigin, to_geo, to_map
from world.geometry import fly_by_offset, leg_courses, signed_turns, wrap
from world.kernels import Records, record_dtype
from world.scenario import Scenario
from world.terrain import Terrain

# Value of a field of a route point for which nothing is stated or known.
NOT_STATED = math.nan

# A waypoint of a route, and the leg to it.
ROUTE_POINT = record_dtype(
    ("position", np.float64, (3,)),  # east, north, up, m
    "airspeed",  # m/s, on the leg to the waypoint; `NOT_STATED` for the first waypoint, to which no leg leads
    "acceptance_radius",  # m, 0 where the mission states none (advisory: the verdict has its own rule)
    ("fly_over", np.bool_),  # True to turn behind the waypoint, False to turn on an arc that passes the waypoint
    ("item", np.int64),  # seq of the mission item, `NO_ITEM` for a waypoint without an item
    "arc_radius",  # m, radius of the turn, 0 for the radius at the bank limit; the loiter's radius at its corners
    ("stop", np.int64),  # number of the stop, never decreasing: a jump back leads to another stop of the same item
    "above_ground",  # m, height above ground held along the leg to the waypoint; `NOT_STATED` for a straight leg
    "min_ground_speed",  # m/s, for which ArduPlane raises its airspeed on the leg; 0 or less for none, or `NOT_STATED`
    "home_up",  # m AMSL, altitude of home on the leg to the waypoint; `NOT_STATED` if unknown
)
# Fields of `ROUTE_POINT` that are `NOT_STATED` by default.
_FIELDS_NOT_STATED = ("airspeed", "above_ground", "min_ground_speed", "home_up")


def route_points(position: ArrayLike, airspeed: ArrayLike, **fields: ArrayLike) -> Records:
    """Build the points of a route, (w,) records of `ROUTE_POINT`.

    position: (w, 3) east, north, up, m.
    airspeed: airspeed on each leg, m/s, (w - 1,) or one number.
    fields: other fields of `ROUTE_POINT`, each (w,) or one value. By default a point belongs to no item, and its other
        fields are 0, False or `NOT_STATED`. Without the field "stop", successive points of one item are one stop.

    >>> points = route_points(np.eye(3), 25.0, item=[1, 2, 2])
    >>> points["airspeed"].tolist(), points["stop"].tolist()
    ([nan, 25.0, 25.0], [0, 1, 1])
    """
    points: Records = np.zeros(len(np.asarray(position)), ROUTE_POINT)
    points["item"] = NO_ITEM
    for name in _FIELDS_NOT_STATED:
        points[name] = NOT_STATED
    _set_fields(points, {"position": position, "airspeed": airspeed, **fields})
    if "stop" not in fields:
        items = points["item"]
        points["stop"][1:] = np.cumsum((np.diff(items) != 0) | (items[1:] == NO_ITEM))
    return points


def _set_fields(points: Records, fields: dict[str, ArrayLike]) -> None:
    """Set fields of a route's points; the airspeed has one value for each leg."""
    for name, values in fields.items():
        points[name][1 if name == "airspeed" else 0 :] = values


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """Waypoints in flying order; leg i goes from waypoint i to i + 1.

    points: (w,) of `ROUTE_POINT`. A loiter consists of the corners of a polygon around its circle, all of the loiter's
        item, each with the circle's radius.
    started: description of the flight's start.
    notes: parts that cannot be flown as written, with item numbers.
    endless_jump: seq of a jump that repeats the last loop indefinitely, or None.
    takeoff_ground, landing_ground: altitude of the ground at take-off and at the landing point, m, above which the
        flight starts and ends; None without such a point or if unknown.
    rtl_start: index of the waypoint at which an RTL starts, or None; the waypoints from there to `rtl_end` represent
        the path that the autopilot chooses.
    rtl_loiter: loiter at the end of the RTL, which may continue to a landing sequence; None without an RTL.
    direct_landing_start: index of the waypoint at which an RTL without a loiter joins a landing sequence, or None; the
        leg to it starts at the aircraft and follows no line.
    unjoined_stops: stops that the autopilot flies to, but that the waypoints lack, because no tangent joins them to a
        circle.
    open_items: items that change the flight path in a way that is not simulated.
    """

    points: Records
    started: str
    notes: tuple[str, ...] = ()
    endless_jump: int | None = None
    takeoff_ground: float | None = None
    landing_ground: float | None = None
    rtl_start: int | None = None
    rtl_loiter: ReturnCircle | None = None
    direct_landing_start: int | None = None
    unjoined_stops: tuple[UnjoinedStop, ...] = ()
    open_items: tuple[OpenItem, ...] = ()

    def __post_init__(self) -> None:
        """Lock a copy of the points; the first point gets no airspeed, because no leg leads to it."""
        points = self.points.copy()
        points["airspeed"][0] = NOT_STATED
        points.setflags(write=False)
        object.__setattr__(self, "points", points)

    def with_fields(self, **fields: ArrayLike) -> "Route":
        """Return a copy of the route with new values in some fields of its points.

        The fields are those of `route_points`.
        """
        points = self.points.copy()
        _set_fields(points, fields)
        return replace(self, points=points)

    @property
    def positions(self) -> Floats:
        """Position of each waypoint, (w, 3) east, north, up, m."""
        return self.points["position"]

    @property
    def leg_airspeeds(self) -> Floats:
        """Airspeed on each leg, m/s, (w - 1,)."""
        return self.points["airspeed"][1:]

    @property
    def fly_over(self) -> Flags:
        """Mask of the waypoints that are flown over, (w,)."""
        return self.points["fly_over"]

    @property
    def items(self) -> Ints:
        """Number (seq) of the mission item of each waypoint, (w,); `NO_ITEM` without an item."""
        return self.points["item"]

    @property
    def arc_radii(self) -> Floats:
        """Turn radius at each waypoint, m, (w,); 0 for the radius at the bank limit."""
        return self.points["arc_radius"]

    @property
    def stops(self) -> Ints:
        """Number of the stop of each waypoint, (w,)."""
        return self.points["stop"]

    @property
    def legs(self) -> int:
        """Number of legs."""
        return len(self.points) - 1

    @property
    def leg_numbers(self) -> Ints:
        """Number by which messages name each leg, (w - 1,).

        All legs around a loiter have the number of the leg that leads to it.
        """
        return np.maximum(self.stops[1:] - 1, 0)

    def leg_numbers_of(self, legs: NDArray[np.integer[Any]]) -> Ints:
        """Return the numbers by which messages name the legs with these indices, (n,).

        An index beyond the route gives the number of the last leg.

        >>> route_of_loiter = Route(route_points(np.eye(3)[[0, 1, 2, 0]], 25.0, item=[1, 2, 2, 3]), "")
        >>> route_of_loiter.leg_numbers_of(np.array([0, 1, 2, 3])).tolist()
        [0, 0, 1, 1]
        """
        return self.leg_numbers[np.clip(legs, 0, self.legs - 1)]

    @property
    def rtl_end(self) -> int:
        """Index of the waypoint at which an RTL joins the landing sequence; else the number of waypoints."""
        if self.rtl_start is None:
            return len(self.points)
        is_return_item = self.items[self.rtl_start + 1 :] == self.items[self.rtl_start + 1]
        return self.rtl_start + 1 + int(np.argmin(is_return_item)) if not is_return_item.all() else len(self.points)

    @property
    def rtl_legs(self) -> range:
        """Legs of an RTL, on which the autopilot chooses the path; empty without an RTL."""
        return range(0) if self.rtl_start is None else range(self.rtl_start, min(self.rtl_end, self.legs))


def ends_at_plain_waypoint(route: Route, mission: Mission) -> bool:
    """Return True if a route ends at a plain waypoint, not at a loiter, a landing or an RTL.

    >>> route = Route(route_points(np.eye(3)[:2], 25.0, item=[1, 2]), "")
    >>> ends_at_plain_waypoint(route, Mission(None, ()))
    False
    """
    final_item = next((item for item in mission.items if item.seq == route.items[-1]), None)
    return (
        final_item is not None
        and final_item.command in PLACES
        and stated_loiter(final_item) is None
        and route.rtl_loiter is None
    )


def part_of_route(route: Route, first: int, last: int) -> Route:
    """Return the part of a route from waypoint ``first`` to waypoint ``last``, inclusive.

    >>> waypoints = np.array([[0.0, 1000.0 * k, 300.0] for k in range(4)])
    >>> whole = Route(route_points(waypoints, 25.0, item=np.arange(4)), "")
    >>> part_of_route(whole, 1, 3).items.tolist()
    [1, 2, 3]
    """
    if (first, last) == (0, route.legs):
        return route
    rtl_start, landing_start = route.rtl_start, route.direct_landing_start
    if rtl_start is not None:
        rtl_start = max(0, rtl_start - first) if rtl_start < last else None
    if landing_start is not None:
        landing_start = landing_start - first if first < landing_start <= last else None
    return replace(
        route,
        points=route.points[first : last + 1],
        endless_jump=None,
        takeoff_ground=route.takeoff_ground if first == 0 else None,
        landing_ground=route.landing_ground if last == route.legs else None,
        rtl_start=rtl_start,
        rtl_loiter=None if rtl_start is None else route.rtl_loiter,
        direct_landing_start=landing_start,
    )


# ----------------------------------------------------------------------
# Fly-over waypoints, which a fly-by arc would miss by too much.


class RouteRules(NamedTuple):
    """Rules by which an autopilot flies the route of a mission.

    returns: rules of RTLs.
    loiters: rules of loiters.
    reads_as_px4: True if the autopilot reads only the value of a speed change, and reads gates, as PX4 does.
    turn_distance: function that returns the distance before a waypoint at which the autopilot turns to the next leg, m,
        for a turn (rad, positive) and the waypoint's altitude (m AMSL); None for guidance on the fly-by path.
    acceptance_limit: maximum acceptance radius that the autopilot accepts from an item, m.
    """

    returns: ReturnRules = DEFAULT_RETURN_RULES
    loiters: LoiterRules = DEFAULT_LOITER_RULES
    reads_as_px4: bool = False
    turn_distance: Callable[[float, float], float] | None = None
    acceptance_limit: float = math.inf


# Rules of guidance on the fly-by path.
DEFAULT_ROUTE_RULES = RouteRules()
# Sharpest turn that guidance on the fly-by path does not fly over, rad: at 150 degrees the fly-by arc starts 3.7 radii
# before the waypoint and passes 2.9 radii from it, and at 180 degrees it never comes near.
SHARPEST_FLY_BY_RAD = math.radians(150.0)


def fly_over_waypoints(
    points: Records, limits: Limits | None, turn_distance: Callable[[float, float], float] | None = None
) -> Flags:
    """Return a mask of the waypoints that must be flown over, (w,).

    A fly-by arc would pass too far from these waypoints.

    points: points of a route, (w,) of `ROUTE_POINT`.
    limits: limits of the aircraft; None if unknown, for a result of False.
    turn_distance: function that returns the distance before a waypoint at which the autopilot turns to the next leg, m;
        see `RouteRules`.

    A fly-by arc with a turn angle ``turn`` passes its waypoint at the distance R(1/cos(turn/2) - 1). At 25 m/s and 30
    degrees of bank R is 110 m. The distance is then 46 m for a turn of 90 degrees, 110 m for 120 degrees, and 2 km for
    174 degrees. The limit of this distance is the acceptance radius that the mission states, or else the autopilot's
    turn distance. If neither is known, the limit is a turn of `SHARPEST_FLY_BY_RAD`.

    >>> from types import SimpleNamespace
    >>> from aircraft.path_limits import PerformanceTable
    >>> nothing = np.zeros(2)
    >>> table = PerformanceTable(25.0, 0.57735, 0.0, 0.0, 0.0, 0.0, 0.0, nothing, nothing, nothing)
    >>> limits = SimpleNamespace(performance=lambda airspeed: table)
    >>> corner = np.array([[0.0, 0.0, 500.0], [0.0, 1000.0, 500.0], [1000.0, 1000.0, 500.0]])
    >>> def is_flown_over(acceptance, turn_distance=None):
    ...     points = route_points(corner, 25.0, acceptance_radius=[0.0, acceptance, 0.0])
    ...     return bool(fly_over_waypoints(points, limits, turn_distance)[1])
    >>> [is_flown_over(acceptance) for acceptance in (0.0, 45.0, 46.0)]
    [False, True, False]
    >>> [is_flown_over(0.0, lambda turn, amsl: distance) for distance in (10.0, 90.0)]
    [True, False]
    """
    is_flown_over = np.zeros(len(points), dtype=np.bool_)
    if limits is None:
        return is_flown_over
    positions, airspeed, acceptance = points["position"], points["airspeed"], points["acceptance_radius"]
    courses, turns = leg_courses(positions), np.abs(signed_turns(positions))
    tables = {speed: limits.performance(speed) for speed in set(airspeed[1:].tolist())}
    for i in range(1, len(points) - 1):
        turn = float(turns[i - 1])
        table = tables[float(max(airspeed[i], airspeed[i + 1]))]
        radius = float(turn_radius_between(table, courses[i - 1], courses[i], positions[i, 2]))
        # A turn that cannot be flown in this wind has no arc.
        if turn == 0.0 or not math.isfinite(radius):
            continue
        if acceptance[i] > 0.0:
            is_flown_over[i] = fly_by_offset(turn, radius) > acceptance[i]
        elif turn_distance is None:
            is_flown_over[i] = turn > SHARPEST_FLY_BY_RAD
        else:
            is_flown_over[i] = fly_by_offset(turn, radius) > turn_distance(turn, float(positions[i, 2]))
    return is_flown_over


# ----------------------------------------------------------------------
# Straight lead-in and lead-out legs that give a route the start and end courses of its scenario.

# Length of these legs beyond the turn's tangent, m, on which the aircraft becomes level and steady on course.
END_LEG_LENGTH_M = 100.0
# Tolerance within which an end of the route is at the scenario's start or destination, m.
_SAME_END_M = 1.0
# Course difference below which no turn is needed, rad.
_MIN_COURSE_CHANGE_RAD = math.radians(0.5)


def with_end_courses(route: Route, scenario: Scenario, limits: Limits) -> Route:
    """Return a route that starts on the scenario's start course and ends on its destination course.

    A level lead-in leg is added before the first waypoint, and a level lead-out leg after the last. The turn onto the
    first leg and the turn off the last leg are then flown and judged like any other turn. Each added leg is as long as
    the turn's tangent plus `END_LEG_LENGTH_M`. A route is unchanged at an end that is not the scenario's start or
    destination, and at an end without a stated course.

    >>> from types import SimpleNamespace
    >>> from world.scenario import load_scenario
    >>> scenario = replace(load_scenario("tight"), start_course=0.0)  # north, and the route goes east
    >>> limits = SimpleNamespace(turn_radius=lambda *_: 110.0)  # all that is asked of the aircraft's limits
    >>> ends = np.array([scenario.start, scenario.destination])
    >>> route = Route(route_points(ends, 25.0, item=[1, 2]), "no take-off item")
    >>> longer = with_end_courses(route, scenario, limits)
    >>> longer.positions.round().tolist()
    [[0.0, -210.0, 75.0], [0.0, 0.0, 75.0], [2600.0, 0.0, 75.0]]
    >>> longer.started
    "no take-off item; on the scenario's start course, from a lead-in leg of 210 m"
    """
    ends, courses = route.positions[[0, -1]], leg_courses(route.positions)
    lead_in = lead_out = None
    if scenario.start_course is not None and math.dist(ends[0], scenario.start) < _SAME_END_M:
        lead_in = _lead_point(ends[0], scenario.start_course, float(courses[0]), limits, -1.0)
    if scenario.destination_course is not None and math.dist(ends[1], scenario.destination) < _SAME_END_M:
        lead_out = _lead_point(ends[1], scenario.destination_course, float(courses[-1]), limits, 1.0)
    if lead_in is None and lead_out is None:
        return route
    points, started, added_count = route.points.copy(), route.started, 0
    # The mission's acceptance radii at its ends do not apply to the turns that the lead legs add there.
    if lead_in is not None:
        length = math.dist(lead_in[:2], ends[0, :2])
        started += f"; on the scenario's start course, from a lead-in leg of {length:.0f} m"
        points["acceptance_radius"][0], points["airspeed"][0] = 0.0, points["airspeed"][1]
        points["stop"] += 1
        points = np.concatenate([route_points([lead_in], (), fly_over=points["fly_over"][:1], stop=0), points])
        added_count = 1
    if lead_out is not None:
        points["acceptance_radius"][-1] = 0.0
        end = route_points([lead_out], (), fly_over=points["fly_over"][-1:], stop=points["stop"][-1:] + 1)
        end["airspeed"] = points["airspeed"][-1]
        points = np.concatenate([points, end])
    return replace(
        route,
        points=points,
        started=started,
        rtl_start=None if route.rtl_start is None else route.rtl_start + added_count,
        direct_landing_start=None if route.direct_landing_start is None else route.direct_landing_start + added_count,
    )


def _lead_point(
    point: np.ndarray, course: float, leg_course: float, limits: Limits, end_sign: float
) -> np.ndarray | None:
    """Return the outer end of a level lead-in or lead-out leg, (3,) m; None if not needed.

    point: (3,) m, end of the route.
    course: the scenario's course at this end, rad.
    leg_course: course of the route's first or last leg, rad.
    end_sign: -1 for a lead-in, 1 for a lead-out.
    """
    turn = abs(float(wrap(course - leg_course)))
    if turn < _MIN_COURSE_CHANGE_RAD:
        return None
    radius = limits.turn_radius(*((course, leg_course) if end_sign < 0.0 else (leg_course, course)), float(point[2]))
    # Limit the tangent length, which is infinite for a reversal, to twice the radius.
    tangent_length = radius * min(math.tan(min(turn, math.radians(170.0)) / 2.0), 2.0)
    step = end_sign * ((tangent_length if math.isfinite(tangent_length) else 0.0) + END_LEG_LENGTH_M)
    return point + step * np.array([math.sin(course), math.cos(course), 0.0])


# ----------------------------------------------------------------------
# The route through the stops of a mission, with loiters and spirals that the aircraft can fly.

# Default loiter radius, m: PX4's default; an aircraft that cannot turn tightly enough has a larger one.
DEFAULT_LOITER_RADIUS_M = 80.0
# Minimum ratio of the default loiter radius to the radius of the aircraft's tightest turn.
LOITER_RADIUS_MARGIN = 1.1
# Fraction of the aircraft's slope limits in straight flight at which a spiral climbs and descends.
SPIRAL_SLOPE_FRACTION = 0.6


def make_route(
    mission: Mission,
    origin: GeoOrigin,
    terrain: Terrain | None,
    default_airspeed: float,
    fly_over: bool,
    limits: Limits | None = None,
    rules: RouteRules = DEFAULT_ROUTE_RULES,
) -> Route:
    """Return a mission's route on the map about ``origin``: `place_stops`, then `route_through_stops`.

    terrain: None if unknown; heights above terrain are then an error.
    default_airspeed: airspeed until the mission sets one, m/s. The cruiseSpeed of a `.plan` file does not set it,
        because it is only the ground station's estimate.
    fly_over: True to fly over all waypoints; otherwise only over the waypoints of `fly_over_waypoints`.
    limits: limits of the aircraft: they determine the turns, the default loiter radius (80 m if None) and the slope of
        a spiral (5 % if None).
    rules: rules by which the autopilot flies a route.

    The route starts at the first item with a position, or above home at the altitude of a take-off item if the mission
    starts with one. Every leg has a horizontal length of at least `flight.mission.placing.SAME_POSITION_DISTANCE_M`.
    Raises MissionError, which names the item, if a stop cannot be placed, or if the mission has fewer than two
    positions.

    >>> from flight.mission.items import Command, Frame, MissionItem
    >>> items = [
    ...     MissionItem(k, Command.NAV_WAYPOINT, Frame.GLOBAL, (0.0,) * 4, lat, -84.2, 700.0)
    ...     for k, lat in enumerate((36.50, 36.51, 36.52), 1)
    ... ]
    >>> route = make_route(Mission(None, tuple(items)), GeoOrigin(36.5, -84.2), None, 25.0, fly_over=False)
    >>> route.positions.round().tolist()
    [[0.0, 0.0, 700.0], [0.0, 1110.0, 700.0], [0.0, 2219.0, 700.0]]
    >>> route.started
    'no take-off item, so the flight starts in the air, trimmed, at the first position (item 1): 36.5... 0 degrees'
    """
    return route_through_stops(place_stops(mission, origin, terrain), default_airspeed, fly_over, limits, rules)


def route_through_stops(
    placed_mission: PlacedMission,
    default_airspeed: float,
    fly_over: bool,
    limits: Limits | None = None,
    rules: RouteRules = DEFAULT_ROUTE_RULES,
) -> Route:
    """Return the route through a mission's stops on the map.

    The arguments are those of `make_route`.

    Raises MissionError for fewer than two stops, or for a loiter too wide or too long to lay out.
    """
    mission, itinerary, notes = placed_mission.mission, placed_mission.itinerary, Notes()
    return_rules, loiter_rules, reads_as_px4, turn_distance, acceptance_limit = rules
    all_stops = _insert_gates(placed_mission, notes) if reads_as_px4 else placed_mission.stops
    read_stops = partial(_read_stops, default_airspeed, reads_as_px4)
    placed_stops = read_stops(all_stops, 0)
    return_stop = placed_stops.pop() if itinerary.ends_with_rtl else None
    direct_landing = _find_direct_landing(placed_mission, placed_stops, return_rules, notes)
    if direct_landing is not None:
        placed_stops += read_stops(direct_landing.stops, len(all_stops))
    lay_out = partial(
        lay_out_waypoints,
        mission.source,
        notes=notes,
        default_radius=_default_radius_function(limits),
        slopes=_spiral_slope_function(limits),
        rules=loiter_rules,
    )
    points, unjoined = lay_out(placed_stops)
    _note_unsimulated_loiters(itinerary, placed_stops, loiter_rules, notes)
    landing, return_fields = direct_landing, dict[str, Any]()
    if return_stop is not None and direct_landing is None:
        return_fields, landing = _append_rtl(placed_mission, return_stop, points, rules, limits, notes)
        if landing is not None:
            points += lay_out(read_stops(landing.stops, len(all_stops)))[0]
    if len(points) < 2:
        message = f"{mission.source}: {len(points)} position to fly to: expected at least two different positions"
        raise MissionError(message, file=mission.source)
    home_up = placed_mission.home_up
    records = route_points(
        [point.map_position for point in points],
        [point.airspeed for point in points[1:]],
        acceptance_radius=np.minimum([point.acceptance_radius for point in points], acceptance_limit),
        item=[point.item for point in points],
        arc_radius=[point.arc_radius for point in points],
        stop=np.cumsum([False, *(point.stop != next_point.stop for point, next_point in pairwise(points))]),
        # Only the leg to a place above terrain holds a height above ground.
        above_ground=[
            point.alt if point.frame in OVER_TERRAIN and point.command in PLACES else NOT_STATED for point in points
        ],
        min_ground_speed=[point.min_ground_speed for point in points],
        home_up=[home_up if math.isnan(point.home_up) else point.home_up for point in points],
    )
    is_missed = fly_over_waypoints(records, limits, turn_distance)
    records["fly_over"] = (records["arc_radius"] == 0.0) & (fly_over | is_missed)
    _note_cruise_speed(mission, default_airspeed, points[1], notes)
    route_notes = itinerary.px4_notes if reads_as_px4 else itinerary.notes
    open_items = itinerary.px4_open_items if reads_as_px4 else itinerary.open_items
    if landing is not None:
        # The landing sequence reaches the items that the itinerary before it never reaches.
        route_notes = (*(note for note in route_notes if NEVER_REACHED not in note), *landing.notes)
        open_items += landing.open_items
    return Route(
        points=records,
        started=_start_text(itinerary, points[0], placed_mission.origin, records["position"]),
        notes=route_notes + placed_mission.notes + notes.lines(),
        direct_landing_start=None if landing is None else [point.item for point in points].index(landing.stops[0].item),
        endless_jump=itinerary.endless_jump,
        takeoff_ground=placed_mission.takeoff_ground,
        landing_ground=placed_mission.landing_ground if landing is None else landing.ground,
        # An autopilot that flies on tangents omits these stops.
        unjoined_stops=unjoined if loiter_rules.steers_to_center else (),
        open_items=open_items,
        **return_fields,
    )


def _find_direct_landing(
    placed_mission: PlacedMission, stops: list[RoutePoint], rules: ReturnRules, notes: Notes
) -> PlacedLanding | None:
    """Return the landing sequence to which the mission's RTL flies without a loiter.

    Return None if there is no such sequence. A note on the sequence is added.

    stops: stops before the RTL.
    """
    if not placed_mission.itinerary.ends_with_rtl or rules.landing_join != "straight" or not stops:
        return None
    east, north, up = stops[-1].map_position
    landing = _find_landing(placed_mission, (east, north, up), notes)
    if landing is None:
        return None
    distance, seq = math.dist((east, north), landing.start.position[:2]), placed_mission.itinerary.stops[-1].item
    text = f"flies at once to the landing sequence at item {landing.start.item}, {distance / 1000.0:.1f} km away"
    notes.add(f"{Command.NAV_RETURN_TO_LAUNCH.name} {text}{_landing_choice_text(placed_mission)}", seq)
    return landing


def _find_landing(
    placed_mission: PlacedMission, position: tuple[float, float, float], notes: Notes
) -> PlacedLanding | None:
    """Return the landing sequence that an RTL chooses at a position (m), or None if it chooses none.

    If the simulation of the RTL does not continue to that sequence, return None, and add a note.
    """
    start = nearest_landing_sequence(position, placed_mission.landing_starts)
    landing = next((landing for landing in placed_mission.landings if landing.start == start), None)
    if start is not None and landing is None:
        reason = "begins with the landing itself" if start.is_landing else "does not lead to a landing"
        text = f"the landing sequence at item {start.item} {reason}, so {RTL_NOT_CONTINUED_TEXT}"
        notes.add(text, placed_mission.itinerary.stops[-1].item)
    return landing


def _landing_choice_text(placed_mission: PlacedMission) -> str:
    """Describe the choice of a landing sequence; "" for a single one.

    For example " (the nearest of 2, with height differences)".

    ArduPlane compares distances in three dimensions.
    """
    count = len(placed_mission.landing_starts)
    return f" (the nearest of {count}, with height differences)" if count > 1 else ""


def _note_unsimulated_loiters(
    itinerary: Itinerary, placed_stops: list[RoutePoint], loiters: LoiterRules, notes: Notes
) -> None:
    """Add notes on the parts of the autopilot's loiters that are not simulated.

    placed_stops: stops of the mission before an RTL.
    """
    final_stop = placed_stops[-1]
    if loiters.unflown_note and (
        itinerary.ends_with_rtl or any(placed_stop.loiter is not None for placed_stop in placed_stops)
    ):
        notes.add(loiters.unflown_note)
    if (
        loiters.ends_in_circle
        and not itinerary.ends_with_rtl
        and itinerary.landing is None
        and final_stop.loiter is None
    ):
        notes.add(loiters.end_note(), final_stop.item)
    if loiters.rtl_exit_note and itinerary.ends_with_rtl and final_stop.loiter is not None:
        notes.add(loiters.rtl_exit_note, final_stop.item)


def _append_rtl(
    placed_mission: PlacedMission,
    stop: RoutePoint,
    points: list[RoutePoint],
    route_rules: RouteRules,
    limits: Limits | None,
    notes: Notes,
) -> tuple[dict[str, Any], PlacedLanding | None]:
    """Append the waypoints of an RTL to the points of a route, and add notes on it.

    stop: itinerary stop of the RTL.
    points: points of the route up to the RTL, which are extended.

    Returns the keyword arguments of `Route` for the RTL, and the landing sequence that follows. The sequence is None if
    the RTL stays in its loiter. Raises MissionError if the RTL's altitude is outside the allowed range.
    """
    source, start = placed_mission.mission.source, points[-1].map_position
    home, *rally = placed_mission.return_points
    rules = route_rules.returns
    target = choose_target(rules, start, home, rally)
    target_altitude = target.position[2]
    if not MIN_ALTITUDE_M <= target_altitude <= MAX_ALTITUDE_M:
        allowed = f"allowed {MIN_ALTITUDE_M:.0f}..{MAX_ALTITUDE_M:.0f}"
        location = f"item {stop.item}: return to {target.name}"
        raise MissionError.at(source, location, target_altitude, allowed, shown=f"{target_altitude:.1f} m AMSL")
    climb_slope, dive_slope = _spiral_slope_function(limits)(stop.airspeed, max(start[2], target_altitude))
    ability = ReturnAbility(
        turn_radius=lambda course, end_course, amsl: (
            DEFAULT_LOITER_RADIUS_M if limits is None else limits.turn_radius(course, end_course, amsl, stop.airspeed)
        ),
        min_loiter_radius=_tightest_circle_radius(limits, stop.airspeed, target_altitude) or 0.0,
        climb_slope=climb_slope,
        dive_slope=dive_slope,
        max_bank=math.radians(30.0) if limits is None else limits.max_bank,
        airspeed=stop.airspeed,
        loiter_radius_scale=route_rules.loiters.radius_scale(target_altitude) if rules.radius else 1.0,
    )
    if not rules.radius:
        rules = replace(rules, radius=_default_radius_function(limits)(stop.airspeed, target_altitude))
    landing = _find_landing(placed_mission, target.position, notes) if rules.landing_join == "circle" else None
    next_text = (
        ""
        if landing is None
        else f"the landing sequence at item {landing.start.item}{_landing_choice_text(placed_mission)}"
    )
    notes.add(rtl_note(target, rules, start[2], next_text), stop.item)
    if rules.may_use_landing and any(item.command in LANDINGS for item in placed_mission.mission.items):
        notes.add(
            "the autopilot may also return to the mission's landing, which is not simulated."
            f" The simulated RTL goes to {target.name}",
            stop.item,
        )
    if rules.deviation_note:
        notes.add(rules.deviation_note, stop.item)
    start_index = len(points) - 1
    next_position = None if landing is None else landing.start.position
    points += rtl_waypoints(points, stop, target, rules, ability, next_position)
    circle = ReturnCircle(*target.position, rules.radius, target.slope_base)
    return {"rtl_start": start_index, "rtl_loiter": circle}, landing


# Distance of a gate from its leg beyond which the aircraft misses the place where the camera is to be switched, m.
_MAX_GATE_DISTANCE_M = 10.0


def _insert_gates(placed_mission: PlacedMission, notes: Notes) -> list[RoutePoint]:
    """Return a mission's placed stops, with a stop for each gate.

    At a gate PX4 changes airspeed or camera.

    PX4 passes a gate when the aircraft crosses the plane through the gate that is perpendicular to the line from the
    gate to the next stop. Each gate is placed where this plane cuts the leg. A gate that is not between two waypoints,
    and a gate that switches the camera but lies next to its leg, get a note.
    """
    placed_stops = list(placed_mission.stops[:1])
    for next_stop in placed_mission.stops[1:]:
        previous, gates, last_fraction = placed_stops[-1], next_stop.gates, 0.0
        for index, gate in enumerate(gates):
            next_airspeed = gates[index + 1].airspeed if index + 1 < len(gates) else next_stop.px4_airspeed
            keeps_airspeed = gate.airspeed == next_airspeed or (math.isnan(gate.airspeed) and math.isnan(next_airspeed))
            if keeps_airspeed and not gate.switches_camera:
                continue
            if not all(leg_end.loiter is None and leg_end.command in PLACES for leg_end in (previous, next_stop)):
                if not keeps_airspeed:
                    text = "CONDITION_GATE is not between waypoints, so the speed after it applies from the leg's start"
                    notes.add(text, gate.item)
                continue
            start, end = np.array(previous.map_position), np.array(next_stop.map_position)
            gate_position = to_map(placed_mission.origin, gate.lat_deg, gate.lon_deg)
            (leg_east, leg_north), offset = (end - start)[:2], np.array(gate_position, dtype=float) - start[:2]
            gate_distance = abs(float(leg_east * offset[1] - leg_north * offset[0]))
            gate_distance /= max(math.hypot(leg_east, leg_north), 1e-9)
            if gate.switches_camera and gate_distance > _MAX_GATE_DISTANCE_M:
                distance_text = f"passed at more than {_MAX_GATE_DISTANCE_M:g} m"
                notes.add(f"{distance_text}, because {GATES_ARE_NO_WAYPOINTS}", gate.item)
            # PX4 passes a gate at the vertical plane through its position, perpendicular to the line to the leg's end.
            gate_to_end = end[:2] - np.array([float(gate_position[0]), float(gate_position[1])])
            length_along_normal = float((end[:2] - start[:2]) @ gate_to_end)
            fraction = 0.0
            if length_along_normal > 0.0:
                # Backwards from the leg's end, whose distance from the plane is its distance from the gate.
                fraction = 1.0 - float(gate_to_end @ gate_to_end) / length_along_normal
            east, north, up = (start + fraction * (end - start)).tolist()
            is_apart = (
                min(math.dist((east, north), leg_end.map_position[:2]) for leg_end in (placed_stops[-1], next_stop))
                >= SAME_POSITION_DISTANCE_M
            )
            if last_fraction < fraction < 1.0 and is_apart:
                last_fraction = fraction
                gate_stop = replace(
                    next_stop, item=gate.item, command=int(Command.CONDITION_GATE), px4_airspeed=gate.airspeed, gates=()
                )
                placed_stops.append(gate_stop.placed_at((east, north, up)))
        placed_stops.append(next_stop)
    return placed_stops


def _read_stops(
    default_airspeed: float, as_px4: bool, stops: Sequence[RoutePoint], first_number: int
) -> list[RoutePoint]:
    """Return placed stops with their numbers in flying order, and with the airspeed of the leg to each.

    default_airspeed: airspeed for a stop without a stated one, m/s.
    as_px4: True for the airspeeds as PX4 reads them, False for ArduPlane.
    first_number: number of the first stop.
    """
    stated_airspeeds = [stop.px4_airspeed if as_px4 else stop.airspeed for stop in stops]
    return [
        replace(stop, stop=number, airspeed=default_airspeed if math.isnan(airspeed) else airspeed)
        for number, (stop, airspeed) in enumerate(zip(stops, stated_airspeeds, strict=True), first_number)
    ]


# Difference between a ground station's cruiseSpeed and the airspeed, as a fraction of the airspeed, beyond which
# cruiseSpeed is probably for another aircraft.
MAX_CRUISE_SPEED_DIFFERENCE = 0.2


def _note_cruise_speed(mission: Mission, airspeed: float, first_stop: RoutePoint, notes: Notes) -> None:
    """Add a note if a mission states a cruise speed (cruiseSpeed) that its first leg does not use.

    airspeed: airspeed until the mission sets one, m/s.
    first_stop: route point at the end of the first leg.
    """
    if mission.cruise_speed is not None and mission.cruise_speed != airspeed and first_stop.airspeed == airspeed:
        text = (
            f"cruiseSpeed {mission.cruise_speed:g} m/s is only the ground station's planning value."
            f" The flight starts at {airspeed:g} m/s"
        )
        if abs(mission.cruise_speed - airspeed) > MAX_CRUISE_SPEED_DIFFERENCE * airspeed:
            text += f" (--aircraft selects your aircraft, --airspeed {mission.cruise_speed:g} flies at that airspeed)"
        notes.add(text)


def _default_radius_function(limits: Limits | None) -> DefaultRadius:
    """Return a function that computes the default loiter radius, m.

    The radius is 10 % larger than the tightest turn in the wind, rounded up to a multiple of 10 m, and at least
    `DEFAULT_LOITER_RADIUS_M`, which applies to an unknown aircraft.
    """

    def radius(airspeed: float, up: float) -> float:
        """Return the default loiter radius at an airspeed (m/s) and an altitude (m AMSL), m."""
        min_radius = _tightest_circle_radius(limits, airspeed, up) or 0.0
        return max(DEFAULT_LOITER_RADIUS_M, math.ceil(LOITER_RADIUS_MARGIN * min_radius / 10.0) * 10.0)

    return radius


def _tightest_circle_radius(limits: Limits | None, airspeed: float, up: float) -> float | None:
    """Return the radius of the tightest circle that the aircraft can fly in the wind, m; None if unknown.

    The radius is also unknown if the wind is too strong for some of the circle's courses.
    """
    if limits is None:
        return None
    radius = max(limits.turn_radius(course, course + math.pi, up, airspeed) for course in (0.0, math.pi))
    return radius if math.isfinite(radius) else None


def _spiral_slope_function(limits: Limits | None) -> SpiralSlopes:
    """Return a function that computes the steepest climb and descent of a spiral, as tangents.

    In wind, the aircraft's slope limit depends on the course. A spiral passes through all courses, so the lowest limit
    of eight courses applies, or the limit stated for every course if that is lower. The tangent of this limit is
    multiplied by `SPIRAL_SLOPE_FRACTION`. The slope is `DEFAULT_SPIRAL_SLOPE` if there is no limit, or if the aircraft
    cannot climb or descend at all.
    """

    def slopes(airspeed: float, up: float) -> tuple[float, float]:
        """Return the steepest climb and descent of a spiral at an airspeed and an altitude, as tangents."""
        if limits is None:
            return DEFAULT_SPIRAL_SLOPE, DEFAULT_SPIRAL_SLOPE
        spiral_slopes = []
        for index, stated_limit in enumerate((limits.max_climb, limits.max_dive)):
            limit = min(limits.slopes(course, up, airspeed)[index] for course in np.arange(8) * (math.pi / 4.0))
            slope = min(limit, math.inf if stated_limit is None else stated_limit)
            # An aircraft that cannot climb gets a plain spiral, and the slope rule reports it.
            spiral_slopes.append(SPIRAL_SLOPE_FRACTION * math.tan(slope) if 0.0 < slope < 1.5 else DEFAULT_SPIRAL_SLOPE)
        return spiral_slopes[0], spiral_slopes[1]

    return slopes


def _start_text(itinerary: Itinerary, first_stop: RoutePoint, origin: GeoOrigin, waypoints: Floats) -> str:
    """Describe the start of a flight in the air: its item, position, altitude and course.

    first_stop: route point at the start.
    waypoints: waypoints of the route, (w, 3) m.
    """
    course = math.degrees(float(leg_courses(waypoints)[0])) % 360.0
    lat, lon = first_stop.lat_deg, first_stop.lon_deg
    if first_stop.loiter is not None:
        lat, lon = (float(value) for value in to_geo(origin, waypoints[0, 0], waypoints[0, 1]))
    start_place = f"{lat:.7f}, {lon:.7f}, {waypoints[0, 2]:.1f} m AMSL, on course {course:.0f} degrees"
    item = itinerary.takeoff
    start_text = "the flight starts in the air, trimmed,"
    if item is not None:
        start_text = f"{command_name(item.command)} (item {item.seq}) is not flown from the ground: {start_text}"
    else:
        start_text = f"no take-off item, so {start_text}"
    if first_stop.loiter is not None:
        return f"{start_text} on the loiter of item {first_stop.item}: {start_place}"
    if item is not None:
        place_name = "home" if itinerary.has_home else "the first position (there is no home)"
        return f"{start_text} over {place_name} at this item's altitude: {start_place}"
    return f"{start_text} at the first position (item {first_stop.item}): {start_place}"
