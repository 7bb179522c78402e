"""Inner loops on roll, pitch and yaw rate, which every law shares, and what guidance keeps from tick to tick."""

import math

import numpy as np

from aircraft.envelope import GRAVITY
from world.kernels import Record, inner, record_dtype

# What guidance keeps from tick to tick, and what one tick leaves for the track.
GUIDANCE_MEMORY = record_dtype(
    # Set before the first tick.
    ("law", np.int64),  # of planfly's guidance: a value of `flight.autopilots.planfly.law.LAWS`
    "max_bank",  # rad, of the command
    "trim_elevator",  # rad, of level flight at the reference airspeed
    "trim_alpha",  # rad
    "trim_throttle",  # 0..1
    "stall_speed",  # m/s, equivalent
    # Where on the path.
    ("piece", np.int64),  # index of the piece of the path
    ("leg", np.int64),
    "distance",  # m along the path
    "cross_track",  # m right of the path
    "height_error",  # m above it
    "speed_command",  # m/s
    ("done", np.bool_),  # past the end of the path
    ("returning", np.bool_),  # on a way back that the autopilot finds by itself: it cannot miss the path's end
    "circled",  # s since it came to the circle at the end of that way, and to its height
    "turned",  # rad around it since then, positive to the right
    "bearing",  # rad, from its middle, a tick ago
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
    "bend_acceleration",  # m/s^2 upwards, of the path ahead
    # Roll.
    "bank",  # rad, of the model roll
    "bank_rate",  # rad/s, of the model roll
    "last_roll_rate",  # rad/s, a tick ago
    "roll_disturbance",  # rad of aileron that gusts and the propeller amount to
)


@inner
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


@inner
def roll_model(
    wanted: float, bank: float, rate: float, gains: Record, dt: float
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Bank (rad), roll rate and roll acceleration a tick on of an aircraft that rolls as ours shall.

    A critically damped oscillator within limits of roll rate and acceleration.
    """
    frequency = gains.roll_frequency
    limit = gains.roll_acceleration_max
    change = min(limit, max(-limit, frequency * (frequency * (wanted - bank) - 2.0 * rate)))
    limit = gains.roll_rate_max
    change = min((limit - rate) / dt, max((-limit - rate) / dt, change))
    rate += change * dt
    return bank + rate * dt, rate, change


@inner
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
