"""The guidance core: from the state to the four commands, on records with named fields, compiled.

Three lateral laws: ours, a second-order cross-track law with curvature feed-forward, about the line beside the path
that a rolling aircraft can follow, which answers gusts by bank, and by a skid where bank ends; L1 along the legs, as
ArduPlane flies it; and the vector field of Beard and McLain along the fly-by path, whose arcs are its fillets.
They share bank limit, vertical channel and inner loops (`flight.guidance.inner_loops`), so that flights differ by the
law alone. None asks for the wind: all steer by the velocity over the ground.  No clock: dt is an argument.
"""

import math

from aircraft.envelope import GRAVITY
from flight.guidance.inner_loops import L1, VECTOR_FIELD, roll_model, steer_bank, steer_height
from flight.guidance.lateral_reference_laws import (
    WAYPOINT_RADIUS,
    field_course,
    l1_acceleration,
    l1_angles,
    l1_integrate,
    l1_length,
    l1_reached,
)
from flight.guidance.path import Records, mean_curvature, most_curvature, project
from world.geometry import wrap
from world.kernels import Record, compiled

# Of the lateral acceleration at the greatest bank, what an arc may take before the aircraft slows down for it.
ARC_SHARE = 0.95
# Longest tick that the whole lead of a correction is for, s.
LEAD_TICK = 1.0 / 60.0


@compiled
def guide(
    state: Record,
    estimated: Record,
    pieces: Records,
    nodes: Records,
    waypoints: Records,
    gains: Record,
    memory: Record,
    commands: Record,
    dt: float,
) -> None:  # pragma: no cover - compiled
    """One tick of ``dt`` seconds: fill the commands, and the memory for the next one.

    state: a record of `flight.dynamics.state.STATE`.
    estimated: of `flight.guidance.navigation_error.MOTION`.
    pieces, nodes: of a `flight.guidance.path.FlyByPath`.
    waypoints: (w,) of `flight.guidance.lateral_reference_laws.WAYPOINT`.
    gains: a record of `flight.guidance.gains.GAINS`.
    memory: of `flight.guidance.inner_loops.GUIDANCE_MEMORY`.
    commands: of `flight.dynamics.state.COMMANDS`.
    """
    course = find_on_path(estimated, pieces, memory)
    memory.speed_command = waypoints[memory.leg].airspeed
    if memory.law == L1:
        bank = _l1(state, estimated, waypoints, gains, memory, dt)
    elif memory.law == VECTOR_FIELD:
        bank = _field(estimated, pieces[memory.piece].curvature, gains, memory, course, dt)
    else:
        bank = _along_path(state, estimated, pieces, gains, memory, course, dt)
    steer_height(state, estimated, nodes, gains, memory, commands, course, dt)
    steer_bank(state, gains, memory, commands, bank, dt)


@compiled
def find_on_path(estimated: Record, pieces: Records, memory: Record) -> float:  # pragma: no cover - compiled
    """Note in the memory where on the path the aircraft is, and return the path's course there, rad.

    estimated, pieces, memory: as `guide` takes them.
    """
    k = memory.piece
    along, cross, course = project(pieces[k], estimated.east, estimated.north)
    while along > pieces[k].length and k + 1 < pieces.shape[0]:
        k += 1
        along, cross, course = project(pieces[k], estimated.east, estimated.north)
    piece = pieces[k]
    memory.piece = k
    memory.distance = piece.start + along
    memory.leg = piece.leg + (1 if memory.distance > piece.leg_change else 0)
    memory.cross_track = cross
    memory.done = k + 1 == pieces.shape[0] and along >= piece.length
    return course


@compiled
def _along_path(
    state: Record,
    estimated: Record,
    pieces: Records,
    gains: Record,
    memory: Record,
    course: float,
    dt: float,
) -> float:  # pragma: no cover - compiled
    """Bank command, rad: curvature ahead, plus a second-order law on the cross-track error."""
    speed = max(5.0, math.hypot(estimated.velocity_east, estimated.velocity_north))
    ground_course = math.atan2(estimated.velocity_east, estimated.velocity_north)
    off_course = wrap(ground_course - course)
    # The lift's horizontal part is square to the heading, the acceleration wanted is square to the course.
    drift = wrap(ground_course - state.yaw)
    crab = max(0.5, math.cos(drift))
    k, s = memory.piece, memory.distance
    # Where the wind blows aside the turn changes the ground speed: it will be this when the bank comes.
    then = speed + gains.turn_lead * GRAVITY * math.tan(memory.bank) * math.sin(drift)
    start = s + speed * max(0.0, gains.turn_lead - 0.5 * gains.turn_smoothing)
    turn = then * then * mean_curvature(pieces, k, start, start + speed * gains.turn_smoothing)
    home = _roll_into_path(pieces[k].curvature, gains, memory, turn, speed, crab, dt)
    push = _correction(state, estimated, gains, memory, speed, off_course, crab, dt)
    # Bank comes late: the correction is asked for ahead of its time.  A longer tick itself comes late: with the whole
    # lead the aircraft would roll to and fro (45 degrees of bank at 30 Hz in moderate turbulence; 38 with half of it).
    change = (push - memory.push) / gains.push_smoothing
    memory.push += change * min(dt, gains.push_smoothing)
    push += home + gains.push_lead * min(1.0, (LEAD_TICK / dt) ** 2) * change
    lift = GRAVITY + memory.bend_acceleration
    wanted = math.atan((turn + push) / (lift * crab))
    bank: float = min(memory.max_bank, max(-memory.max_bank, wanted))
    sharpest = most_curvature(pieces, k, s, s + speed * gains.arc_slowing_time)
    memory.arc_speed = math.sqrt(ARC_SHARE * GRAVITY * math.tan(memory.max_bank) / max(1e-9, sharpest))
    # What the bank limit leaves, within limits, a skid: its side force points where the turn goes.
    left = lift * (math.tan(wanted) - math.tan(bank))
    slip = left / max(1.0, gains.side_per_sideslip * _pressure(state, gains))
    most = gains.sideslip_max
    memory.sideslip = -min(most, max(-most, slip))
    if bank == wanted and abs(memory.cross_track) < 20.0:
        memory.cross_track_sum = min(40.0, max(-40.0, memory.cross_track_sum + memory.cross_track * dt))
    return bank


@compiled
def _roll_into_path(
    curvature: float, gains: Record, memory: Record, turn: float, speed: float, crab: float, dt: float
) -> float:  # pragma: no cover - compiled
    """Acceleration (m/s^2 to the right) back to the path from where rolling into its arcs takes the aircraft.

    No aircraft steps into an arc: `aside` is how far beside the path it shall be where the curvature jumps.

    curvature: of the path here, 1/m.  turn: m/s^2 to the right that the path ahead takes.
    """
    memory.path_bank, memory.path_bank_rate, _ = roll_model(
        math.atan(turn / (GRAVITY * crab)), memory.path_bank, memory.path_bank_rate, gains, dt
    )
    back = gains.aside_frequency
    home: float = -back * (2.0 * memory.aside_rate + back * memory.aside)
    memory.aside_rate += (GRAVITY * math.tan(memory.path_bank) * crab - speed * speed * curvature + home) * dt
    memory.aside += memory.aside_rate * dt
    return home


@compiled
def _correction(
    state: Record,
    estimated: Record,
    gains: Record,
    memory: Record,
    speed: float,
    off_course: float,
    crab: float,
    dt: float,
) -> float:  # pragma: no cover - compiled
    """Acceleration to the right that corrects the cross-track error and what pushes the aircraft aside, m/s^2."""
    frequency = gains.cross_track_frequency
    rate_gain = 2.0 * gains.cross_track_damping * frequency
    most = speed * math.sin(gains.intercept)
    wanted_rate = min(most, max(-most, -(memory.cross_track - memory.aside) * frequency * frequency / rate_gain))
    # Flying away from the course counts as flying square to it: the sine would fall again.
    away = abs(off_course) > 0.5 * math.pi
    rate = math.copysign(speed, off_course) if away else speed * math.sin(off_course)
    push: float = rate_gain * (wanted_rate - (rate - memory.aside_rate))
    push -= gains.cross_track_integral * memory.cross_track_sum
    push -= gains.side_gain * _unexplained(state, estimated, gains, memory, speed, crab, dt)
    return push


@compiled
def _pressure(state: Record, gains: Record) -> float:  # pragma: no cover - compiled
    """Dynamic pressure in that at the reference airspeed."""
    share: float = (state.airspeed / gains.reference_airspeed) ** 2
    return share


@compiled
def _unexplained(
    state: Record, estimated: Record, gains: Record, memory: Record, speed: float, crab: float, dt: float
) -> float:  # pragma: no cover - compiled
    """Acceleration to the right of the course that neither lift nor ailerons explain, smoothed, m/s^2."""
    if memory.last_velocity_east != 0.0 or memory.last_velocity_north != 0.0:
        gained_east = estimated.velocity_east - memory.last_velocity_east
        gained_north = estimated.velocity_north - memory.last_velocity_north
        gained = gained_east * estimated.velocity_north - gained_north * estimated.velocity_east
        lifted = (GRAVITY + (estimated.velocity_up - memory.last_velocity_up) / dt) * math.tan(state.roll)
        pushed = gains.side_per_aileron * _pressure(state, gains) * state.aileron
        side = gained / (speed * dt) - (lifted + pushed) * crab
        memory.unexplained_acceleration += (side - memory.unexplained_acceleration) * min(1.0, dt / gains.side_lag)
    memory.last_velocity_east = estimated.velocity_east
    memory.last_velocity_north = estimated.velocity_north
    memory.last_velocity_up = estimated.velocity_up
    side_now: float = memory.unexplained_acceleration
    return side_now


@compiled
def _l1(
    state: Record, estimated: Record, waypoints: Records, gains: Record, memory: Record, dt: float
) -> float:  # pragma: no cover - compiled
    """Bank command, rad, of L1 on the leg between two waypoints, with its own switching from leg to leg."""
    speed = max(0.1, math.hypot(estimated.velocity_east, estimated.velocity_north))
    damping = gains.l1_damping
    length = l1_length(speed, gains.l1_period, damping)
    k = memory.l1_leg
    a, b = waypoints[k], waypoints[k + 1]
    radius = b.acceptance if b.acceptance > 0.0 else WAYPOINT_RADIUS
    if k + 2 < waypoints.shape[0] and l1_reached(estimated, a, b, length, radius):
        k += 1
        memory.l1_leg = k
    a, b = waypoints[k], waypoints[k + 1]
    angle, aim = l1_angles(estimated, a.east, a.north, b.east, b.north, length)
    memory.l1_sum = l1_integrate(aim, memory.l1_sum, gains.l1_integral, dt)
    if not math.isnan(aim):
        angle += aim + memory.l1_sum
    pitch = min(1.0, max(-1.0, state.pitch))
    wanted = math.atan(l1_acceleration(angle, speed, length, damping) / (GRAVITY * math.cos(pitch)))
    bank: float = min(memory.max_bank, max(-memory.max_bank, wanted))
    return bank


@compiled
def _field(
    estimated: Record, curvature: float, gains: Record, memory: Record, course: float, dt: float
) -> float:  # pragma: no cover - compiled
    """Bank command, rad: an orbit's own bank, and a proportional and integral law on the field's course."""
    speed = math.hypot(estimated.velocity_east, estimated.velocity_north)
    wanted_course = field_course(
        course, memory.cross_track, curvature, gains.field_approach, gains.field_path, gains.field_orbit
    )
    error = wrap(wanted_course - math.atan2(estimated.velocity_east, estimated.velocity_north))
    orbit = math.atan(speed * speed * curvature / GRAVITY)
    wanted = orbit + gains.field_course * error + gains.field_course_integral * memory.course_sum
    bank: float = min(memory.max_bank, max(-memory.max_bank, wanted))
    if bank == wanted:
        memory.course_sum = min(1.0, max(-1.0, memory.course_sum + error * dt))
    return bank
