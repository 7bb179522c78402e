"""The guidance core: from the state to the four commands, on packed arrays, compiled.

Lateral: a second-order cross-track law on the fly-by path with curvature feed-forward, turned into bank.  Vertical:
the same law upwards, turned into load factor; throttle holds airspeed, and height gives way when it cannot (the
energy priority of TECS).  Inner loops on roll, pitch and yaw rate.  No clock: dt is an argument.
"""

import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from aircraft.compiled import compiled
from aircraft.envelope import GRAVITY
from flight.state import C, S
from world.geometry import wrap

Floats = NDArray[np.float64]


class G(IntEnum):
    """Rows of the packed gains, in the order of `flight.gains.Gains`."""

    REFERENCE_AIRSPEED = 0
    CROSS_TRACK_FREQUENCY = 1
    CROSS_TRACK_DAMPING = 2
    CROSS_TRACK_INTEGRAL = 3
    INTERCEPT = 4
    TURN_LEAD = 5
    TURN_SMOOTHING = 6
    HEIGHT_FREQUENCY = 7
    HEIGHT_DAMPING = 8
    HEIGHT_INTEGRAL = 9
    SLOPE_LEAD = 10
    SPEED_GAIN = 11
    SPEED_INTEGRAL = 12
    THROTTLE_PER_SLOPE = 13
    SLOW_MARGIN = 14
    ROLL_GAIN = 15
    ROLL_RATE_GAIN = 16
    AILERON_PER_ROLL_RATE = 17
    ROLL_INTEGRAL = 18
    ALPHA_PER_G = 19
    ELEVATOR_PER_ALPHA = 20
    ELEVATOR_PER_PITCH_RATE = 21
    PITCH_RATE_GAIN = 22
    YAW_RATE_GAIN = 23


class M(IntEnum):
    """Rows of the guidance memory and of what one tick leaves for the log."""

    PIECE = 0  # index of the piece of the path
    CROSS_TRACK_SUM = 1  # m s
    HEIGHT_SUM = 2  # m s
    SPEED_SUM = 3  # m
    ROLL_SUM = 4  # rad s
    ENERGY_RATE = 5  # m/s, filtered rate of total energy height
    LAST_AIRSPEED = 6  # m/s, negative before the first tick
    TRIM_ELEVATOR = 7  # rad, of level flight at the reference airspeed
    TRIM_ALPHA = 8  # rad
    TRIM_THROTTLE = 9  # 0..1
    MAX_BANK = 10  # rad, of the command
    LEG = 11
    DISTANCE = 12  # m along the path
    CROSS_TRACK = 13  # m right of the path
    HEIGHT_ERROR = 14  # m above it
    SPEED_COMMAND = 15  # m/s
    DONE = 16  # 1 past the end of the path
    AIRSPEED = 17  # m/s, without its gusts
    FULL_THROTTLE = 18  # s without a break


MEMORY_SIZE = len(M)
# Time constants of the energy rate and of the airspeed without its gusts, s.
_ENERGY_LAG = 1.0
_AIRSPEED_LAG = 2.0
# Full throttle for this long (s) means that the aircraft gives all it has: then height gives way to speed.
_ALL_IT_HAS = 1.0


@compiled
def project(piece: Floats, east: float, north: float) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Distance along a piece (m), cross-track error to the right (m) and the path's course there (rad)."""
    course, curvature = piece[4], piece[5]
    de, dn = east - piece[2], north - piece[3]
    if curvature == 0.0:
        return (
            de * math.sin(course) + dn * math.cos(course),
            de * math.cos(course) - dn * math.sin(course),
            course,
        )
    # From the centre, which lies right of the start by 1 / curvature.
    ve = de - math.cos(course) / curvature
    vn = dn + math.sin(course) / curvature
    side = math.copysign(1.0, curvature)
    here = math.atan2(side * vn, -side * ve)
    turned = wrap(here - course) * side
    if turned < -0.5 * math.pi:
        turned += 2.0 * math.pi
    return turned / abs(curvature), side * (1.0 / abs(curvature) - math.hypot(ve, vn)), here


@compiled
def mean_curvature(pieces: Floats, k: int, start: float, end: float) -> float:  # pragma: no cover - compiled
    """Mean curvature of the path between two distances, both at or after piece ``k``, 1/m."""
    total = 0.0
    for i in range(k, pieces.shape[0]):
        low = max(start, pieces[i, 0])
        high = min(end, pieces[i, 0] + pieces[i, 1])
        if high > low:
            total += pieces[i, 5] * (high - low)
        if pieces[i, 0] > end:
            break
    return total / (end - start)


@compiled
def profile(nodes: Floats, s: float) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Height (m), slope (tangent) and its change per metre of the height profile at distance ``s``."""
    k = 0
    while k + 1 < nodes.shape[0] and nodes[k + 1, 0] <= s:
        k += 1
    for i in range(k, min(k + 2, nodes.shape[0])):
        half = nodes[i, 3]
        if half > 0.0 and abs(s - nodes[i, 0]) < half:
            before = nodes[max(i - 1, 0), 2]
            bend = (nodes[i, 2] - before) / (2.0 * half)
            x = s - nodes[i, 0] + half
            return nodes[i, 1] + before * (x - half) + 0.5 * bend * x * x, before + bend * x, bend
    return nodes[k, 1] + nodes[k, 2] * (s - nodes[k, 0]), nodes[k, 2], 0.0


@compiled
def guide(
    state: Floats,
    place: Floats,
    pieces: Floats,
    nodes: Floats,
    speeds: Floats,
    gains: Floats,
    memory: Floats,
    commands: Floats,
    dt: float,
) -> None:  # pragma: no cover - compiled
    """One tick: fill ``commands`` (COMMAND_SIZE,) and what ``memory`` (MEMORY_SIZE,) keeps.

    state: (STATE_SIZE,).  place: (5,) east, north, up in m, ground velocity east and north in m/s in map axes.
    pieces, nodes: a `flight.path.FlyByPath`.  speeds: (legs,) m/s.  gains: `flight.gains.Gains.packed`.
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
    bank = _lateral(state, place, pieces, gains, memory, course, dt)
    _vertical(state, place, nodes, gains, memory, commands, course, dt)
    _roll_and_yaw(state, gains, memory, commands, bank, dt)


@compiled
def _lateral(
    state: Floats, place: Floats, pieces: Floats, gains: Floats, memory: Floats, course: float, dt: float
) -> float:  # pragma: no cover - compiled
    """Bank command, rad: curvature ahead, plus a second-order law on the cross-track error."""
    speed = max(5.0, math.hypot(place[3], place[4]))
    ground_course = math.atan2(place[3], place[4])
    off_course = wrap(ground_course - course)
    cross = memory[M.CROSS_TRACK]
    frequency = gains[G.CROSS_TRACK_FREQUENCY]
    rate_gain = 2.0 * gains[G.CROSS_TRACK_DAMPING] * frequency
    most = speed * math.sin(gains[G.INTERCEPT])
    wanted_rate = min(most, max(-most, -cross * frequency * frequency / rate_gain))
    # Flying away from the course counts as flying square to it: the sine would fall again.
    away = abs(off_course) > 0.5 * math.pi
    rate = math.copysign(speed, off_course) if away else speed * math.sin(off_course)
    s = memory[M.DISTANCE]
    start = s + speed * gains[G.TURN_LEAD]
    curvature = mean_curvature(pieces, int(memory[M.PIECE]), start, start + speed * gains[G.TURN_SMOOTHING])
    push = rate_gain * (wanted_rate - rate) - gains[G.CROSS_TRACK_INTEGRAL] * memory[M.CROSS_TRACK_SUM]
    # The lift's horizontal part is square to the heading, the acceleration wanted is square to the course.
    crab = math.cos(wrap(ground_course - state[S.YAW]))
    wanted = math.atan((speed * speed * curvature + push) / (GRAVITY * max(0.5, crab)))
    bank: float = min(memory[M.MAX_BANK], max(-memory[M.MAX_BANK], wanted))
    if bank == wanted and abs(cross) < 20.0:
        memory[M.CROSS_TRACK_SUM] = min(40.0, max(-40.0, memory[M.CROSS_TRACK_SUM] + cross * dt))
    return bank


@compiled
def _vertical(
    state: Floats,
    place: Floats,
    nodes: Floats,
    gains: Floats,
    memory: Floats,
    commands: Floats,
    course: float,
    dt: float,
) -> None:  # pragma: no cover - compiled
    """Elevator from the height profile through the load factor; throttle from the airspeed."""
    airspeed = max(8.0, state[S.AIRSPEED])
    along = max(1.0, place[3] * math.sin(course) + place[4] * math.cos(course))
    height, slope, _ = profile(nodes, memory[M.DISTANCE])
    _, ahead_slope, bend = profile(nodes, memory[M.DISTANCE] + along * gains[G.SLOPE_LEAD])
    error = place[2] - height
    memory[M.HEIGHT_ERROR] = error
    climb_rate = -state[S.V_DOWN]
    frequency = gains[G.HEIGHT_FREQUENCY]
    rate_gain = 2.0 * gains[G.HEIGHT_DAMPING] * frequency
    wanted_rate = slope * along
    correction = min(4.0, max(-4.0, -error * frequency * frequency / rate_gain))
    push = bend * along * along + rate_gain * (wanted_rate + correction - climb_rate)
    push -= gains[G.HEIGHT_INTEGRAL] * memory[M.HEIGHT_SUM]
    # Energy: what the aircraft gains now is what it can climb at a steady airspeed.
    command = memory[M.SPEED_COMMAND]
    if memory[M.LAST_AIRSPEED] < 0.0:
        memory[M.LAST_AIRSPEED] = airspeed
        memory[M.AIRSPEED] = airspeed
        memory[M.ENERGY_RATE] = climb_rate
    energy_rate = climb_rate + airspeed * (airspeed - memory[M.LAST_AIRSPEED]) / (dt * GRAVITY)
    memory[M.LAST_AIRSPEED] = airspeed
    memory[M.ENERGY_RATE] += (energy_rate - memory[M.ENERGY_RATE]) * dt / _ENERGY_LAG
    memory[M.AIRSPEED] += (airspeed - memory[M.AIRSPEED]) * dt / _AIRSPEED_LAG
    held = False
    if memory[M.FULL_THROTTLE] > _ALL_IT_HAS:
        spare = memory[M.AIRSPEED] - (command - gains[G.SLOW_MARGIN])
        ceiling = rate_gain * (memory[M.ENERGY_RATE] + spare * airspeed / (GRAVITY * 3.0) - climb_rate)
        held = push > ceiling
        push = min(push, ceiling)
    push = min(8.0, max(-6.0, push))
    if not held and abs(error) < 5.0:
        memory[M.HEIGHT_SUM] = min(5.0, max(-5.0, memory[M.HEIGHT_SUM] + error * dt))
    # Load factor, angle of attack, elevator.
    roll = state[S.ROLL]
    climb = math.asin(min(1.0, max(-1.0, climb_rate / airspeed)))
    load = (push / GRAVITY + math.cos(climb)) / max(0.4, math.cos(roll))
    load = min(3.0, max(0.0, load))
    pressure = (gains[G.REFERENCE_AIRSPEED] / airspeed) ** 2
    alpha = gains[G.ALPHA_PER_G] * (load * pressure - 1.0)
    alpha = min(0.25 - memory[M.TRIM_ALPHA], max(-0.12 - memory[M.TRIM_ALPHA], alpha))
    turn_rate = GRAVITY / airspeed * math.tan(roll) * math.sin(roll)
    pitch_rate = turn_rate + push / airspeed * math.cos(roll)
    scale = gains[G.REFERENCE_AIRSPEED] / airspeed
    commands[C.ELEVATOR] = (
        memory[M.TRIM_ELEVATOR]
        + gains[G.ELEVATOR_PER_ALPHA] * alpha
        + gains[G.ELEVATOR_PER_PITCH_RATE] * scale * pitch_rate
        + gains[G.PITCH_RATE_GAIN] * scale * (state[S.Q] - pitch_rate)
    )
    # Throttle: level flight, the slope to the air ahead, and the airspeed error.
    slow = command - airspeed
    steady = memory[M.TRIM_THROTTLE] + gains[G.THROTTLE_PER_SLOPE] * ahead_slope * along / airspeed
    wanted = steady + gains[G.SPEED_GAIN] * slow + gains[G.SPEED_INTEGRAL] * memory[M.SPEED_SUM]
    commands[C.THROTTLE] = min(1.0, max(0.0, wanted))
    memory[M.FULL_THROTTLE] = memory[M.FULL_THROTTLE] + dt if wanted >= 1.0 else 0.0
    if (wanted < 1.0 or slow < 0.0) and (wanted > 0.0 or slow > 0.0):
        memory[M.SPEED_SUM] = min(60.0, max(-60.0, memory[M.SPEED_SUM] + slow * dt))


@compiled
def _roll_and_yaw(
    state: Floats, gains: Floats, memory: Floats, commands: Floats, bank: float, dt: float
) -> None:  # pragma: no cover - compiled
    """Aileron from bank through roll rate; rudder for coordination and damping."""
    airspeed = max(8.0, state[S.AIRSPEED])
    scale = gains[G.REFERENCE_AIRSPEED] / airspeed
    error = bank - state[S.ROLL]
    rate = min(1.5, max(-1.5, gains[G.ROLL_GAIN] * error))
    commands[C.AILERON] = (
        gains[G.AILERON_PER_ROLL_RATE] * scale * rate
        + gains[G.ROLL_RATE_GAIN] * scale * scale * (rate - state[S.P])
        + gains[G.ROLL_INTEGRAL] * memory[M.ROLL_SUM]
    )
    if abs(error) < 0.15:
        memory[M.ROLL_SUM] = min(0.5, max(-0.5, memory[M.ROLL_SUM] + error * dt))
    yaw_rate = GRAVITY / airspeed * math.sin(state[S.ROLL]) * math.cos(state[S.PITCH])
    commands[C.RUDDER] = -gains[G.YAW_RATE_GAIN] * scale * (yaw_rate - state[S.R])
