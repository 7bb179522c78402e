"""ArduPlane's navigation: the L1 law along a mission's legs, when it turns to the next one, loiters and returns.

The L1 law is that of Park, Deyst and How ("A New Nonlinear Guidance Logic for Trajectory Tracking", AIAA 2004-4900) as
ArduPlane's documentation gives its parameters (ardupilot.org, Plane, "Navigation Tuning"), with the formulas of
`flight.guidance.lateral_reference_laws`.  ArduPlane navigates ten times a second: what it demands stays until then.

Of loiters, facts of ArduPlane's `Plane::update_loiter`, `verify_loiter_*` and `ModeLoiter::isHeadingLinedUp`: it
follows the line to a circle's middle until it is within three radii of that, then flies at the middle until the circle
asks for the sharper turn, and around.  Turns, seconds and heights count from there on.  Once they are reached it goes
on around until it heads for what follows, within ten degrees and ten more for each circle of waiting; the next leg's
line begins in the circle's middle, or where it is, if the item asks for that.  Circles grow with height as the square
of true by equivalent airspeed (`AP_L1_Control::loiter_radius`).
"""

import math

from aircraft.envelope import GRAVITY
from flight.autopilots.arduplane.parameters import CLIMB_BEFORE_TURN
from flight.guidance.equivalent_airspeed import true_by_equivalent
from flight.guidance.lateral_reference_laws import l1_acceleration, l1_angles, l1_integrate, l1_length
from world.geometry import wrap
from world.kernels import Record, Records, compiled, inner

# An acceptance is sent as whole metres in a byte.
MAX_ACCEPTANCE = 255.0
# A circle's line is followed to so many of its radii from its middle.
_FAR = 3.0
# A loiter to a height has reached it within this, m; one that came no nearer than that in so many circles leaves too.
REACHED_HEIGHT, _STUCK_CIRCLES = 5.0, 3.0
# It heads for what follows within this, rad, and so much more for each circle that it has waited.
_LINED_UP, _WIDENS = math.radians(10.0), math.radians(10.0)
# A return leaves its circle for the landing sequence within so much of the height there, m.
JOINS_WITHIN = 10.0
# Nothing within so many radii of the middle can be headed for from the circle.
_WITHIN = 1.05


@compiled
def turn_distance(
    acceptance: float, turn: float, radius: float, length: float, air_density_factor: float
) -> float:  # pragma: no cover - compiled
    """How far before a waypoint ArduPlane turns to the next leg, m; 0 where it flies on to the waypoint.

    acceptance: that the mission states, m, 0 for none: it is taken as it is, in whole metres.
    turn: rad, positive.  radius: WP_RADIUS, m.  length: of L1, m.
    air_density_factor: true by equivalent airspeed; with height a turn takes its square more room.
    """
    stated = math.floor(min(MAX_ACCEPTANCE, acceptance))
    if stated > 0.0:
        return stated
    right_angle: float = min(radius * air_density_factor * air_density_factor, length)
    return right_angle * min(1.0, turn / (0.5 * math.pi))


@inner
def past_line(
    estimated: Record, from_east: float, from_north: float, east: float, north: float
) -> bool:  # pragma: no cover - compiled
    """Whether the line across the leg at its end (east, north) is passed; a leg without length is."""
    leg_e, leg_n = east - from_east, north - from_north
    ahead_e, ahead_n = east - estimated.east, north - estimated.north
    passed: bool = ahead_e * leg_e + ahead_n * leg_n <= 0.0
    return passed


@inner
def navigate_legs(
    estimated: Record,
    waypoints: Records,
    parameters: Record,
    own: Record,
    air_density_factor: float,
    dt: float,
) -> None:  # pragma: no cover - compiled
    """Demand a side acceleration for the present leg, and then turn to the next one if its time has come.

    estimated: a record of `flight.guidance.navigation_error.MOTION`.
    waypoints: (w,) of `flight.guidance.lateral_reference_laws.WAYPOINT`.
    parameters: of `flight.autopilots.arduplane.parameters.ARDUPILOT_PARAMETERS`.
    own: of `flight.autopilots.arduplane.law.ARDUPILOT_MEMORY`.
    air_density_factor: true by equivalent airspeed.
    dt: s since the last time.
    """
    b = waypoints[own.leg + 1]
    speed = max(0.1, math.hypot(estimated.velocity_east, estimated.velocity_north))
    length = l1_length(speed, parameters.navl1_period, parameters.navl1_damping)
    if b.returns:
        # A return is one leg; it goes on until the flight ends, or to the mission's landing sequence.
        _return(estimated, b, parameters, own, air_density_factor)
        _join_landing(estimated, waypoints, b, own)
        return
    if b.circle != 0.0:
        _loiter(estimated, waypoints, b, parameters, own, length, speed, air_density_factor, dt)
        return
    own.on_circle = False
    _follow_line(estimated, b.east, b.north, parameters, own, length, speed, dt, b.straight)
    turn = _turn_after(waypoints, b, own)
    if own.leg + 2 < waypoints.shape[0] and _reached(estimated, b, turn, parameters, own, length, air_density_factor):
        _begin_leg(estimated, waypoints, own.leg + 1, own)


@inner
def target_of(b: Record) -> tuple[float, float]:  # pragma: no cover - compiled
    """East and north (m) of the place that a waypoint of the route belongs to: a loiter's is its middle."""
    return (b.centre_east, b.centre_north) if b.circle != 0.0 and not b.returns else (b.east, b.north)


@inner
def _follow_line(
    estimated: Record, east: float, north: float, parameters: Record, own: Record, length: float, speed: float,
    dt: float, straight: bool,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """Demand the side acceleration along the line from where the leg began to its end, m.

    straight: whether the line is that from the aircraft itself (`Plane::verify_nav_wp` without crosstrack).
    """
    from_e, from_n = (estimated.east, estimated.north) if straight else (own.from_east, own.from_north)
    angle, aim = l1_angles(estimated, from_e, from_n, east, north, length)
    own.cross_track_sum = l1_integrate(aim, own.cross_track_sum, parameters.navl1_xtrack_i, dt)
    if not math.isnan(aim):
        angle += aim + own.cross_track_sum
    own.side_acceleration = l1_acceleration(angle, speed, length, parameters.navl1_damping)


@inner
def _turn_after(waypoints: Records, b: Record, own: Record) -> float:  # pragma: no cover - compiled
    """The turn at b that ArduPlane reckons with, rad, positive: beside a loiter that from or to its middle."""
    turn: float = b.turn
    if own.leg + 2 >= waypoints.shape[0]:
        return turn
    after = waypoints[own.leg + 2]
    if after.returns or (waypoints[own.leg].circle == 0.0 and after.circle == 0.0):
        return turn
    east, north = target_of(after)
    onward = math.atan2(east - b.east, north - b.north)
    return abs(wrap(onward - math.atan2(b.east - own.from_east, b.north - own.from_north)))


@inner
def _begin_leg(estimated: Record, waypoints: Records, leg: int, own: Record) -> None:  # pragma: no cover - compiled
    """Turn to a leg: its line leads from its waypoint to the next, or from here where that is passed already."""
    a, b = waypoints[leg], waypoints[leg + 1]
    own.leg = leg
    # The next circle is another one, though a return's height is asked for before it is flown to.
    own.on_circle = False
    own.loitering, own.over, own.at_height = False, False, False
    own.stayed, own.circled, own.waited, own.next_look = 0.0, 0.0, 0.0, 0.0
    own.from_up = a.up
    own.from_east, own.from_north = target_of(a)
    if a.circle != 0.0 and a.leaves_on_tangent:
        own.from_east, own.from_north, own.from_up = estimated.east, estimated.north, estimated.up
    east, north = target_of(b)
    if not b.returns and past_line(estimated, own.from_east, own.from_north, east, north):
        own.from_east, own.from_north, own.from_up = estimated.east, estimated.north, estimated.up


@inner
def _reached(
    estimated: Record, b: Record, turn: float, parameters: Record, own: Record, length: float,
    air_density_factor: float,
) -> bool:  # pragma: no cover - compiled  # fmt: skip
    """Whether the leg to b, where the route turns (rad), is over: near enough to b, or past the line across it."""
    distance = math.hypot(b.east - estimated.east, b.north - estimated.north)
    passed = past_line(estimated, own.from_east, own.from_north, b.east, b.north)
    if parameters.wp_max_radius > 0.0 and distance > parameters.wp_max_radius:
        if passed:
            # Passed too far away: it turns back to the waypoint.
            own.from_east, own.from_north = estimated.east, estimated.north
        return False
    if b.fly_over:
        return passed
    reach = turn_distance(b.acceptance, turn, parameters.wp_radius, length, air_density_factor)
    return passed or distance <= reach


@inner
def _loiter(
    estimated: Record, waypoints: Records, b: Record, parameters: Record, own: Record, length: float, speed: float,
    air_density_factor: float, dt: float,
) -> None:  # pragma: no cover - compiled  # fmt: skip
    """Fly to a loiter's circle and around it until it is over and what follows lies ahead.

    b: a corner of the route that stands for it; its circle has the radius at its height.
    """
    thinner = air_density_factor / true_by_equivalent(b.up)
    radius = abs(b.circle) * thinner * thinner
    away = math.hypot(b.centre_east - estimated.east, b.centre_north - estimated.north)
    if not own.loitering and away > _FAR * radius:
        own.on_circle = False
        _follow_line(estimated, b.centre_east, b.centre_north, parameters, own, length, speed, dt, b.straight)
        return
    own.side_acceleration = _around(estimated, b, radius, parameters, own, length, speed)
    _count(estimated, b, own, dt)
    if not own.over and _is_over(estimated, b, own):
        own.over, own.waited = True, 0.0
    after = own.leg + 2
    while after < waypoints.shape[0] and waypoints[after].stop == b.stop:
        after += 1
    if after >= waypoints.shape[0]:
        return
    if own.over and (own.on_circle or b.turns == 0.0) and _heads_for(estimated, waypoints[after], b, radius, own):
        own.left_for = after - 1
        _begin_leg(estimated, waypoints, after - 1, own)


@inner
def _count(estimated: Record, b: Record, own: Record, dt: float) -> None:  # pragma: no cover - compiled
    """Count the seconds and the way around a loiter, once its circle is followed."""
    bearing = math.atan2(estimated.east - b.centre_east, estimated.north - b.centre_north)
    if own.loitering:
        own.stayed += dt
        turned = wrap(bearing - own.bearing) * math.copysign(1.0, b.circle)
        own.circled += turned
        own.waited += turned
    elif own.on_circle:
        own.loitering = True
        own.next_look, own.up_before = _STUCK_CIRCLES * 2.0 * math.pi, estimated.up
    own.bearing = bearing
    if own.on_circle and abs(estimated.up - b.up) < REACHED_HEIGHT:
        own.at_height = True


@inner
def _is_over(estimated: Record, b: Record, own: Record) -> bool:  # pragma: no cover - compiled
    """Whether what a loiter's item asks for is done: its turns, its seconds or its height."""
    if not own.loitering:
        return False
    if b.to_height:
        if not own.at_height and own.circled >= own.next_look:
            own.at_height = abs(estimated.up - own.up_before) < REACHED_HEIGHT
            own.next_look, own.up_before = own.next_look + _STUCK_CIRCLES * 2.0 * math.pi, estimated.up
        done: bool = own.at_height
        return done
    if math.isnan(b.stays):
        around: bool = own.circled > b.turns * 2.0 * math.pi
        return around
    waited: bool = own.stayed > b.stays
    return waited


@inner
def _heads_for(
    estimated: Record, onward: Record, b: Record, radius: float, own: Record
) -> bool:  # pragma: no cover - compiled
    """Whether the course leads to the place after a loiter b; none leads to one within its circle (radius, m)."""
    east, north = (onward.centre_east, onward.centre_north) if onward.returns else target_of(onward)
    if math.hypot(east - b.centre_east, north - b.centre_north) < _WITHIN * radius:
        return True
    bearing = math.atan2(east - estimated.east, north - estimated.north)
    off = abs(wrap(bearing - math.atan2(estimated.velocity_east, estimated.velocity_north)))
    lined_up: bool = off <= _LINED_UP + _WIDENS * math.floor(abs(own.waited) / (2.0 * math.pi))
    return lined_up


@inner
def _return(
    estimated: Record, b: Record, parameters: Record, own: Record, air_density_factor: float
) -> None:  # pragma: no cover - compiled
    """Demand the side acceleration of a return to launch (`ModeRTL::update`, ArduPlane/mode_rtl.cpp).

    It turns to the middle of its circle at once, whatever leg it was on; the circle grows with height as the square of
    true by equivalent airspeed (`AP_L1_Control::loiter_radius`).  Until it has climbed what it has to, its bank is
    LEVEL_ROLL_LIMIT, and only then its slope begins.
    """
    if not own.returning:
        own.returning = True
        own.from_east, own.from_north, own.from_up = estimated.east, estimated.north, estimated.up
    speed = max(0.1, math.hypot(estimated.velocity_east, estimated.velocity_north))
    length = l1_length(speed, parameters.navl1_period, parameters.navl1_damping)
    radius = abs(b.circle) * air_density_factor * air_density_factor
    own.side_acceleration = _around(estimated, b, radius, parameters, own, length, speed)
    if own.climbed:
        return
    if int(parameters.flight_options) & CLIMB_BEFORE_TURN:
        own.climbed = estimated.up > b.up
    else:
        own.climbed = parameters.rtl_climb_min <= 0.0 or estimated.up - own.from_up > parameters.rtl_climb_min
    if own.climbed:
        own.from_east, own.from_north, own.from_up = estimated.east, estimated.north, estimated.up
        return
    most = GRAVITY * math.tan(parameters.level_roll_limit)
    own.side_acceleration = min(most, max(-most, own.side_acceleration))


@inner
def _join_landing(estimated: Record, waypoints: Records, b: Record, own: Record) -> None:  # pragma: no cover - compiled
    """Leave a return's circle for the landing sequence, where one follows, as soon as it is followed near its height.

    `ModeRTL::navigate` of ArduPlane 4.6 with RTL_AUTOLAND 1.  The leg begins where the aircraft is.
    """
    after = own.leg + 2
    while after < waypoints.shape[0] and waypoints[after].returns:
        after += 1
    if after >= waypoints.shape[0] or not own.on_circle or abs(estimated.up - b.up) >= JOINS_WITHIN:
        return
    own.left_for = after - 1
    own.returning, own.climbed = False, False
    _begin_leg(estimated, waypoints, after - 1, own)
    own.from_east, own.from_north, own.from_up = estimated.east, estimated.north, estimated.up


@inner
def _around(
    estimated: Record, b: Record, radius: float, parameters: Record, own: Record, length: float, speed: float
) -> float:  # pragma: no cover - compiled
    """Side acceleration for a loiter: straight to its centre until its circle asks for more, then around it, m/s^2."""
    side = math.copysign(1.0, b.circle)
    out_e, out_n = estimated.east - b.centre_east, estimated.north - b.centre_north
    distance = max(0.1, math.hypot(out_e, out_n))
    course = math.atan2(estimated.velocity_east, estimated.velocity_north)
    inward = wrap(course - math.atan2(-out_e, -out_n))
    capture = l1_acceleration(inward, speed, length, parameters.navl1_damping)
    # Over the ground: outwards, and around the circle in its direction.
    outwards = -speed * math.cos(inward)
    around = -side * speed * math.sin(inward)
    frequency = 2.0 * math.pi / parameters.navl1_period
    error = distance - radius
    back = frequency * (frequency * error + 2.0 * parameters.navl1_damping * outwards)
    if outwards > 0.0 and around < 0.0:
        # Flying out and the wrong way round, it turns the way that the circle goes.
        back = max(back, 0.0)
    circling = side * (back + around * around / max(0.5 * radius, distance))
    own.on_circle = not (error > 0.0 and side * capture < side * circling)
    demanded: float = circling if own.on_circle else capture
    return demanded
