"""Compute the fly-by path of a fixed-wing aircraft.

Fly-by arcs join its legs, and parabolas join its slopes.

A fly-by arc has the bank-limited radius for the highest ground speed in the turn, and the corners of a loiter have the
loiter's radius. If the legs are too short for their turns, the arcs are tighter than the bank limit so that the path
stays continuous; the flight will then leave the path, and the verdict says so. The path goes through a fly-over
waypoint, whose corner stays sharp, like the corner of a U-turn.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from aircraft.path_limits import BLEND_ACCELERATION, Limits
from flight.guidance.lateral_reference_laws import WAYPOINT
from flight.mission.items import LANDINGS, PLACES, TAKEOFFS, Command, Mission
from flight.mission.itinerary import pass_by_distance, stated_loiter
from flight.mission.route import SHARPEST_FLY_BY_RAD, Route, ends_at_plain_waypoint
from world.arrays import Floats
from world.geometry import leg_courses, leg_runs, signed_turns, tangent_length, wrap
from world.kernels import Record, compiled, inner, record_dtype
from world.terrain import Terrain

Records = NDArray[np.record]


# ----------------------------------------------------------------------
# Position on a `FlyByPath`, its curvature and its altitude, for the compiled loop.


# A straight piece or an arc of the path.
PIECE = record_dtype(
    "start",  # m along the path
    "length",  # m
    "east",  # m, of its start
    "north",
    "course",  # rad, at its start
    "curvature",  # 1/m, positive to the right
    ("leg", np.int64),  # leg at its start
    "leg_change",  # m along the path, start of the next leg; infinite if the next leg does not start on this piece
)
# A corner of the altitude profile and the parabola that blends it.
NODE = record_dtype(
    "distance",  # m along the path
    "altitude",  # m AMSL
    "slope",  # tangent of the slope after the corner
    "half_length",  # m, of the parabola
)


@inner
def project(piece: Record, east: float, north: float) -> tuple[float, float, float]:
    """Project a position onto a piece of the path; return distance, cross-track error and course.

    The distance is measured along the piece, m; it may be negative (before the start) or exceed the length of the
    piece. The cross-track error is in m, positive to the right. The course is the path's course at the projected point,
    rad.

    piece: a record of `PIECE`.
    east, north: position to project, m.
    """
    course, curvature = piece.course, piece.curvature
    offset_east, offset_north = east - piece.east, north - piece.north
    if curvature == 0.0:
        return (
            offset_east * math.sin(course) + offset_north * math.cos(course),
            offset_east * math.cos(course) - offset_north * math.sin(course),
            course,
        )
    # From the center, which lies right of the start by 1 / curvature.
    center_to_east = offset_east - math.cos(course) / curvature
    center_to_north = offset_north + math.sin(course) / curvature
    turn_sign = math.copysign(1.0, curvature)
    path_course = math.atan2(turn_sign * center_to_north, -turn_sign * center_to_east)
    angle = wrap(path_course - course) * turn_sign
    if angle < -0.5 * math.pi:
        angle += 2.0 * math.pi
    return (
        angle / abs(curvature),
        turn_sign * (1.0 / abs(curvature) - math.hypot(center_to_east, center_to_north)),
        path_course,
    )


@inner
def find_on_path(motion: Record, pieces: Records, memory: Record) -> float:
    """Find the aircraft's position along the path, store it in ``memory``, and return the course there.

    The course is that of the path, rad.

    The search starts at the piece of the last tick and never goes back.

    motion: a record of `flight.guidance.navigation_error.MOTION`.
    pieces: records of `PIECE`.
    memory: a record of `flight.guidance.inner_loops.GUIDANCE_MEMORY`.
    """
    index = memory.piece
    distance, cross_track, course = project(pieces[index], motion.east, motion.north)
    while distance > pieces[index].length and index + 1 < pieces.shape[0]:
        index += 1
        distance, cross_track, course = project(pieces[index], motion.east, motion.north)
    piece = pieces[index]
    memory.piece = index
    memory.distance = piece.start + distance
    memory.leg = piece.leg + (1 if memory.distance > piece.leg_change else 0)
    memory.cross_track = cross_track
    memory.is_finished = index + 1 == pieces.shape[0] and distance >= piece.length
    return course


@inner
def pass_sharp_corners(pieces: Records, memory: Record, leg: int) -> None:
    """Advance the position in ``memory`` past sharp corners, to the leg that an autopilot already flies.

    An autopilot may turn towards a leg before it passes the end of the previous leg.  A corner of more than 90 degrees
    between straight pieces is sharp; the position stops before any other joint.

    leg: leg that the autopilot flies.
    Other arguments as for `find_on_path`.
    """
    while memory.piece + 1 < pieces.shape[0] and pieces[memory.piece].leg < leg:
        piece, next_piece = pieces[memory.piece], pieces[memory.piece + 1]
        is_corner = piece.curvature == 0.0 and next_piece.curvature == 0.0
        if not is_corner or math.cos(next_piece.course - piece.course) >= 0.0:
            return
        memory.piece += 1


@inner
def mean_curvature(pieces: Records, first_piece: int, start: float, end: float) -> float:
    """Return the mean curvature of the path between two distances along it, 1/m, positive to the right.

    Both distances (m) are at or after the piece ``first_piece``.
    """
    turn_angle = 0.0
    for i in range(first_piece, pieces.shape[0]):
        piece = pieces[i]
        overlap_start = max(start, piece.start)
        overlap_end = min(end, piece.start + piece.length)
        if overlap_end > overlap_start:
            turn_angle += piece.curvature * (overlap_end - overlap_start)
        if piece.start > end:
            break
    return turn_angle / (end - start)


@inner
def max_curvature(pieces: Records, first_piece: int, start: float, end: float) -> float:
    """Return the maximum magnitude of the path's curvature between two distances along it, 1/m.

    Both distances (m) are at or after the piece ``first_piece``.
    """
    max_piece_curvature = 0.0
    for i in range(first_piece, pieces.shape[0]):
        piece = pieces[i]
        if piece.start > end:
            break
        if piece.start + piece.length > start:
            max_piece_curvature = max(max_piece_curvature, abs(piece.curvature))
    return max_piece_curvature


@compiled
def profile_at(nodes: Records, distance: float) -> tuple[float, float, float]:
    """Return altitude (m), slope (m per m) and change of slope (1/m) of an altitude profile at a distance.

    nodes: records of `NODE`.
    distance: distance along the path, m.
    """
    index = 0
    while index + 1 < nodes.shape[0] and nodes[index + 1].distance <= distance:
        index += 1
    for i in range(index, min(index + 2, nodes.shape[0])):
        node = nodes[i]
        half_length = node.half_length
        if half_length > 0.0 and abs(distance - node.distance) < half_length:
            previous_slope = nodes[max(i - 1, 0)].slope
            slope_rate = (node.slope - previous_slope) / (2.0 * half_length)
            blend_distance = distance - node.distance + half_length
            return (
                node.altitude
                + previous_slope * (blend_distance - half_length)
                + 0.5 * slope_rate * blend_distance * blend_distance,
                previous_slope + slope_rate * blend_distance,
                slope_rate,
            )
    node = nodes[index]
    return node.altitude + node.slope * (distance - node.distance), node.slope, 0.0


# Maximum turn per chord of an arc, rad.
MAX_CHORD_TURN_RAD = math.radians(5.0)


@dataclass(frozen=True, slots=True, eq=False)
class FlyByPath:
    """A fly-by path as a function of the distance along it.

    pieces: (p,) of `PIECE`, straight pieces and arcs.
    nodes: (k,) of `NODE`, the corners of the altitude profile.
    length: m.
    """

    pieces: Records
    nodes: Records
    length: float

    def __post_init__(self) -> None:
        """Lock the arrays."""
        self.pieces.setflags(write=False)
        self.nodes.setflags(write=False)


# Turn after a fly-over waypoint; see `fly_by_path`.
FlyOverTurn = Literal["none", "short", "long"]
# Difference from 180 degrees up to which a turn may go to either side, rad: the angle of a navigation error of 5 m at
# ArduPlane's L1 distance of 60 m at 25 m/s.
REVERSAL_SIDE_TOLERANCE_RAD = math.radians(5.0)

# Distance between corners of the altitude profile along a leg that follows the ground, m: ArduPlane's TERRAIN_SPACING.
GROUND_STEP_M = 100.0


def fly_by_path(
    route: Route, limits: Limits, terrain: Terrain | None = None, fly_over_turn: FlyOverTurn = "short"
) -> FlyByPath:
    """Join the legs of a route to a fly-by path.

    The route has at least one leg, and only its first leg may have no length. An arc leads past each fly-by waypoint.
    After a fly-over waypoint, arcs lead back to the next leg.

    terrain: terrain for legs that hold a height above ground; with None these legs are straight.
    fly_over_turn: "none" keeps the corners at fly-over waypoints sharp, for an autopilot with its own turns. "long"
        takes the longer turn at `reversals`, and "short" takes the shorter turn at all waypoints.

    At 25 m/s in calm air with 0.5 rad of bank, the arc at a right angle has a radius of 117 m:

    >>> from aircraft.catalog import load_aircraft
    >>> from flight.dynamics.envelope_tables import load_envelope
    >>> from flight.mission.route import route_points
    >>> from flight.simulation.setup import make_limits
    >>> from world.scenario import load_scenario
    >>> limits = make_limits(load_scenario("tight"), load_envelope(load_aircraft("aerosonde")), 25.0, 0.5)
    >>> positions = np.array([[0.0, 0.0, 500.0], [0.0, 1000.0, 500.0], [1000.0, 1000.0, 520.0]])
    >>> path = fly_by_path(Route(route_points(positions, 25.0), ""), limits)
    >>> path.pieces["length"].round().tolist(), round(1.0 / path.pieces["curvature"][1])
    ([883.0, 183.0, 883.0], 117)
    """
    points = route.positions
    courses, leg_lengths, turns = leg_courses(points), leg_runs(points), signed_turns(points)
    if fly_over_turn == "long":
        # A reversal turns to the other side, by more than 180 degrees.
        corners = reversals(route) - 1
        turns[corners] -= np.copysign(2.0 * math.pi, turns[corners])
    tangents, radii, return_lengths = _arcs_at_waypoints(route, limits, courses, leg_lengths, turns)
    return_lengths *= fly_over_turn != "none"
    pieces: list[tuple[float, ...]] = []
    nodes: list[tuple[float, float]] = [(0.0, float(points[0, 2]))]
    # A loiter at the start of the flight may end where it starts.
    slopes = np.divide(np.diff(points[:, 2]), leg_lengths, out=np.zeros_like(leg_lengths), where=leg_lengths > 0.0)
    distance, piece_start = 0.0, points[0, :2].copy()
    for leg in range(route.legs):
        straight_length = leg_lengths[leg] - tangents[leg] - return_lengths[leg] - tangents[leg + 1]
        course = float(courses[leg])
        if terrain is not None and math.isfinite(route.points["above_ground"][leg + 1]):
            nodes += _ground_following_corners(route, terrain, leg, piece_start, course, distance, straight_length)
        if straight_length > 1e-6 or not pieces:
            pieces.append((distance, straight_length, *piece_start, course, 0.0, leg, math.inf))
            distance += straight_length
        corner = points[leg + 1]
        piece_start = corner[:2] - tangents[leg + 1] * np.array([math.sin(course), math.cos(course)])
        nodes.append((distance, float(corner[2] - slopes[leg] * tangents[leg + 1])))
        if leg + 1 == route.legs:
            continue
        turn, next_course = float(turns[leg]), float(courses[leg + 1])
        if return_lengths[leg + 1] > 0.0:
            # Through the waypoint, and back to the next leg on arcs.
            for arc_start, heading, curvature, length in _fly_over_arcs(corner[:2], course, turn, radii[leg + 1]):
                pieces.append((distance, length, *arc_start, heading, curvature, leg + 1, math.inf))
                distance += length
            piece_start = corner[:2] + return_lengths[leg + 1] * np.array(
                [math.sin(next_course), math.cos(next_course)]
            )
            nodes.append((distance, float(corner[2] + slopes[leg + 1] * return_lengths[leg + 1])))
            continue
        if tangents[leg + 1] == 0.0:
            continue
        length = radii[leg + 1] * abs(turn)
        curvature = math.copysign(1.0 / radii[leg + 1], turn)
        pieces.append((distance, length, *piece_start, course, curvature, leg, distance + length / 2))
        distance += length
        piece_start = corner[:2] + tangents[leg + 1] * np.array([math.sin(next_course), math.cos(next_course)])
        nodes.append((distance, float(corner[2] + slopes[leg + 1] * tangents[leg + 1])))
    return FlyByPath(np.array(pieces, PIECE), _altitude_profile(nodes, limits, route), float(distance))


def reversals(route: Route) -> NDArray[np.int64]:
    """Return the indices of fly-over waypoints at which the course reverses.

    At such a waypoint the turn may go to either side.

    >>> from flight.mission.route import route_points
    >>> positions = np.array([[0.0, 0.0, 90.0], [0.0, 900.0, 90.0], [60.0, 0.0, 90.0], [900.0, 0.0, 90.0]])
    >>> fly_over = np.array([False, True, True, False])
    >>> reversals(Route(route_points(positions, 25.0, fly_over=fly_over), "")).tolist()
    [1]
    """
    turns = np.concatenate([[0.0], np.abs(signed_turns(route.positions)), [0.0]])
    return np.flatnonzero(route.fly_over & (turns > math.pi - REVERSAL_SIDE_TOLERANCE_RAD))


def _ground_following_corners(
    route: Route, terrain: Terrain, leg: int, segment_start: Floats, course: float, start_distance: float, length: float
) -> list[tuple[float, float]]:
    """Return the corners of the altitude profile on a leg that follows the ground.

    A corner is a pair (distance along the path, altitude AMSL), m. The height above ground changes linearly from its
    value at the start of the leg to the value that the mission item at the end states. Places where the terrain is
    unknown have no corner.

    leg: index of the leg.
    segment_start: east and north of the start of the leg's straight part, m, (2,).
    course: course of the leg, rad.
    start_distance: distance of the straight part's start along the path, m.
    length: length of the straight part, m.
    """
    leg_start, end_height = route.positions[leg], float(route.points["above_ground"][leg + 1])
    start_height = float(leg_start[2]) - float(terrain.height(leg_start[0], leg_start[1]))
    if not math.isfinite(start_height):
        start_height = end_height
    corners = []
    for distance_along in np.arange(0.5 * GROUND_STEP_M, length - 0.5 * GROUND_STEP_M, GROUND_STEP_M).tolist():
        east = segment_start[0] + distance_along * math.sin(course)
        north = segment_start[1] + distance_along * math.cos(course)
        fraction = math.hypot(east - leg_start[0], north - leg_start[1]) / math.dist(
            leg_start[:2], route.positions[leg + 1, :2]
        )
        ground_altitude = float(terrain.height(east, north))
        if math.isfinite(ground_altitude):
            corners.append(
                (
                    start_distance + distance_along,
                    ground_altitude + start_height + fraction * (end_height - start_height),
                )
            )
    return corners


def _arcs_at_waypoints(
    route: Route, limits: Limits, courses: Floats, leg_lengths: Floats, turns: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return the tangent lengths, radii and return lengths of the arcs at all waypoints, m, (w,) each.

    tangent length: distance from a fly-by waypoint to the start and the end of its arc. It is shortened if a leg is too
        short.
    return length: distance from a fly-over waypoint to the point where the path joins the next leg. It is 0 if that leg
        is too short.
    """
    count = len(route.points)
    tangents, radii, return_lengths = np.zeros(count), np.zeros(count), np.zeros(count)
    for i in range(1, count - 1):
        turn = abs(float(turns[i - 1]))
        if turn < 1e-6:
            continue
        speed = float(max(route.leg_airspeeds[i - 1], route.leg_airspeeds[i]))
        radius = float(route.arc_radii[i]) or limits.turn_radius(
            float(courses[i - 1]), float(courses[i]), float(route.positions[i, 2]), speed
        )
        if not route.fly_over[i]:
            tangents[i] = tangent_length(turn, radius)
        elif math.isfinite(radius):
            radii[i], return_lengths[i] = radius, radius * (math.sin(turn) + 2.0 * math.sin(_overshoot_angle(turn)))
    is_sharp = np.concatenate([[False], np.abs(turns) > SHARPEST_FLY_BY_RAD, [False]])
    is_short = tangents[:-1] + tangents[1:] > leg_lengths
    tangents[is_sharp & (np.append(is_short, False) | np.append(False, is_short))] = 0.0
    # In this wind a turn may have no radius; use the longest arc that fits.
    tangents[1:-1] = np.minimum(tangents[1:-1], np.minimum(leg_lengths[:-1], leg_lengths[1:]))
    full_tangents = tangents.copy()
    for leg in range(len(leg_lengths)):
        required = full_tangents[leg] + full_tangents[leg + 1]
        if required > leg_lengths[leg]:
            fraction = leg_lengths[leg] / required
            tangents[leg] = min(tangents[leg], full_tangents[leg] * fraction)
            tangents[leg + 1] = min(tangents[leg + 1], full_tangents[leg + 1] * fraction)
    arc_indices = np.flatnonzero(tangents)
    radii[arc_indices] = tangents[arc_indices] / np.tan(np.abs(turns[arc_indices - 1]) / 2)
    # A leg that is too short for its return arcs has a sharp corner.
    return_lengths[:-1][return_lengths[:-1] + tangents[1:] > leg_lengths] = 0.0
    return tangents, radii, return_lengths


def _overshoot_angle(turn: float) -> float:
    """Return the angle by which a fly-over turn (rad) overshoots the next course.

    The result is the angle phi with cos phi = (1 + cos turn) / 2.
    """
    return math.acos(0.5 * (1.0 + math.cos(turn)))


def _fly_over_arcs(
    corner: Floats, course: float, turn: float, radius: float
) -> list[tuple[Floats, float, float, float]]:
    """Return the three arcs of a fly-over turn: start, course at the start, curvature and length of each.

    The start is (2,), m; the course is in rad, the curvature in 1/m, the length in m. The first two arcs turn past the
    course of the next leg, and the third leads back onto that leg. The turn past that course is split into two arcs
    because `project` is ambiguous for larger angles.

    corner: position of the waypoint, (2,) m.
    course: course of the leg to the waypoint, rad.
    turn: course change at the waypoint, rad, positive to the right.
    radius: radius of the arcs, m.
    """
    turn_sign, overshoot = math.copysign(1.0, turn), _overshoot_angle(abs(turn))
    half_angle = 0.5 * (abs(turn) + overshoot)
    arcs, arc_start, heading = [], corner, course
    for angle, arc_sign in ((half_angle, turn_sign), (half_angle, turn_sign), (overshoot, -turn_sign)):
        arcs.append((arc_start, heading, arc_sign / radius, radius * angle))
        end_course = heading + arc_sign * angle
        step = math.cos(heading) - math.cos(end_course), math.sin(end_course) - math.sin(heading)
        arc_start, heading = arc_start + arc_sign * radius * np.array(step), end_course
    return arcs


def _altitude_profile(corners: list[tuple[float, float]], limits: Limits, route: Route) -> Records:
    """Return an altitude profile as records of `NODE`: its corners, blended by parabolas.

    A parabola between two slopes takes the length that the fastest flight needs for the change of slope, but at most
    half of the distance to the next corner.

    corners: (distance along the path, altitude) pairs, m.
    """
    distances, altitudes = np.array(corners).T
    is_distinct = np.concatenate([[True], np.diff(distances) > 1e-3])
    # Of two corners at the same distance keep the second one, which is on the next leg.
    distances, altitudes = distances[is_distinct], altitudes[is_distinct]
    slopes = np.diff(altitudes) / np.diff(distances)
    next_slopes = np.concatenate([slopes, slopes[-1:]])
    slope_changes = np.concatenate([[0.0], np.diff(slopes), [0.0]])
    speed = float(route.leg_airspeeds.max()) + limits.wind.max_speed_at(route.positions[:, 2])
    half_lengths = np.abs(slope_changes) * speed**2 / (2.0 * BLEND_ACCELERATION)
    gaps = np.diff(distances)
    max_half_lengths = 0.5 * np.minimum(np.concatenate([[np.inf], gaps]), np.concatenate([gaps, [np.inf]]))
    nodes: Records = np.empty(distances.size, NODE)
    nodes["distance"], nodes["altitude"], nodes["slope"] = distances, altitudes, next_slopes
    nodes["half_length"] = np.minimum(half_lengths, max_half_lengths)
    return nodes


def waypoint_records(route: Route, mission: Mission | None = None, *, fly_over: bool = False) -> Records:
    """Return the waypoints of a route as w records of `flight.guidance.lateral_reference_laws.WAYPOINT`.

    The last waypoint has the airspeed of the leg before it.

    mission: mission of the route, which states how the loiters end; with None all loiters end after their turns.
    fly_over: True if the scenario requires fly-over at waypoints without an acceptance radius.
    """
    points = route.points
    waypoints: Records = np.zeros(len(points), WAYPOINT)
    waypoints["east"], waypoints["north"], waypoints["up"] = points["position"].T
    waypoints["turn"][1:-1] = np.abs(signed_turns(points["position"]))
    # An acceptance radius stated by the item has priority over the scenario.
    waypoints["fly_over"] = fly_over & (points["acceptance_radius"] == 0.0) & (points["arc_radius"] == 0.0)
    waypoints["acceptance"] = points["acceptance_radius"]
    items = {} if mission is None else {item.seq: item for item in mission.items}
    waypoints["pass_by"] = [pass_by_distance(items[seq]) if seq in items else 0.0 for seq in route.items.tolist()]
    waypoints["follows_terrain"] = np.isfinite(points["above_ground"])
    waypoints["above_ground"] = np.nan_to_num(points["above_ground"])
    waypoints["home_up"] = points["home_up"]
    waypoints["airspeed"] = np.append(route.leg_airspeeds, route.leg_airspeeds[-1])
    waypoints["min_ground_speed"] = np.nan_to_num(points["min_ground_speed"])
    waypoints["item"], waypoints["stop"] = points["item"], points["stop"]
    _set_circles(waypoints[1:-1], route)
    # The end condition of each loiter.
    waypoints["loiter_time"] = math.nan
    for k in np.flatnonzero(waypoints["loiter_radius"]).tolist():
        item = items.get(int(waypoints["item"][k]))
        loiter = None if item is None else stated_loiter(item)
        if loiter is not None:
            waypoints["exits_on_tangent"][k] = loiter.exits_on_tangent
            waypoints["loiter_turns"][k] = loiter.turns
            if not loiter.turns:
                waypoints["loiter_time"][k] = math.inf if loiter.endless else loiter.seconds
                waypoints["loiters_to_altitude"][k] = loiter.to_altitude
                waypoints["exits_on_course"][k] = loiter.exits_on_course
    gates = [seq for seq, item in items.items() if item.command == Command.CONDITION_GATE]
    waypoints["is_gate"] = np.isin(route.items, gates)
    waypoints["is_mission_end"][-1] = mission is not None and ends_at_plain_waypoint(route, mission)
    last_before_return = route.rtl_start
    if route.direct_landing_start is not None:
        waypoints["without_crosstrack"][route.direct_landing_start] = True
        if last_before_return is None:
            last_before_return = route.direct_landing_start - 1
    if route.rtl_loiter is not None and route.rtl_start is not None:
        return_waypoints = waypoints[route.rtl_start + 1 : route.rtl_end]
        return_waypoints["is_rtl"] = True
        names = ("centre_east", "centre_north", "up", "loiter_radius", "slope_base")
        for name, value in zip(names, route.rtl_loiter, strict=True):
            return_waypoints[name] = value
    if last_before_return is not None and last_before_return >= 0:
        # ArduPlane reads the missing position of an RTL item as 0 N, 0 E (`AP_Mission::get_next_ground_course_cd`): the
        # bearing of that place decides the turn before the RTL, and is that on which a loiter there is left.
        last_item, turn = items.get(int(route.items[last_before_return])), 0.5 * math.pi
        if last_item is not None and last_item.has_position:
            lat, lon = last_item.lat_deg, last_item.lon_deg
            # `Location::get_bearing_to`.
            bearing = math.atan2(-lon, -lat / math.cos(math.radians(0.5 * lat)))
            if last_before_return > 0:
                turn = abs(wrap(bearing - float(leg_courses(route.positions)[last_before_return - 1])))
            if stated_loiter(last_item) is not None:
                is_loiter = waypoints["stop"] == waypoints["stop"][last_before_return]
                waypoints["exit_bearing"][is_loiter] = bearing % (2.0 * math.pi) or 2.0 * math.pi
        waypoints["turn"][last_before_return] = turn
    if mission is not None:
        # The waypoint before a landing, and the waypoints of a landing sequence as PX4's `MissionBase::isLanding` says.
        flown_commands = PLACES | TAKEOFFS | LANDINGS
        flown_items = [item for item in mission.items if item.command in flown_commands and item.has_position]
        last_items = [item.seq for item, next_item in pairwise(flown_items) if next_item.command in LANDINGS]
        waypoints["precedes_landing"] = np.isin(waypoints["item"], last_items)
        first_seq = next((item.seq for item in mission.items if item.command == Command.DO_LAND_START), math.inf)
        landing_items = [item for item in flown_items if item.seq > first_seq][1:]
        plain_items = [item.seq for item in landing_items if item.command == Command.NAV_WAYPOINT]
        waypoints["ignores_altitude"] = np.isin(waypoints["item"], plain_items)
    return waypoints


def _set_circles(corners: Records, route: Route) -> None:
    """Set radius, center and altitude of the loiter at each corner of a route; radius 0 without a loiter."""
    turns, courses = signed_turns(route.positions), leg_courses(route.positions)
    corners["loiter_radius"] = np.where(np.abs(turns) < 1e-6, 0.0, np.copysign(route.arc_radii[1:-1], turns))
    # The center lies at a right angle to the course halfway through the turn.
    mid_course = courses[:-1] + 0.5 * turns
    signed_radius = corners["loiter_radius"] / np.cos(0.5 * turns)
    corners["centre_east"] = corners["east"] + signed_radius * np.cos(mid_course)
    corners["centre_north"] = corners["north"] - signed_radius * np.sin(mid_course)
    # A loiter's altitude is its item's altitude, which the last of its corners has.
    stops = route.stops[1:-1]
    for i in range(len(corners) - 2, -1, -1):
        if corners[i].loiter_radius != 0.0 and corners[i + 1].loiter_radius != 0.0 and stops[i] == stops[i + 1]:
            corners[i].up = corners[i + 1].up


def _piece_index(path: FlyByPath, distances: Floats) -> NDArray[np.intp]:
    """Return the indices of the pieces at n distances (m) along the path, (n,)."""
    return np.maximum(0, np.searchsorted(path.pieces["start"], distances, side="right") - 1)


def path_polyline(path: FlyByPath) -> tuple[Floats, NDArray[np.int64]]:
    """Return the path as a polyline: n points, (n, 3) m, and the leg of each of the n - 1 segments.

    A chord of an arc turns by at most `MAX_CHORD_TURN_RAD`. With a radius of 160 m it deviates from the arc by 0.15 m.

    >>> level = np.array([(0.0, 500.0, 0.0, 0.0), (900.0, 500.0, 0.0, 0.0)], NODE)
    >>> north = np.array([(0.0, 900.0, 0.0, 0.0, 0.0, 0.0, 0, math.inf)], PIECE)
    >>> points, legs = path_polyline(FlyByPath(north, level, 900.0))
    >>> points.tolist(), legs.tolist()
    ([[0.0, 0.0, 500.0], [0.0, 900.0, 500.0]], [0])
    """
    unsorted_distances = [0.0, path.length]
    columns = (path.pieces[name].tolist() for name in ("start", "length", "curvature", "leg_change"))
    for start, length, curvature, leg_change in zip(*columns, strict=True):
        chord_count = max(1, math.ceil(abs(curvature) * length / MAX_CHORD_TURN_RAD))
        unsorted_distances += [start + length * index / chord_count for index in range(chord_count + 1)]
        if math.isfinite(leg_change):
            unsorted_distances.append(leg_change)
    for node in path.nodes:
        unsorted_distances += [node.distance + node.half_length * fraction for fraction in (-1.0, -0.5, 0.0, 0.5, 1.0)]
    clipped_distances = np.clip(np.array(unsorted_distances), 0.0, path.length)
    distances = np.unique(np.round(clipped_distances, 6))
    point_pieces = path.pieces[_piece_index(path, distances)]
    course, distances_along = point_pieces["course"], distances - point_pieces["start"]
    is_straight = point_pieces["curvature"] == 0.0
    nonzero_curvature = np.where(is_straight, 1.0, point_pieces["curvature"])
    end_course = course + point_pieces["curvature"] * distances_along
    east = np.where(
        is_straight, distances_along * np.sin(course), (np.cos(course) - np.cos(end_course)) / nonzero_curvature
    )
    north = np.where(
        is_straight, distances_along * np.cos(course), (np.sin(end_course) - np.sin(course)) / nonzero_curvature
    )
    up = [profile_at(path.nodes, float(s))[0] for s in distances]
    points = np.column_stack([point_pieces["east"] + east, point_pieces["north"] + north, up])
    midpoints = 0.5 * (distances[1:] + distances[:-1])
    pieces = path.pieces[_piece_index(path, midpoints)]
    return points, (pieces["leg"] + (midpoints > pieces["leg_change"])).astype(np.int64)


def point_on_piece(piece: Record, distance_along: float) -> tuple[float, float]:
    """Return east and north (m) on a piece, ``distance_along`` m from its start.

    piece: a record of `flight.guidance.path.PIECE`.

    >>> quarter = np.array([(0.0, 157.0, 0.0, 0.0, 0.0, 0.01, 0, math.inf)], PIECE)[0]
    >>> east, north = point_on_piece(quarter, 50.0 * math.pi)
    >>> round(float(east), 6), round(float(north), 6)
    (100.0, 100.0)
    """
    course, curvature = piece.course, piece.curvature
    if curvature == 0.0:
        return piece.east + distance_along * math.sin(course), piece.north + distance_along * math.cos(course)
    end_course = course + curvature * distance_along
    return (
        piece.east + (math.cos(course) - math.cos(end_course)) / curvature,
        piece.north + (math.sin(end_course) - math.sin(course)) / curvature,
    )
