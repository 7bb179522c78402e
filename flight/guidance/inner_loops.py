"""The vertical channel and the inner loops of the guidance core, which every lateral guidance shares.

The height profile becomes load factor; throttle holds airspeed, and height gives way when it cannot (the energy
priority of TECS).  Inner loops on roll, pitch and yaw rate.
"""

import math

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY
from flight.dynamics.state import C, S
from flight.guidance.path_kernels import profile
from flight.guidance.rows import G, M
from world.kernels import compiled

Floats = NDArray[np.float64]

# Time constants of the energy rate and of the airspeed without its gusts, s.
_ENERGY_LAG = 1.0
_AIRSPEED_LAG = 2.0
# Full throttle for this long (s) means that the aircraft gives all it has: then height gives way to speed.
_ALL_IT_HAS = 1.0


@compiled
def steer_height(
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
    climb_rate = place[5]
    frequency = gains[G.HEIGHT_FREQUENCY]
    rate_gain = 2.0 * gains[G.HEIGHT_DAMPING] * frequency
    wanted_rate = slope * along
    correction = min(4.0, max(-4.0, -error * frequency * frequency / rate_gain))
    memory[M.BEND] = bend * along * along
    push = memory[M.BEND] + rate_gain * (wanted_rate + correction - climb_rate)
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
    # Lift is slower than the ailerons: it is asked for the bank that comes.
    roll = state[S.ROLL]
    banked = roll + gains[G.LOAD_LEAD] * memory[M.BANK_RATE]
    climb = math.asin(min(1.0, max(-1.0, climb_rate / airspeed)))
    load = (push / GRAVITY + math.cos(climb)) / max(0.4, math.cos(banked))
    load = min(3.0, max(0.0, load))
    pressure = (gains[G.REFERENCE_AIRSPEED] / airspeed) ** 2
    alpha = gains[G.ALPHA_PER_G] * (load * pressure - 1.0)
    alpha = min(0.25 - memory[M.TRIM_ALPHA], max(-0.12 - memory[M.TRIM_ALPHA], alpha))
    turn_rate = GRAVITY / airspeed * math.tan(banked) * math.sin(banked)
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
    if memory[M.ARC_SPEED] > 0.0:
        # In an arc and before it the ground speed counts too, as far as the air allows.
        over = math.hypot(place[3], place[4]) - memory[M.ARC_SPEED]
        slow = min(slow, max(-over, slow - gains[G.ARC_SLOWING_MAX]))
    steady = memory[M.TRIM_THROTTLE] + gains[G.THROTTLE_PER_SLOPE] * ahead_slope * along / airspeed
    wanted = steady + gains[G.SPEED_GAIN] * slow + gains[G.SPEED_INTEGRAL] * memory[M.SPEED_SUM]
    commands[C.THROTTLE] = min(1.0, max(0.0, wanted))
    memory[M.FULL_THROTTLE] = memory[M.FULL_THROTTLE] + dt if wanted >= 1.0 else 0.0
    if (wanted < 1.0 or slow < 0.0) and (wanted > 0.0 or slow > 0.0):
        memory[M.SPEED_SUM] = min(60.0, max(-60.0, memory[M.SPEED_SUM] + slow * dt))


@compiled
def roll_model(
    wanted: float, bank: float, rate: float, gains: Floats, dt: float
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Bank (rad), roll rate and roll acceleration a tick on of an aircraft that rolls as ours shall.

    A critically damped oscillator within limits of roll rate and acceleration.
    """
    frequency = gains[G.ROLL_FREQUENCY]
    most = gains[G.ROLL_ACCELERATION_MAX]
    change = min(most, max(-most, frequency * (frequency * (wanted - bank) - 2.0 * rate)))
    most = gains[G.ROLL_RATE_MAX]
    change = min((most - rate) / dt, max((-most - rate) / dt, change))
    rate += change * dt
    return bank + rate * dt, rate, change


@compiled
def steer_bank(
    state: Floats, gains: Floats, memory: Floats, commands: Floats, bank: float, dt: float
) -> None:  # pragma: no cover - compiled
    """Aileron from a bank command through a model of how the aircraft shall roll; rudder for coordination and damping.

    The model answers the command as a critically damped oscillator within the limits of roll rate and acceleration, so
    it never overshoots.  The ailerons get what the model's roll takes, what is left of the error, and, against gusts
    and the propeller, what rolled the aircraft beyond its ailerons' own doing.
    """
    airspeed = max(8.0, state[S.AIRSPEED])
    scale = gains[G.REFERENCE_AIRSPEED] / airspeed
    memory[M.BANK], rate, turn = roll_model(bank, memory[M.BANK], memory[M.BANK_RATE], gains, dt)
    memory[M.BANK_RATE] = rate
    per_rate, per_acceleration = (
        gains[G.AILERON_PER_ROLL_RATE] * scale,
        gains[G.AILERON_PER_ROLL_ACCELERATION] * scale * scale,
    )
    rolled = per_acceleration * (state[S.P] - memory[M.LAST_ROLL_RATE]) / dt + per_rate * state[S.P] - state[S.AILERON]
    memory[M.LAST_ROLL_RATE] = state[S.P]
    memory[M.ROLLED] += (rolled - memory[M.ROLLED]) * min(1.0, dt / gains[G.ROLL_DISTURBANCE_LAG])
    commands[C.AILERON] = (
        per_rate * rate
        + (per_acceleration + gains[G.AILERON_LEAD] * per_rate) * turn
        + gains[G.ROLL_GAIN] * scale * scale * (memory[M.BANK] - state[S.ROLL])
        + gains[G.ROLL_RATE_GAIN] * scale * scale * (rate - state[S.P])
        - memory[M.ROLLED]
    )
    yaw_rate = GRAVITY / airspeed * math.sin(state[S.ROLL]) * math.cos(state[S.PITCH])
    commands[C.RUDDER] = (
        -gains[G.RUDDER_PER_YAW_RATE] * scale * yaw_rate
        - gains[G.YAW_RATE_GAIN] * scale * (yaw_rate - state[S.R])
        - gains[G.SIDESLIP_GAIN] * (state[S.BETA] - memory[M.SIDESLIP])
    )
