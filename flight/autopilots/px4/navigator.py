"""PX4's navigator: which waypoint is flown to, when the next one is, and the height that is asked for on the way.

Facts of PX4's `src/modules/navigator/mission_block.cpp` (`is_mission_item_reached_or_completed`) and of
`src/modules/fw_mode_manager` (to 1.16 `fw_pos_control`): a waypoint is reached within a radius of it or past the plane
across the leg at it, and only within NAV_FW_ALT_RAD of its height; an aircraft that is there too high or too low
circles at the waypoint until it is.  The radius is NAV_ACC_RAD, and up to 1.16 guidance's own switch distance where
that is more; an item's own radius (its second parameter) is not read for fixed wing.
"""

import math

from flight.autopilots.px4.lateral import follow_circle, follow_leg, switch_distance
from world.geometry import wrap
from world.kernels import Record, Records, inner

# From a waypoint reached to the turn, s: the navigator's loop, its message to the position controller and that one's
# turn.  In 36 waypoints of the kept flights it was 0.1 s on average (0 to 0.3), at 1.16 as at 1.17.
SWITCH_DELAY = 0.1


@inner
def reach_radius(ground_speed: float, parameters: Record) -> float:  # pragma: no cover - compiled
    """How near (m) to a waypoint it counts as reached."""
    radius: float = parameters.acceptance
    if parameters.anticipates:
        radius = max(radius, switch_distance(ground_speed, parameters))
    return radius


@inner
def past_waypoint(estimated: Record, b: Record, own: Record) -> bool:  # pragma: no cover - compiled
    """Whether the plane across the leg at its end b is passed; there is none for a leg without length."""
    leg_east, leg_north = b.east - own.from_east, b.north - own.from_north
    ahead = (estimated.east - b.east) * leg_east + (estimated.north - b.north) * leg_north
    past: bool = leg_east * leg_east + leg_north * leg_north > 1e-6 and ahead > 0.0
    return past


@inner
def navigate(
    estimated: Record,
    waypoints: Records,
    wind_east: float,
    wind_north: float,
    airspeed_demand: float,
    parameters: Record,
    own: Record,
    dt: float,
) -> None:  # pragma: no cover - compiled
    """Follow the present leg, demand its height, and turn to the next one if its time has come.

    estimated: a record of `flight.guidance.navigation_error.MOTION`.
    waypoints: (w,) of `flight.guidance.lateral_reference_laws.WAYPOINT`.
    wind: the way the air moves, m/s.  airspeed_demand: m/s.
    parameters: of `flight.autopilots.px4.parameters.PX4_PARAMETERS`.
    own: of `flight.autopilots.px4.law.PX4_MEMORY`.  dt: s.
    """
    b = waypoints[own.leg + 1]
    if b.returns:
        # A return goes on until the flight ends, in one leg.
        _return(estimated, b, wind_east, wind_north, airspeed_demand, parameters, own)
        return
    speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    early = switch_distance(speed, parameters)
    circle = b.circle
    middle_east, middle_north = b.east, b.north
    if circle != 0.0:
        middle_east, middle_north = b.centre_east, b.centre_north
    radius = circle if circle != 0.0 else parameters.loiter_radius
    distance = math.hypot(middle_east - estimated.east, middle_north - estimated.north)
    own.nearest = min(own.nearest, distance)
    high_or_low = abs(estimated.up - b.up) > parameters.height_acceptance
    last = own.leg + 2 >= waypoints.shape[0]
    if circle != 0.0:
        # To the circle along the line to its middle, then around it.
        own.circling = own.circling or distance < abs(circle) + early
    else:
        # At the waypoint, and too high or too low for it.
        own.circling = distance < early and high_or_low
    if own.circling:
        follow_circle(
            estimated, middle_east, middle_north, radius, wind_east, wind_north, airspeed_demand, parameters, own
        )
        own.height_asked = b.up
    else:
        follow_leg(estimated, middle_east, middle_north, wind_east, wind_north, airspeed_demand, parameters, own)
        own.height_asked = leg_height(middle_east, middle_north, b.up, max(early, abs(radius)), own)
    if last:
        return
    if circle != 0.0:
        reached = own.circling and distance < abs(circle) + parameters.acceptance and past_corner(estimated, b)
    else:
        near = distance <= reach_radius(speed, parameters) or past_waypoint(estimated, b, own)
        reached = near and not high_or_low
    own.reached_for = own.reached_for + dt if reached or own.reached_for > 0.0 else 0.0
    if own.reached_for > SWITCH_DELAY or (reached and circle != 0.0):
        begin_leg(estimated, waypoints, own)


@inner
def _return(
    estimated: Record, b: Record, wind_east: float, wind_north: float, airspeed_demand: float, parameters: Record,
    own: Record,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """Return: climb in a circle on the spot if need be, fly straight to the target at that height, come down there.

    Facts of PX4's `src/modules/navigator/rtl_direct.cpp`; it never sinks before it is over its target.
    """
    if not own.returning:
        own.returning, own.circling = True, False
        own.from_east, own.from_north, own.from_up = estimated.east, estimated.north, estimated.up
    height = max(own.from_up, b.up)
    if not own.climbed:
        own.climbed = estimated.up >= height - parameters.height_acceptance
        if own.climbed:
            own.from_east, own.from_north = estimated.east, estimated.north
    if not own.climbed:
        own.height_asked = height
        follow_circle(
            estimated, own.from_east, own.from_north, parameters.return_radius, wind_east, wind_north,
            airspeed_demand, parameters, own,
        )  # fmt: skip
        return
    speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    distance = math.hypot(b.centre_east - estimated.east, b.centre_north - estimated.north)
    own.circling = own.circling or distance < abs(b.circle) + switch_distance(speed, parameters)
    own.height_asked = b.up if own.circling else height
    if own.circling:
        follow_circle(
            estimated, b.centre_east, b.centre_north, b.circle, wind_east, wind_north, airspeed_demand, parameters, own
        )
    else:
        follow_leg(estimated, b.centre_east, b.centre_north, wind_east, wind_north, airspeed_demand, parameters, own)


@inner
def begin_leg(estimated: Record, waypoints: Records, own: Record) -> None:  # pragma: no cover - compiled
    """Turn to the next leg: its line goes through both waypoints; after a loiter it begins where that is left."""
    own.leg += 1
    a, b = waypoints[own.leg], waypoints[own.leg + 1]
    own.from_east, own.from_north, own.from_up = a.east, a.north, a.up
    same_circle = a.circle != 0.0 and b.circle != 0.0 and a.centre_east == b.centre_east
    if a.circle != 0.0:
        own.from_east, own.from_north = estimated.east, estimated.north
    own.circling = own.circling and same_circle
    own.reached_for = 0.0
    own.nearest = math.inf


@inner
def past_corner(estimated: Record, b: Record) -> bool:  # pragma: no cover - compiled
    """Whether the aircraft on a circle has passed the corner of the route that stands for this part of it."""
    corner = math.atan2(b.east - b.centre_east, b.north - b.centre_north)
    here = math.atan2(estimated.east - b.centre_east, estimated.north - b.centre_north)
    turned = wrap(here - corner) * math.copysign(1.0, b.circle)
    return 0.0 <= turned < 0.5 * math.pi


@inner
def leg_height(
    end_east: float, end_north: float, end_up: float, early: float, own: Record
) -> float:  # pragma: no cover - compiled
    """Height that a leg asks for where the aircraft is, m: a first-order hold that is done ``early`` m before its end.

    The slope goes by the smallest distance to the end that was reached on this leg, across the ground; a leg no longer
    than ``early`` is a step.
    """
    length = math.hypot(end_east - own.from_east, end_north - own.from_north)
    nearest = min(own.nearest, length)
    if length <= early or nearest <= early:
        return end_up
    asked: float = own.from_up + (end_up - own.from_up) * (length - nearest) / (length - early)
    return asked
