"""PX4's navigator: which waypoint is flown to, when the next one is, and the height that is asked for on the way.

Facts of PX4's `src/modules/navigator/mission_block.cpp` (`is_mission_item_reached_or_completed`) and of
`src/modules/fw_mode_manager` (to 1.16 `fw_pos_control`): a waypoint is reached within a radius of it or past the plane
across the leg at it, and only within NAV_FW_ALT_RAD of its height; an aircraft that came there too high or too low
circles at the waypoint until it is.  The radius is NAV_ACC_RAD, and up to 1.16 guidance's own switch distance where
that is more; an item's own radius (its second parameter) is not read for fixed wing.

A loiter is flown around its middle from the beginning of its leg (`control_auto_loiter`), which from afar is straight
at the middle.  It is reached, once, within that radius of its rim and near its height; then its time counts, and it is
left at once for the line from its middle to the next waypoint: on the course there, or for a line that begins at the
tangent's place on the rim, only where its item asks for that.  LOITER_TIME asks for its height all along; LOITER_TO_ALT
for the height at which its leg began until its rim is reached, and for its own from then on.

At a gate (CONDITION_GATE) the aircraft flies to the waypoint after it, and what the mission orders between them, a
change of speed, counts from when it crosses the plane through the gate.  From when the last waypoint is reached, PX4
circles about it with NAV_LOITER_RAD.
"""

import math

from flight.autopilots.px4.lateral import follow_circle, follow_leg, switch_distance
from world.geometry import wrap
from world.kernels import Record, Records, inner

# From a waypoint reached to the turn, s: the navigator's loop, its message to the position controller and that one's
# turn.  In 33 waypoints of the kept flights it was 0.13 s on average, 0.02 to 0.26: PX4's own, for 1.17 and 1.18, which
# turn by the same rule, did so up to 5.9 m apart at the same waypoints.  No law without that is nearer than 3 m at all.
SWITCH_DELAY = 0.13
# A loiter that is left on the course to what follows is left within this of it, rad (MIS_YAW_ERR), but not where that
# lies within so many radii of its middle.
COURSE_ACCEPTANCE = math.radians(12.0)
_TOO_NEAR_FOR_COURSE = 1.05


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
    target = flown_to(waypoints, own)
    b = waypoints[target]
    if target > own.leg + 1 and _past_gate(estimated, waypoints[own.leg + 1], b):
        own.leg += 1
    if b.returns:
        # A return goes on until the flight ends, in one leg.
        _return(estimated, b, wind_east, wind_north, airspeed_demand, parameters, own)
        return
    if b.circle != 0.0:
        _loiter(estimated, waypoints, b, wind_east, wind_north, airspeed_demand, parameters, own, dt)
    else:
        _follow_plain_leg(estimated, waypoints, target, wind_east, wind_north, airspeed_demand, parameters, own, dt)


@inner
def flown_to(waypoints: Records, own: Record) -> int:  # pragma: no cover - compiled
    """Number of the waypoint that is flown to: gates are passed on the way there, and are nothing to fly to."""
    target: int = own.leg + 1
    while waypoints[target].gate:
        target += 1
    return target


@inner
def _past_gate(estimated: Record, gate: Record, b: Record) -> bool:  # pragma: no cover - compiled
    """Whether the plane through a gate is crossed, at right angles to the way from it to the waypoint b after it."""
    onward_east, onward_north = b.east - gate.east, b.north - gate.north
    ahead = (estimated.east - gate.east) * onward_east + (estimated.north - gate.north) * onward_north
    past: bool = ahead >= 0.0
    return past


@inner
def _follow_plain_leg(
    estimated: Record, waypoints: Records, target: int, wind_east: float, wind_north: float, airspeed_demand: float,
    parameters: Record, own: Record, dt: float,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """Follow the leg to a waypoint, and circle at it where the aircraft came there too high or too low.

    A mission's last one is circled about from when it is reached.
    """
    b = waypoints[target]
    speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    early, radius = switch_distance(speed, parameters), parameters.loiter_radius
    distance = math.hypot(b.east - estimated.east, b.north - estimated.north)
    own.nearest = min(own.nearest, distance)
    high_or_low = abs(estimated.up - b.up) > parameters.height_acceptance
    # Once begun, the circle is not left for being wide.
    own.circling = own.finished or (high_or_low and (own.circling or distance < early))
    if own.circling:
        follow_circle(estimated, b.east, b.north, radius, wind_east, wind_north, airspeed_demand, parameters, own)
        own.height_asked = b.up
    else:
        follow_leg(estimated, b.east, b.north, wind_east, wind_north, airspeed_demand, parameters, own)
        own.height_asked = leg_height(b.east, b.north, b.up, max(early, abs(radius)), own)
    is_end = target + 1 >= waypoints.shape[0]
    if is_end and not b.ends:
        return
    near = distance <= reach_radius(speed, parameters) or past_waypoint(estimated, b, own)
    own.reached_for = own.reached_for + dt if own.reached_for > 0.0 or (near and not high_or_low) else 0.0
    if own.reached_for <= SWITCH_DELAY:
        return
    if is_end:
        own.finished = True
    else:
        begin_leg(estimated, waypoints, target, own)


@inner
def _loiter(
    estimated: Record, waypoints: Records, b: Record, wind_east: float, wind_north: float, airspeed_demand: float,
    parameters: Record, own: Record, dt: float,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """Fly to a loiter's circle and around it until it is over.  b: a corner of the route that stands for it."""
    speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    distance = math.hypot(b.centre_east - estimated.east, b.centre_north - estimated.north)
    own.circling = True
    follow_circle(
        estimated, b.centre_east, b.centre_north, b.circle, wind_east, wind_north, airspeed_demand, parameters, own
    )
    on_rim = distance <= abs(b.circle) + reach_radius(speed, parameters)
    if b.to_height and not own.at_rim:
        own.height_asked = own.begun_up
        own.at_rim = on_rim and abs(estimated.up - own.begun_up) <= parameters.height_acceptance
        return
    own.height_asked = b.up
    at_height = abs(estimated.up - b.up) <= parameters.height_acceptance
    own.reached_for = own.reached_for + dt if own.reached_for > 0.0 or (on_rim and at_height) else 0.0
    after = own.leg + 2
    if math.isnan(b.stays):
        # So many turns, which PX4 does not fly: as far around as the route is drawn.
        if after < waypoints.shape[0] and on_rim and past_corner(estimated, b):
            begin_leg(estimated, waypoints, own.leg + 1, own)
        return
    while after < waypoints.shape[0] and waypoints[after].stop == b.stop:
        after += 1
    if after >= waypoints.shape[0] or own.reached_for <= b.stays + SWITCH_DELAY:
        return
    if not b.leaves_on_course or _heads_for(estimated, waypoints[after], b):
        begin_leg(estimated, waypoints, after - 1, own)


@inner
def is_last(waypoints: Records, own: Record) -> bool:  # pragma: no cover - compiled
    """Whether nothing comes after what is flown to now, a loiter's own corners left aside."""
    target = flown_to(waypoints, own)
    b = waypoints[target]
    last: bool = target + 1 >= waypoints.shape[0] or (b.circle != 0.0 and waypoints[-1].stop == b.stop)
    return last


@inner
def _target(b: Record) -> tuple[float, float]:  # pragma: no cover - compiled
    """East and north (m) of the setpoint that a waypoint of the route belongs to: a loiter's is its middle."""
    return (b.centre_east, b.centre_north) if b.circle != 0.0 else (b.east, b.north)


@inner
def _heads_for(estimated: Record, onward: Record, b: Record) -> bool:  # pragma: no cover - compiled
    """Whether the course leads to the setpoint after a loiter b; so close to its middle none does, and none is asked.

    onward: the waypoint after it.
    """
    east, north = _target(onward)
    if math.hypot(east - b.centre_east, north - b.centre_north) <= _TOO_NEAR_FOR_COURSE * abs(b.circle):
        return True
    bearing = math.atan2(east - estimated.east, north - estimated.north)
    return abs(wrap(bearing - math.atan2(estimated.velocity_east, estimated.velocity_north))) < COURSE_ACCEPTANCE


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
            estimated, own.from_east, own.from_north, parameters.loiter_radius, wind_east, wind_north,
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
def begin_leg(estimated: Record, waypoints: Records, leg: int, own: Record) -> None:  # pragma: no cover - compiled
    """Turn to a leg: its line goes through both waypoints, and after a loiter it begins in the loiter's middle.

    After one of so many turns, which PX4 does not fly, it begins where that is left.
    """
    a, b = waypoints[leg], waypoints[leg + 1]
    own.leg = leg
    own.from_east, own.from_north = _target(a)
    own.from_up = a.up
    if a.circle != 0.0 and math.isnan(a.stays):
        own.from_east, own.from_north = estimated.east, estimated.north
    if a.circle != 0.0 and a.leaves_on_tangent and not math.isnan(a.stays):
        east, north = _target(b)
        bearing = math.atan2(east - a.centre_east, north - a.centre_north)
        share = abs(a.circle) / max(1e-3, math.hypot(east - a.centre_east, north - a.centre_north))
        out = bearing - math.copysign(math.acos(min(1.0, share)), a.circle)
        own.from_east += abs(a.circle) * math.sin(out)
        own.from_north += abs(a.circle) * math.cos(out)
    if not (a.circle != 0.0 and a.stop == b.stop):
        own.circling, own.at_rim, own.begun_up = False, False, estimated.up
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
