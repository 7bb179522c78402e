"""The vertical channel and the inner loops of the guidance core, which every lateral law shares.

The height profile becomes load factor; throttle holds airspeed, and height gives way when it cannot (the energy
priority of TECS).  Inner loops on roll, pitch and yaw rate.
"""

import math

import numpy as np

from aircraft.envelope import GRAVITY
from flight.guidance.path import Records, profile
from world.kernels import Record, compiled, record_dtype

# ----------------------------------------------------------------------
# What guidance keeps from tick to tick, and what one tick leaves for the track.

# Who may steer; `flight.simulation.simulate.LAWS` has the laws of planfly's guidance by their names in a scenario's
# `[flight] guidance`.
CROSS_TRACK, L1, VECTOR_FIELD, ARDUPILOT = range(4)

GUIDANCE_MEMORY = record_dtype(
    # Set before the first tick.
    ("law", np.int64),  # `CROSS_TRACK`, `L1`, `VECTOR_FIELD` or `ARDUPILOT`
    "max_bank",  # rad, of the command
    "trim_elevator",  # rad, of level flight at the reference airspeed
    "trim_alpha",  # rad
    "trim_throttle",  # 0..1
    # Where on the path.
    ("piece", np.int64),  # index of the piece of the path
    ("leg", np.int64),
    "distance",  # m along the path
    "cross_track",  # m right of the path
    "height_error",  # m above it
    "speed_command",  # m/s
    ("done", np.bool_),  # past the end of the path
    # Across: the cross-track law.
    "cross_track_sum",  # m s
    "last_velocity_east",  # m/s over the ground, a tick ago
    "last_velocity_north",
    "last_velocity_up",
    "unexplained_acceleration",  # m/s^2 to the right that bank and ailerons do not explain
    "path_bank",  # rad and rad/s, of the model roll into the path's curvature alone
    "path_bank_rate",
    "aside",  # m right of the path and m/s, where that roll takes it
    "aside_rate",
    "push",  # m/s^2 to the right that corrects errors, smoothed
    "sideslip",  # rad, wanted
    "arc_speed",  # m/s over the ground, of the sharpest arc near ahead; 0 for no limit
    # Across: the reference laws.
    ("l1_leg", np.int64),  # the leg that L1 is on
    "l1_sum",  # rad
    "course_sum",  # rad s, of the vector field
    # Up.
    "height_sum",  # m s
    "speed_sum",  # m
    "energy_rate",  # m/s, filtered rate of total energy height
    "last_airspeed",  # m/s, negative before the first tick
    "airspeed",  # m/s, without its gusts
    "full_throttle",  # s without a break
    "bend_acceleration",  # m/s^2 upwards, of the path ahead
    # Roll.
    "bank",  # rad, of the model roll
    "bank_rate",  # rad/s, of the model roll
    "last_roll_rate",  # rad/s, a tick ago
    "roll_disturbance",  # rad of aileron that gusts and the propeller amount to
)


# Time constants of the energy rate and of the airspeed without its gusts, s.
_ENERGY_LAG = 1.0
_AIRSPEED_LAG = 2.0
# Full throttle for this long (s) means that the aircraft gives all it has: then height gives way to speed.
_ALL_IT_HAS = 1.0


@compiled
def steer_height(
    state: Record,
    estimated: Record,
    nodes: Records,
    gains: Record,
    memory: Record,
    commands: Record,
    course: float,
    dt: float,
) -> None:  # pragma: no cover - compiled
    """Elevator from the height profile through the load factor; throttle from the airspeed."""
    airspeed = max(8.0, state.airspeed)
    along = max(1.0, estimated.velocity_east * math.sin(course) + estimated.velocity_north * math.cos(course))
    height, slope, _ = profile(nodes, memory.distance)
    _, ahead_slope, bend = profile(nodes, memory.distance + along * gains.slope_lead)
    error = estimated.up - height
    memory.height_error = error
    climb_rate = estimated.velocity_up
    frequency = gains.height_frequency
    rate_gain = 2.0 * gains.height_damping * frequency
    wanted_rate = slope * along
    correction = min(4.0, max(-4.0, -error * frequency * frequency / rate_gain))
    memory.bend_acceleration = bend * along * along
    push = memory.bend_acceleration + rate_gain * (wanted_rate + correction - climb_rate)
    push -= gains.height_integral * memory.height_sum
    ceiling = _push_ceiling(gains, memory, airspeed, climb_rate, rate_gain, dt)
    held = push > ceiling
    push = min(8.0, max(-6.0, min(push, ceiling)))
    if not held and abs(error) < 5.0:
        memory.height_sum = min(5.0, max(-5.0, memory.height_sum + error * dt))
    steer_elevator(state, gains, memory, commands, climb_rate, push)
    _set_throttle(estimated, gains, memory, commands, airspeed, ahead_slope, along, dt)


@compiled
def _push_ceiling(
    gains: Record, memory: Record, airspeed: float, climb_rate: float, rate_gain: float, dt: float
) -> float:  # pragma: no cover - compiled
    """Most acceleration upwards that the energy allows, m/s^2; infinite while the aircraft has more to give.

    What the aircraft gains now is what it can climb at a steady airspeed.
    """
    if memory.last_airspeed < 0.0:
        memory.last_airspeed = airspeed
        memory.airspeed = airspeed
        memory.energy_rate = climb_rate
    energy_rate = climb_rate + airspeed * (airspeed - memory.last_airspeed) / (dt * GRAVITY)
    memory.last_airspeed = airspeed
    memory.energy_rate += (energy_rate - memory.energy_rate) * dt / _ENERGY_LAG
    memory.airspeed += (airspeed - memory.airspeed) * dt / _AIRSPEED_LAG
    if memory.full_throttle <= _ALL_IT_HAS:
        return math.inf
    excess = memory.airspeed - (memory.speed_command - gains.slow_margin)
    ceiling: float = rate_gain * (memory.energy_rate + excess * airspeed / (GRAVITY * 3.0) - climb_rate)
    return ceiling


@compiled
def steer_elevator(
    state: Record, gains: Record, memory: Record, commands: Record, climb_rate: float, push: float
) -> None:  # pragma: no cover - compiled
    """Elevator for an acceleration upwards (m/s^2): load factor, angle of attack, elevator.

    climb_rate: m/s.
    """
    airspeed = max(8.0, state.airspeed)
    # Lift is slower than the ailerons: it is asked for the bank that comes.
    roll = state.roll
    banked = roll + gains.load_lead * memory.bank_rate
    climb = math.asin(min(1.0, max(-1.0, climb_rate / airspeed)))
    load = (push / GRAVITY + math.cos(climb)) / max(0.4, math.cos(banked))
    load = min(3.0, max(0.0, load))
    pressure = (gains.reference_airspeed / airspeed) ** 2
    alpha = gains.alpha_per_g * (load * pressure - 1.0)
    alpha = min(0.25 - memory.trim_alpha, max(-0.12 - memory.trim_alpha, alpha))
    turn_rate = GRAVITY / airspeed * math.tan(banked) * math.sin(banked)
    pitch_rate = turn_rate + push / airspeed * math.cos(roll)
    scale = gains.reference_airspeed / airspeed
    commands.elevator = (
        memory.trim_elevator
        + gains.elevator_per_alpha * alpha
        + gains.elevator_per_pitch_rate * scale * pitch_rate
        + gains.pitch_rate_gain * scale * (state.pitch_rate - pitch_rate)
    )


@compiled
def _set_throttle(
    estimated: Record,
    gains: Record,
    memory: Record,
    commands: Record,
    airspeed: float,
    ahead_slope: float,
    along: float,
    dt: float,
) -> None:  # pragma: no cover - compiled
    """Throttle: level flight's, for the slope to the air ahead, and for the airspeed's error."""
    slow = memory.speed_command - airspeed
    if memory.arc_speed > 0.0:
        # In an arc and before it the ground speed counts too, as far as the air allows.
        over = math.hypot(estimated.velocity_east, estimated.velocity_north) - memory.arc_speed
        slow = min(slow, max(-over, slow - gains.arc_slowing_max))
    steady = memory.trim_throttle + gains.throttle_per_slope * ahead_slope * along / airspeed
    wanted = steady + gains.speed_gain * slow + gains.speed_integral * memory.speed_sum
    commands.throttle = min(1.0, max(0.0, wanted))
    memory.full_throttle = memory.full_throttle + dt if wanted >= 1.0 else 0.0
    if (wanted < 1.0 or slow < 0.0) and (wanted > 0.0 or slow > 0.0):
        memory.speed_sum = min(60.0, max(-60.0, memory.speed_sum + slow * dt))


@compiled
def roll_model(
    wanted: float, bank: float, rate: float, gains: Record, dt: float
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Bank (rad), roll rate and roll acceleration a tick on of an aircraft that rolls as ours shall.

    A critically damped oscillator within limits of roll rate and acceleration.
    """
    frequency = gains.roll_frequency
    most = gains.roll_acceleration_max
    change = min(most, max(-most, frequency * (frequency * (wanted - bank) - 2.0 * rate)))
    most = gains.roll_rate_max
    change = min((most - rate) / dt, max((-most - rate) / dt, change))
    rate += change * dt
    return bank + rate * dt, rate, change


@compiled
def steer_bank(
    state: Record, gains: Record, memory: Record, commands: Record, bank: float, dt: float
) -> None:  # pragma: no cover - compiled
    """Aileron from a bank command through a model of how the aircraft shall roll; rudder for coordination and damping.

    The model answers the command as a critically damped oscillator within the limits of roll rate and acceleration, so
    it never overshoots; `follow_roll` makes the aircraft roll as it does.
    """
    bank, rate, turn = roll_model(bank, memory.bank, memory.bank_rate, gains, dt)
    follow_roll(state, gains, memory, commands, bank, rate, turn, dt)


@compiled
def follow_roll(
    state: Record, gains: Record, memory: Record, commands: Record, bank: float, rate: float, turn: float, dt: float
) -> None:  # pragma: no cover - compiled
    """Aileron and rudder for a roll that is given: bank (rad), roll rate (rad/s) and roll acceleration (rad/s^2).

    The ailerons get what this roll takes, what is left of the error, and, against gusts and the propeller, what rolled
    the aircraft beyond its ailerons' own doing.
    """
    airspeed = max(8.0, state.airspeed)
    scale = gains.reference_airspeed / airspeed
    memory.bank, memory.bank_rate = bank, rate
    per_rate, per_acceleration = (
        gains.aileron_per_roll_rate * scale,
        gains.aileron_per_roll_acceleration * scale * scale,
    )
    rolled = (
        per_acceleration * (state.roll_rate - memory.last_roll_rate) / dt + per_rate * state.roll_rate - state.aileron
    )
    memory.last_roll_rate = state.roll_rate
    memory.roll_disturbance += (rolled - memory.roll_disturbance) * min(1.0, dt / gains.roll_disturbance_lag)
    commands.aileron = (
        per_rate * rate
        + (per_acceleration + gains.aileron_lead * per_rate) * turn
        + gains.roll_gain * scale * scale * (memory.bank - state.roll)
        + gains.roll_rate_gain * scale * scale * (rate - state.roll_rate)
        - memory.roll_disturbance
    )
    yaw_rate = GRAVITY / airspeed * math.sin(state.roll) * math.cos(state.pitch)
    commands.rudder = (
        -gains.rudder_per_yaw_rate * scale * yaw_rate
        - gains.yaw_rate_gain * scale * (yaw_rate - state.yaw_rate)
        - gains.sideslip_gain * (state.beta - memory.sideslip)
    )
