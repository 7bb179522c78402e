"""The guidance core: from the state to the four commands, on packed arrays, compiled.

Three lateral laws: ours, a second-order cross-track law with curvature feed-forward, about the line beside the path
that a rolling aircraft can follow, which answers gusts by bank, and by a skid where bank ends; L1 along the legs, as
ArduPlane flies it; and the vector field of Beard and McLain along the fly-by path, whose arcs are its fillets.
They share bank limit, vertical channel and inner loops (`flight.guidance.inner_loops`), so that flights differ by the
law alone. None asks for the wind: all steer by the velocity over the ground.  No clock: dt is an argument.
"""

import math

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY
from flight.dynamics.state import S
from flight.guidance.inner_loops import roll_model, steer_bank, steer_height
from flight.guidance.path_kernels import mean_curvature, most_curvature, project
from flight.guidance.reference_laws import (
    WAYPOINT_RADIUS,
    field_course,
    l1_acceleration,
    l1_angles,
    l1_integrate,
    l1_length,
    l1_reached,
)
from flight.guidance.rows import G, Lateral, M
from world.geometry import wrap
from world.kernels import compiled, compiled_views

Floats = NDArray[np.float64]

# Of the lateral acceleration at the greatest bank, what an arc may take before the aircraft slows down for it.
ARC_SHARE = 0.95
# Longest tick that the whole lead of a correction is for, s.
LEAD_TICK = 1.0 / 60.0


@compiled_views
def guide(
    state: Floats,
    place: Floats,
    pieces: Floats,
    nodes: Floats,
    corners: Floats,
    speeds: Floats,
    gains: Floats,
    memory: Floats,
    commands: Floats,
    dt: float,
) -> None:  # pragma: no cover - compiled
    """One tick: fill ``commands`` (COMMAND_SIZE,) and what ``memory`` (MEMORY_SIZE,) keeps.

    state: (STATE_SIZE,).  place: (6,) east, north, up in m, ground velocity east, north and up in m/s in map axes, as
    navigation sees them.  pieces, nodes: a `flight.guidance.fly_by_path.FlyByPath`.  corners: (w, 5) of each waypoint:
    east, north, turn (rad, positive), 1 if flown over, acceptance (m, 0 where none is stated).  speeds: (legs,) m/s.
    gains: `flight.guidance.gains.Gains.packed`.
    """
    k = int(memory[M.PIECE])
    along, cross, course = project(pieces[k], place[0], place[1])
    while along > pieces[k, 1] and k + 1 < pieces.shape[0]:
        k += 1
        along, cross, course = project(pieces[k], place[0], place[1])
    memory[M.PIECE] = k
    s = pieces[k, 0] + along
    leg = pieces[k, 6] + (1.0 if s > pieces[k, 7] else 0.0)
    memory[M.LEG] = leg
    memory[M.DISTANCE] = s
    memory[M.CROSS_TRACK] = cross
    memory[M.SPEED_COMMAND] = speeds[int(leg)]
    memory[M.DONE] = 1.0 if k + 1 == pieces.shape[0] and along >= pieces[k, 1] else 0.0
    law = int(memory[M.GUIDANCE])
    if law == Lateral.L1:
        bank = _l1(state, place, corners, gains, memory, dt)
    elif law == Lateral.VECTOR_FIELD:
        bank = _field(place, pieces[k, 5], gains, memory, course, dt)
    else:
        bank = _along_path(state, place, pieces, gains, memory, course, dt)
    steer_height(state, place, nodes, gains, memory, commands, course, dt)
    steer_bank(state, gains, memory, commands, bank, dt)


@compiled
def _along_path(
    state: Floats, place: Floats, pieces: Floats, gains: Floats, memory: Floats, course: float, dt: float
) -> float:  # pragma: no cover - compiled
    """Bank command, rad: curvature ahead, plus a second-order law on the cross-track error."""
    speed = max(5.0, math.hypot(place[3], place[4]))
    ground_course = math.atan2(place[3], place[4])
    off_course = wrap(ground_course - course)
    cross = memory[M.CROSS_TRACK]
    # The lift's horizontal part is square to the heading, the acceleration wanted is square to the course.
    drift = wrap(ground_course - state[S.YAW])
    crab = max(0.5, math.cos(drift))
    k, s = int(memory[M.PIECE]), memory[M.DISTANCE]
    # Where the wind blows aside the turn changes the ground speed: it will be this when the bank comes.
    then = speed + gains[G.TURN_LEAD] * GRAVITY * math.tan(memory[M.BANK]) * math.sin(drift)
    start = s + speed * max(0.0, gains[G.TURN_LEAD] - 0.5 * gains[G.TURN_SMOOTHING])
    turn = then * then * mean_curvature(pieces, k, start, start + speed * gains[G.TURN_SMOOTHING])
    # No aircraft steps into an arc: this is how far aside it shall be where the path's curvature jumps.
    memory[M.PATH_BANK], memory[M.PATH_BANK_RATE], _ = roll_model(
        math.atan(turn / (GRAVITY * crab)), memory[M.PATH_BANK], memory[M.PATH_BANK_RATE], gains, dt
    )
    back = gains[G.ASIDE_FREQUENCY]
    home = -back * (2.0 * memory[M.ASIDE_RATE] + back * memory[M.ASIDE])
    memory[M.ASIDE_RATE] += (GRAVITY * math.tan(memory[M.PATH_BANK]) * crab - speed * speed * pieces[k, 5] + home) * dt
    memory[M.ASIDE] += memory[M.ASIDE_RATE] * dt
    frequency = gains[G.CROSS_TRACK_FREQUENCY]
    rate_gain = 2.0 * gains[G.CROSS_TRACK_DAMPING] * frequency
    most = speed * math.sin(gains[G.INTERCEPT])
    wanted_rate = min(most, max(-most, -(cross - memory[M.ASIDE]) * frequency * frequency / rate_gain))
    # Flying away from the course counts as flying square to it: the sine would fall again.
    away = abs(off_course) > 0.5 * math.pi
    rate = math.copysign(speed, off_course) if away else speed * math.sin(off_course)
    push = rate_gain * (wanted_rate - (rate - memory[M.ASIDE_RATE]))
    push -= gains[G.CROSS_TRACK_INTEGRAL] * memory[M.CROSS_TRACK_SUM]
    push -= gains[G.SIDE_GAIN] * _unexplained(state, place, gains, memory, speed, crab, dt)
    # Bank comes late: the correction is asked for ahead of its time.  A longer tick itself comes late: with the whole
    # lead the aircraft would roll to and fro (45 degrees of bank at 30 Hz in moderate turbulence; 38 with half of it).
    change = (push - memory[M.PUSH]) / gains[G.PUSH_SMOOTHING]
    memory[M.PUSH] += change * min(dt, gains[G.PUSH_SMOOTHING])
    push += home + gains[G.PUSH_LEAD] * min(1.0, (LEAD_TICK / dt) ** 2) * change
    lift = GRAVITY + memory[M.BEND]
    wanted = math.atan((turn + push) / (lift * crab))
    bank: float = min(memory[M.MAX_BANK], max(-memory[M.MAX_BANK], wanted))
    sharpest = most_curvature(pieces, k, s, s + speed * gains[G.ARC_SLOWING_TIME])
    memory[M.ARC_SPEED] = math.sqrt(ARC_SHARE * GRAVITY * math.tan(memory[M.MAX_BANK]) / max(1e-9, sharpest))
    # What the bank limit leaves, within limits, a skid: its side force points where the turn goes.
    left = lift * (math.tan(wanted) - math.tan(bank))
    slip = left / max(1.0, gains[G.SIDE_PER_SIDESLIP] * _pressure(state, gains))
    most = gains[G.SIDESLIP_MAX]
    memory[M.SIDESLIP] = -min(most, max(-most, slip))
    if bank == wanted and abs(cross) < 20.0:
        memory[M.CROSS_TRACK_SUM] = min(40.0, max(-40.0, memory[M.CROSS_TRACK_SUM] + cross * dt))
    return bank


@compiled
def _pressure(state: Floats, gains: Floats) -> float:  # pragma: no cover - compiled
    """Dynamic pressure in that at the reference airspeed."""
    share: float = (state[S.AIRSPEED] / gains[G.REFERENCE_AIRSPEED]) ** 2
    return share


@compiled
def _unexplained(
    state: Floats, place: Floats, gains: Floats, memory: Floats, speed: float, crab: float, dt: float
) -> float:  # pragma: no cover - compiled
    """Acceleration to the right of the course that neither lift nor ailerons explain, smoothed, m/s^2."""
    if memory[M.LAST_EAST] != 0.0 or memory[M.LAST_NORTH] != 0.0:
        gained = (place[3] - memory[M.LAST_EAST]) * place[4] - (place[4] - memory[M.LAST_NORTH]) * place[3]
        lifted = (GRAVITY + (place[5] - memory[M.LAST_UP]) / dt) * math.tan(state[S.ROLL])
        pushed = gains[G.SIDE_PER_AILERON] * _pressure(state, gains) * state[S.AILERON]
        side = gained / (speed * dt) - (lifted + pushed) * crab
        memory[M.SIDE] += (side - memory[M.SIDE]) * min(1.0, dt / gains[G.SIDE_LAG])
    memory[M.LAST_EAST], memory[M.LAST_NORTH], memory[M.LAST_UP] = place[3], place[4], place[5]
    side_now: float = memory[M.SIDE]
    return side_now


@compiled_views
def _l1(
    state: Floats, place: Floats, corners: Floats, gains: Floats, memory: Floats, dt: float
) -> float:  # pragma: no cover - compiled
    """Bank command, rad, of L1 on the leg between two waypoints, with its own switching from leg to leg."""
    speed = max(0.1, math.hypot(place[3], place[4]))
    damping = gains[G.L1_DAMPING]
    length = l1_length(speed, gains[G.L1_PERIOD], damping)
    k = int(memory[M.L1_LEG])
    radius = corners[k + 1, 4] if corners[k + 1, 4] > 0.0 else WAYPOINT_RADIUS
    if k + 2 < corners.shape[0] and l1_reached(place, corners[k], corners[k + 1], length, radius):
        k += 1
        memory[M.L1_LEG] = k
    angle, aim = l1_angles(place, corners[k], corners[k + 1], length)
    memory[M.L1_SUM] = l1_integrate(aim, memory[M.L1_SUM], gains[G.L1_INTEGRAL], dt)
    if not math.isnan(aim):
        angle += aim + memory[M.L1_SUM]
    pitch = min(1.0, max(-1.0, state[S.PITCH]))
    wanted = math.atan(l1_acceleration(angle, speed, length, damping) / (GRAVITY * math.cos(pitch)))
    bank: float = min(memory[M.MAX_BANK], max(-memory[M.MAX_BANK], wanted))
    return bank


@compiled
def _field(
    place: Floats, curvature: float, gains: Floats, memory: Floats, course: float, dt: float
) -> float:  # pragma: no cover - compiled
    """Bank command, rad: an orbit's own bank, and a proportional and integral law on the field's course."""
    speed = math.hypot(place[3], place[4])
    wanted_course = field_course(
        course, memory[M.CROSS_TRACK], curvature, gains[G.FIELD_APPROACH], gains[G.FIELD_PATH], gains[G.FIELD_ORBIT]
    )
    error = wrap(wanted_course - math.atan2(place[3], place[4]))
    orbit = math.atan(speed * speed * curvature / GRAVITY)
    wanted = orbit + gains[G.FIELD_COURSE] * error + gains[G.FIELD_COURSE_INTEGRAL] * memory[M.COURSE_SUM]
    bank: float = min(memory[M.MAX_BANK], max(-memory[M.MAX_BANK], wanted))
    if bank == wanted:
        memory[M.COURSE_SUM] = min(1.0, max(-1.0, memory[M.COURSE_SUM] + error * dt))
    return bank
