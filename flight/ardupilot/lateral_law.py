"""How ArduPlane flies along a mission's legs: the L1 law, when it turns to the next leg, and loiters.

The L1 law is that of Park, Deyst and How ("A New Nonlinear Guidance Logic for Trajectory Tracking", AIAA 2004-4900) as
ArduPlane's documentation gives its parameters (ardupilot.org, Plane, "Navigation Tuning"), with the formulas of
`flight.guidance.lateral_reference_laws`.  ArduPlane navigates ten times a second: what it demands stays until then.
"""

import math

from aircraft.envelope import GRAVITY
from flight.guidance.lateral_reference_laws import l1_acceleration, l1_angles, l1_integrate, l1_length
from flight.guidance.path_kernels import Records
from world.geometry import wrap
from world.kernels import Record, compiled

# An acceptance is sent as whole metres in a byte.
MOST_ACCEPTANCE = 255.0
# Least that the roll limit is narrowed to by low airspeed, rad.
_LEAST_ROLL_LIMIT = math.radians(25.0)


@compiled
def turn_distance(
    acceptance: float, turn: float, radius: float, length: float, air_density_factor: float
) -> float:  # pragma: no cover - compiled
    """How far before a waypoint ArduPlane turns to the next leg, m; 0 where it flies on to the waypoint.

    acceptance: that the mission states, m, 0 for none: it is taken as it is, in whole metres.
    turn: rad, positive.  radius: WP_RADIUS, m.  length: of L1, m.
    air_density_factor: true by equivalent airspeed; with height a turn takes its square more room.
    """
    stated = math.floor(min(MOST_ACCEPTANCE, acceptance))
    if stated > 0.0:
        return stated
    whole: float = min(radius * air_density_factor * air_density_factor, length)
    return whole * min(1.0, turn / (0.5 * math.pi))


@compiled
def past_line(estimated: Record, from_east: float, from_north: float, b: Record) -> bool:  # pragma: no cover - compiled
    """Whether the line across the leg at its end is passed; a leg without length is.

    b: the end, a record of `flight.guidance.lateral_reference_laws.WAYPOINT`.
    """
    leg_e, leg_n = b.east - from_east, b.north - from_north
    ahead_e, ahead_n = b.east - estimated.east, b.north - estimated.north
    passed: bool = ahead_e * leg_e + ahead_n * leg_n <= 0.0
    return passed


@compiled
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
    parameters: of `flight.ardupilot.parameters.ARDUPILOT_PARAMETERS`.
    own: of `flight.ardupilot.law_memory.ARDUPILOT_MEMORY`.
    air_density_factor: true by equivalent airspeed.
    dt: s since the last time.
    """
    b = waypoints[own.leg + 1]
    damping = parameters.navl1_damping
    speed = max(0.1, math.hypot(estimated.velocity_east, estimated.velocity_north))
    length = l1_length(speed, parameters.navl1_period, damping)
    if b.circle != 0.0:
        own.side_acceleration = _around(estimated, b, parameters, own, length, speed)
        reached = own.on_circle and _past_corner(estimated, b)
    else:
        own.on_circle = False
        angle, aim = l1_angles(estimated, own.from_east, own.from_north, b.east, b.north, length)
        own.cross_track_sum = l1_integrate(aim, own.cross_track_sum, parameters.navl1_xtrack_i, dt)
        if not math.isnan(aim):
            angle += aim + own.cross_track_sum
        own.side_acceleration = l1_acceleration(angle, speed, length, damping)
        reached = _reached(estimated, b, parameters, own, length, air_density_factor)
    if not reached or own.leg + 2 >= waypoints.shape[0]:
        return
    own.leg += 1
    after = waypoints[own.leg + 1]
    own.from_east, own.from_north, own.from_up = b.east, b.north, b.up
    if after.circle == 0.0 and past_line(estimated, b.east, b.north, after):
        own.from_east, own.from_north, own.from_up = estimated.east, estimated.north, estimated.up


@compiled
def _reached(
    estimated: Record, b: Record, parameters: Record, own: Record, length: float, air_density_factor: float
) -> bool:  # pragma: no cover - compiled
    """Whether the leg to b is over: near enough to b, or past the line across it."""
    distance = math.hypot(b.east - estimated.east, b.north - estimated.north)
    passed = past_line(estimated, own.from_east, own.from_north, b)
    if parameters.wp_max_radius > 0.0 and distance > parameters.wp_max_radius:
        if passed:
            # Passed too far away: it turns back to the waypoint.
            own.from_east, own.from_north = estimated.east, estimated.north
        return False
    if b.fly_over:
        return passed
    reach = turn_distance(b.acceptance, b.turn, parameters.wp_radius, length, air_density_factor)
    return passed or distance <= reach


@compiled
def _around(
    estimated: Record, b: Record, parameters: Record, own: Record, length: float, speed: float
) -> float:  # pragma: no cover - compiled
    """Side acceleration for a loiter: straight to its centre until its circle asks for more, then around it, m/s^2."""
    side = math.copysign(1.0, b.circle)
    radius = abs(b.circle)
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


@compiled
def _past_corner(estimated: Record, b: Record) -> bool:  # pragma: no cover - compiled
    """Whether the aircraft on a circle has passed the corner of the route that stands for this part of it."""
    corner = math.atan2(b.east - b.centre_east, b.north - b.centre_north)
    here = math.atan2(estimated.east - b.centre_east, estimated.north - b.centre_north)
    turned = wrap(here - corner) * math.copysign(1.0, b.circle)
    return 0.0 <= turned < 0.5 * math.pi


@compiled
def wanted_bank(side_acceleration: float, pitch: float, parameters: Record) -> float:  # pragma: no cover - compiled
    """Bank for a side acceleration (m/s^2), within ROLL_LIMIT_DEG, rad.  pitch: rad."""
    level = math.cos(min(math.radians(60.0), max(-math.radians(60.0), pitch)))
    wanted = math.atan(side_acceleration / (GRAVITY * level))
    within: float = min(parameters.roll_limit, max(-parameters.roll_limit, wanted))
    return within


@compiled
def least_airspeed(bank: float, parameters: Record) -> float:  # pragma: no cover - compiled
    """Least airspeed that is flown in a wanted bank (rad), equivalent, m/s: AIRSPEED_MIN, for the load in the bank.

    A bank of phi takes 1 / sqrt(cos phi) of the least airspeed.
    """
    load = math.sqrt(math.cos(min(math.radians(85.0), abs(bank)))) if parameters.stall_prevention > 0.0 else 1.0
    least: float = parameters.airspeed_min / load
    return least


@compiled
def roll_demand(
    side_acceleration: float, pitch: float, airspeed: float, parameters: Record
) -> float:  # pragma: no cover - compiled
    """Bank for a side acceleration (m/s^2), within ROLL_LIMIT_DEG and what the airspeed bears without a stall, rad.

    pitch: rad.  airspeed: equivalent, m/s.
    """
    wanted = wanted_bank(side_acceleration, pitch, parameters)
    if parameters.stall_prevention <= 0.0:
        return wanted
    spare = max(1.0, airspeed / parameters.airspeed_min)
    limit = max(_LEAST_ROLL_LIMIT, math.acos(min(1.0, 1.0 / (spare * spare))))
    demanded: float = min(limit, max(-limit, wanted))
    return demanded
