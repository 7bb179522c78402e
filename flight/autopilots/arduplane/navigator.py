"""Navigate as ArduPlane does, with L1 guidance along legs, changes of leg, loiters, and RTL.

L1 guidance follows Park, Deyst and How ("A New Nonlinear Guidance Logic for Trajectory Tracking", AIAA 2004-4900) with
the parameters of ArduPlane's documentation (ardupilot.org, Plane, "Navigation Tuning") and the formulas of
`flight.guidance.lateral_reference_laws`.  ArduPlane navigates ten times a second and holds its demands in between.

Loiters follow ArduPlane's `Plane::update_loiter`, `verify_loiter_*` and `ModeLoiter::isHeadingLinedUp`.  The aircraft
follows the line to the center of the loiter until it is within three radii, then steers to the center until the loiter
demands the sharper turn, and then flies around.  Turns, time and altitude are measured from there on.  Once they are
done, it keeps loitering until it heads for what follows, within ten degrees plus ten for each lap of waiting.  The
next leg's line begins in the loiter's center, or at the aircraft if the item says so.  The radius grows with altitude
as the square of the ratio of true to equivalent airspeed (`AP_L1_Control::loiter_radius`).
"""

import math

from aircraft.envelope import GRAVITY
from flight.autopilots.arduplane.parameters import CLIMB_BEFORE_TURN
from flight.guidance.equivalent_airspeed import true_by_equivalent
from flight.guidance.lateral_reference_laws import l1_acceleration, l1_angles, l1_integrate, l1_length
from world.geometry import wrap
from world.kernels import Record, Records, compiled, inner

# Upper limit of an acceptance radius, m: it is sent as whole metres in a byte.
MAX_ACCEPTANCE_M = 255.0
# Distance from the center, in radii, up to which the line to a loiter is followed.
_APPROACH_LINE_RADII_RATIO = 3.0
# Altitude tolerance at which a loiter to an altitude is done, m.
LOITER_ALTITUDE_TOLERANCE_M = 5.0
# A loiter to an altitude is also done when the altitude changed by less than that tolerance in this many laps.
_ALTITUDE_CHECK_INTERVAL_LAPS = 3.0
# Heading tolerance for leaving a loiter towards what follows, rad ...
_EXIT_HEADING_TOLERANCE_RAD = math.radians(10.0)
# ... and its growth for each lap of waiting, rad.
_EXIT_HEADING_GROWTH_RAD = math.radians(10.0)
# Altitude tolerance for leaving the RTL loiter to join the landing sequence, m.
LANDING_JOIN_ALTITUDE_TOLERANCE_M = 10.0
# A place closer to the center than this, in radii, cannot be headed for from the loiter: no heading is awaited.
_MIN_EXIT_DISTANCE_RATIO = 1.05


@compiled
def turn_distance(
    acceptance: float, turn: float, radius: float, l1_distance: float, air_density_factor: float
) -> float:
    """Return the distance before a waypoint at which ArduPlane turns to the next leg, m; 0 if it flies to the waypoint.

    acceptance: acceptance radius that the mission states, in whole metres; 0 if it states none.
    turn: rad, positive.
    radius: WP_RADIUS, m.
    l1_distance: m.
    air_density_factor: ratio of true to equivalent airspeed; the distance for a turn grows as its square.
    """
    acceptance_m = math.floor(min(MAX_ACCEPTANCE_M, acceptance))
    if acceptance_m > 0.0:
        return acceptance_m
    right_angle: float = min(radius * air_density_factor * air_density_factor, l1_distance)
    return right_angle * min(1.0, turn / (0.5 * math.pi))


@inner
def past_line(estimated: Record, from_east: float, from_north: float, east: float, north: float) -> bool:
    """Return True if the aircraft is past the line across the leg's end (east, north), or if the leg has no length."""
    leg_e, leg_n = east - from_east, north - from_north
    ahead_e, ahead_n = east - estimated.east, north - estimated.north
    return ahead_e * leg_e + ahead_n * leg_n <= 0.0


@inner
def navigate_legs(
    estimated: Record,
    waypoints: Records,
    parameters: Record,
    own: Record,
    air_density_factor: float,
    dt: float,
) -> None:
    """Demand a side acceleration for the current leg, and change to the next leg when it is time.

    estimated: a record of `flight.guidance.navigation_error.MOTION`.
    waypoints: (w,) of `flight.guidance.lateral_reference_laws.WAYPOINT`.
    parameters: of `flight.autopilots.arduplane.parameters.ARDUPILOT_PARAMETERS`.
    own: of `flight.autopilots.arduplane.law.ARDUPILOT_MEMORY`.
    air_density_factor: ratio of true to equivalent airspeed.
    dt: s since the last update.
    """
    b = waypoints[own.leg + 1]
    speed = max(0.1, math.hypot(estimated.velocity_east, estimated.velocity_north))
    l1_distance = l1_length(speed, parameters.navl1_period, parameters.navl1_damping)
    if b.returns:
        # An RTL is one leg, which lasts until the flight ends or joins the mission's landing sequence.
        _navigate_rtl(estimated, b, parameters, own, air_density_factor)
        _join_landing(estimated, waypoints, b, own)
        return
    if b.circle != 0.0:
        _fly_loiter(estimated, waypoints, b, parameters, own, l1_distance, speed, air_density_factor, dt)
        return
    own.on_circle = False
    end_e, end_n = _end_of_leg(b, own)
    _follow_line(estimated, end_e, end_n, parameters, own, l1_distance, speed, dt, b.straight)
    turn = _turn_angle_at(waypoints, b, own)
    if own.leg + 2 < waypoints.shape[0] and _is_leg_over(
        estimated, b, end_e, end_n, turn, parameters, own, l1_distance, air_density_factor
    ):
        _begin_leg(estimated, waypoints, own.leg + 1, own)


@inner
def _end_of_leg(b: Record, own: Record) -> tuple[float, float]:
    """Return east and north (m) of the leg's end, which lies beyond b if b has a pass-by distance.

    `Plane::verify_nav_wp` moves the waypoint on along the leg.
    """
    leg_e, leg_n = b.east - own.from_east, b.north - own.from_north
    run = math.hypot(leg_e, leg_n)
    if b.pass_by <= 0.0 or run <= 0.0:
        return b.east, b.north
    return b.east + b.pass_by * leg_e / run, b.north + b.pass_by * leg_n / run


@inner
def target_of(b: Record) -> tuple[float, float]:
    """Return east and north (m) of a waypoint of the route, or of the center if it belongs to a loiter."""
    return (b.centre_east, b.centre_north) if b.circle != 0.0 and not b.returns else (b.east, b.north)


@inner
def _follow_line(
    estimated: Record,
    east: float,
    north: float,
    parameters: Record,
    own: Record,
    l1_distance: float,
    speed: float,
    dt: float,
    straight: bool,
) -> None:
    """Demand the side acceleration along the line from the leg's start to its end, m.

    straight: True for a line from the aircraft itself (`Plane::verify_nav_wp` without crosstrack).
    """
    from_e, from_n = (estimated.east, estimated.north) if straight else (own.from_east, own.from_north)
    angle, aim = l1_angles(estimated, from_e, from_n, east, north, l1_distance)
    own.cross_track_integrator = l1_integrate(aim, own.cross_track_integrator, parameters.navl1_xtrack_i, dt)
    if not math.isnan(aim):
        angle += aim + own.cross_track_integrator
    own.side_acceleration = l1_acceleration(angle, speed, l1_distance, parameters.navl1_damping)


@inner
def _turn_angle_at(waypoints: Records, b: Record, own: Record) -> float:
    """Return the turn angle at b that ArduPlane uses, rad, positive.

    Next to a loiter, the angle is that of the turn from or to the loiter's center.
    """
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
def _begin_leg(estimated: Record, waypoints: Records, leg: int, own: Record) -> None:
    """Begin a leg, whose line leads from its waypoint to the next, or from the aircraft if it is past the end."""
    a, b = waypoints[leg], waypoints[leg + 1]
    own.leg = leg
    # The next loiter has not been captured yet, even if the current one was.
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
def _is_leg_over(
    estimated: Record,
    b: Record,
    end_e: float,
    end_n: float,
    turn: float,
    parameters: Record,
    own: Record,
    l1_distance: float,
    air_density_factor: float,
) -> bool:
    """Return True if the leg to b is over, because its end is within the turn distance or the line across it is passed.

    end_e, end_n: end of the leg, m; it lies beyond b if b has a pass-by distance, and is then flown to.
    turn: of the route at b, rad.
    """
    passed = past_line(estimated, own.from_east, own.from_north, end_e, end_n)
    if (
        parameters.wp_max_radius > 0.0
        and math.hypot(b.east - estimated.east, b.north - estimated.north) > parameters.wp_max_radius
    ):
        if passed and b.pass_by <= 0.0:
            # Passed beyond WP_MAX_RADIUS: it turns back to the waypoint.
            own.from_east, own.from_north = estimated.east, estimated.north
        return False
    if b.fly_over or (b.pass_by > 0.0 and b.acceptance < 1.0):
        return passed
    distance = math.hypot(end_e - estimated.east, end_n - estimated.north)
    reach = turn_distance(b.acceptance, turn, parameters.wp_radius, l1_distance, air_density_factor)
    return passed or distance <= reach


@inner
def _fly_loiter(
    estimated: Record,
    waypoints: Records,
    b: Record,
    parameters: Record,
    own: Record,
    l1_distance: float,
    speed: float,
    air_density_factor: float,
    dt: float,
) -> None:
    """Fly to a loiter and around it until it is over and the aircraft heads for the next place.

    b: the corner of the route that stands for the loiter; its circle has the radius at its altitude.
    """
    density_ratio = air_density_factor / true_by_equivalent(b.up)
    radius = abs(b.circle) * density_ratio * density_ratio
    distance = math.hypot(b.centre_east - estimated.east, b.centre_north - estimated.north)
    if not own.loitering and distance > _APPROACH_LINE_RADII_RATIO * radius:
        own.on_circle = False
        _follow_line(estimated, b.centre_east, b.centre_north, parameters, own, l1_distance, speed, dt, b.straight)
        return
    own.side_acceleration = _loiter_acceleration(estimated, b, radius, parameters, own, l1_distance, speed)
    _update_loiter_progress(estimated, b, own, dt)
    if not own.over and _is_loiter_done(estimated, b, own):
        own.over, own.waited = True, 0.0
    after = own.leg + 2
    while after < waypoints.shape[0] and waypoints[after].stop == b.stop:
        after += 1
    if after >= waypoints.shape[0]:
        return
    if own.over and (own.on_circle or b.turns == 0.0) and _is_lined_up(estimated, waypoints[after], b, radius, own):
        own.left_for = after - 1
        _begin_leg(estimated, waypoints, after - 1, own)


@inner
def _update_loiter_progress(estimated: Record, b: Record, own: Record, dt: float) -> None:
    """Update the time and the angle around a loiter since the aircraft captured it."""
    bearing = math.atan2(estimated.east - b.centre_east, estimated.north - b.centre_north)
    if own.loitering:
        own.stayed += dt
        turned = wrap(bearing - own.bearing) * math.copysign(1.0, b.circle)
        own.circled += turned
        own.waited += turned
    elif own.on_circle:
        own.loitering = True
        own.next_look, own.up_before = _ALTITUDE_CHECK_INTERVAL_LAPS * 2.0 * math.pi, estimated.up
    own.bearing = bearing
    if own.on_circle and abs(estimated.up - b.up) < LOITER_ALTITUDE_TOLERANCE_M:
        own.at_height = True


@inner
def _is_loiter_done(estimated: Record, b: Record, own: Record) -> bool:
    """Return True once the loiter's turns or time are completed, or its altitude is reached."""
    if not own.loitering:
        return False
    if b.to_height:
        if not own.at_height and own.circled >= own.next_look:
            own.at_height = abs(estimated.up - own.up_before) < LOITER_ALTITUDE_TOLERANCE_M
            own.next_look, own.up_before = own.next_look + _ALTITUDE_CHECK_INTERVAL_LAPS * 2.0 * math.pi, estimated.up
        return own.at_height
    if math.isnan(b.stays):
        return own.circled > b.turns * 2.0 * math.pi
    return own.stayed > b.stays


@inner
def _is_lined_up(estimated: Record, onward: Record, b: Record, radius: float, own: Record) -> bool:
    """Return True if the course leads to the place after loiter b, or if no course can.

    No course from the loiter leads to a place inside its circle (radius, m).
    """
    east, north = (onward.centre_east, onward.centre_north) if onward.returns else target_of(onward)
    if math.hypot(east - b.centre_east, north - b.centre_north) < _MIN_EXIT_DISTANCE_RATIO * radius:
        return True
    bearing = math.atan2(east - estimated.east, north - estimated.north)
    heading_error = abs(wrap(bearing - math.atan2(estimated.velocity_east, estimated.velocity_north)))
    return heading_error <= _EXIT_HEADING_TOLERANCE_RAD + _EXIT_HEADING_GROWTH_RAD * math.floor(
        abs(own.waited) / (2.0 * math.pi)
    )


@inner
def _navigate_rtl(estimated: Record, b: Record, parameters: Record, own: Record, air_density_factor: float) -> None:
    """Demand the side acceleration of an RTL (`ModeRTL::update`, ArduPlane/mode_rtl.cpp).

    The aircraft turns to the center of the RTL loiter at once, from any leg; the radius grows with altitude as the
    square of the ratio of true to equivalent airspeed (`AP_L1_Control::loiter_radius`).  Until the initial climb is
    done, bank is limited to LEVEL_ROLL_LIMIT; only then the altitude slope begins, at the aircraft.
    """
    if not own.returning:
        own.returning = True
        own.from_east, own.from_north, own.from_up = estimated.east, estimated.north, estimated.up
    speed = max(0.1, math.hypot(estimated.velocity_east, estimated.velocity_north))
    l1_distance = l1_length(speed, parameters.navl1_period, parameters.navl1_damping)
    radius = abs(b.circle) * air_density_factor * air_density_factor
    own.side_acceleration = _loiter_acceleration(estimated, b, radius, parameters, own, l1_distance, speed)
    if own.climbed:
        return
    if int(parameters.flight_options) & CLIMB_BEFORE_TURN:
        own.climbed = estimated.up > b.up
    else:
        own.climbed = parameters.rtl_climb_min <= 0.0 or estimated.up - own.from_up > parameters.rtl_climb_min
    if own.climbed:
        own.from_east, own.from_north, own.from_up = estimated.east, estimated.north, estimated.up
        return
    max_acceleration = GRAVITY * math.tan(parameters.level_roll_limit)
    own.side_acceleration = min(max_acceleration, max(-max_acceleration, own.side_acceleration))


@inner
def _join_landing(estimated: Record, waypoints: Records, b: Record, own: Record) -> None:
    """Leave the RTL loiter for the landing sequence, if there is one, once the aircraft loiters near its altitude.

    `ModeRTL::navigate` of ArduPlane 4.6 with RTL_AUTOLAND 1.  The leg begins at the aircraft.
    """
    after = own.leg + 2
    while after < waypoints.shape[0] and waypoints[after].returns:
        after += 1
    if (
        after >= waypoints.shape[0]
        or not own.on_circle
        or abs(estimated.up - b.up) >= LANDING_JOIN_ALTITUDE_TOLERANCE_M
    ):
        return
    own.left_for = after - 1
    own.returning, own.climbed = False, False
    _begin_leg(estimated, waypoints, after - 1, own)
    own.from_east, own.from_north, own.from_up = estimated.east, estimated.north, estimated.up


@inner
def _loiter_acceleration(
    estimated: Record, b: Record, radius: float, parameters: Record, own: Record, l1_distance: float, speed: float
) -> float:
    """Return the side acceleration of a loiter, m/s^2 (`AP_L1_Control::update_loiter`).

    It steers straight to the center until the circle demands the sharper turn, and then around the circle.
    """
    direction = math.copysign(1.0, b.circle)
    out_e, out_n = estimated.east - b.centre_east, estimated.north - b.centre_north
    distance = max(0.1, math.hypot(out_e, out_n))
    course = math.atan2(estimated.velocity_east, estimated.velocity_north)
    inward = wrap(course - math.atan2(-out_e, -out_n))
    capture = l1_acceleration(inward, speed, l1_distance, parameters.navl1_damping)
    # Speeds over the ground: outwards, and around the circle in its direction.
    outwards = -speed * math.cos(inward)
    around = -direction * speed * math.sin(inward)
    frequency = 2.0 * math.pi / parameters.navl1_period
    error = distance - radius
    correction = frequency * (frequency * error + 2.0 * parameters.navl1_damping * outwards)
    if outwards > 0.0 and around < 0.0:
        # Flying outwards against the loiter's direction, it turns in the loiter's direction.
        correction = max(correction, 0.0)
    circling = direction * (correction + around * around / max(0.5 * radius, distance))
    own.on_circle = not (error > 0.0 and direction * capture < direction * circling)
    return circling if own.on_circle else capture
