"""Implement the inner loops of roll, pitch and yaw rate, and the state of the guidance.

All control laws share these loops.
"""

import math

import numpy as np

from aircraft.envelope import GRAVITY
from world.kernels import Record, inner, record_dtype

# Internal state of the guidance, kept from tick to tick, and values of the current tick for the track.
GUIDANCE_MEMORY = record_dtype(
    # Set before the first tick.
    ("lateral_law", np.int64),  # lateral law of planfly's guidance: a value of `flight.autopilots.planfly.law.LAWS`
    "max_bank",  # rad, limit of the bank command
    "trim_elevator",  # rad, of level flight at the reference airspeed
    "trim_alpha",  # rad
    "trim_throttle",  # 0..1
    "stall_speed",  # m/s, equivalent
    # Position on the path.
    ("piece", np.int64),  # index of the piece of the path
    ("leg", np.int64),
    "distance",  # m along the path
    "cross_track",  # m right of the path
    "height_error",  # m above the path
    "speed_command",  # m/s, commanded airspeed
    ("is_finished", np.bool_),  # past the end of the path
    ("is_in_rtl", np.bool_),  # on an RTL that the autopilot flies by itself and that cannot miss the path's end
    "loiter_time",  # s since the aircraft arrived at the loiter of that RTL, at the loiter's altitude
    "loiter_angle",  # rad flown around the loiter since then, positive to the right
    "bearing",  # rad, bearing from the loiter's center, a tick ago
    # Lateral: the cross-track law.
    "cross_track_integrator",  # m s
    "last_velocity_east",  # m/s over the ground, a tick ago
    "last_velocity_north",
    "last_velocity_up",
    "unexplained_acceleration",  # m/s^2 to the right that bank and ailerons do not explain
    "path_bank",  # rad and rad/s, model roll for the path's curvature alone
    "path_bank_rate",
    "roll_offset",  # m right of the path and m/s, offset caused by that roll
    "roll_offset_rate",
    "smoothed_correction",  # m/s^2 to the right, smoothed correction of errors
    "sideslip",  # rad, sideslip setpoint
    "max_arc_speed",  # m/s, maximum ground speed for the sharpest arc close ahead; 0 for no limit
    # Lateral: the reference laws.
    ("l1_leg", np.int64),  # the leg that L1 is on
    "l1_integrator",  # rad
    "course_integrator",  # rad s, of the vector field
    # Vertical.
    "altitude_integrator",  # m s
    "speed_integrator",  # m
    "energy_height_rate",  # m/s, filtered rate of total energy height
    "last_airspeed",  # m/s, negative before the first tick
    "filtered_airspeed",  # m/s, without gusts
    "slope_acceleration",  # m/s^2 upwards, required by the path's change of slope
    # Roll.
    "bank",  # rad, of the model roll
    "bank_rate",  # rad/s, of the model roll
    "last_roll_rate",  # rad/s, a tick ago
    "roll_disturbance",  # rad of aileron, equivalent of gusts and propeller torque
)


@inner
def steer_elevator(
    state: Record, gains: Record, memory: Record, commands: Record, climb_rate: float, acceleration: float
) -> None:
    """Set the elevator for a demanded upward acceleration.

    The command is a feed-forward from the angle of attack, plus pitch-rate damping.

    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    gains, memory: a `GAINS` record, and a `GUIDANCE_MEMORY` record with the trimmed elevator and angle of attack.
    commands: `COMMANDS` record, whose elevator is set.
    climb_rate: current climb rate, m/s.
    acceleration: demanded acceleration, m/s^2, positive upwards.
    """
    airspeed = max(8.0, state.airspeed)
    # Lift responds more slowly than roll: use the bank predicted by the lead.
    roll = state.roll
    predicted_bank = roll + gains.load_lead * memory.bank_rate
    climb_angle = math.asin(min(1.0, max(-1.0, climb_rate / airspeed)))
    load_factor = (acceleration / GRAVITY + math.cos(climb_angle)) / max(0.4, math.cos(predicted_bank))
    load_factor = min(3.0, max(0.0, load_factor))
    inverse_pressure_ratio = (gains.reference_airspeed / airspeed) ** 2
    alpha = gains.alpha_per_g * (load_factor * inverse_pressure_ratio - 1.0)
    alpha = min(0.25 - memory.trim_alpha, max(-0.12 - memory.trim_alpha, alpha))
    turn_rate = GRAVITY / airspeed * math.tan(predicted_bank) * math.sin(predicted_bank)
    pitch_rate = turn_rate + acceleration / airspeed * math.cos(roll)
    inverse_speed_ratio = gains.reference_airspeed / airspeed
    commands.elevator = (
        memory.trim_elevator
        + gains.elevator_per_alpha * alpha
        + gains.elevator_per_pitch_rate * inverse_speed_ratio * pitch_rate
        + gains.pitch_rate_gain * inverse_speed_ratio * (state.pitch_rate - pitch_rate)
    )


@inner
def step_roll_model(
    bank_demand: float, bank: float, roll_rate: float, gains: Record, dt: float
) -> tuple[float, float, float]:
    """Advance the roll model by one tick.

    Return its bank (rad), roll rate (rad/s) and roll acceleration (rad/s^2).

    The model is a critically damped oscillator with limits of roll rate and roll acceleration.

    bank_demand: bank that the model is to reach, rad.
    bank, roll_rate: state of the model at the previous tick, rad and rad/s.
    """
    frequency = gains.roll_frequency
    acceleration_max, rate_max = gains.roll_acceleration_max, gains.roll_rate_max
    roll_acceleration = frequency * (frequency * (bank_demand - bank) - 2.0 * roll_rate)
    roll_acceleration = min(acceleration_max, max(-acceleration_max, roll_acceleration))
    roll_acceleration = min((rate_max - roll_rate) / dt, max((-rate_max - roll_rate) / dt, roll_acceleration))
    roll_rate += roll_acceleration * dt
    return bank + roll_rate * dt, roll_rate, roll_acceleration


@inner
def follow_roll(
    state: Record,
    gains: Record,
    memory: Record,
    commands: Record,
    bank: float,
    roll_rate: float,
    roll_acceleration: float,
    dt: float,
) -> None:
    """Set aileron and rudder so that the aircraft follows the roll model.

    memory: a `GUIDANCE_MEMORY` record; bank, roll rate and the estimated roll disturbance are stored in it.
    commands: a `COMMANDS` record, whose aileron and rudder are set.
    bank, roll_rate, roll_acceleration: state of the roll model at this tick, rad, rad/s and rad/s^2.

    The aileron command has three parts: the deflection for the roll of the model, a feedback of the remaining error,
    and a compensation of gusts and propeller torque. Gusts and torque are estimated from the roll that the ailerons do
    not explain.
    """
    airspeed = max(8.0, state.airspeed)
    inverse_speed_ratio = gains.reference_airspeed / airspeed
    memory.bank, memory.bank_rate = bank, roll_rate
    aileron_per_rate = gains.aileron_per_roll_rate * inverse_speed_ratio
    aileron_per_acceleration = gains.aileron_per_roll_acceleration * inverse_speed_ratio * inverse_speed_ratio
    disturbance = (
        aileron_per_acceleration * (state.roll_rate - memory.last_roll_rate) / dt
        + aileron_per_rate * state.roll_rate
        - state.aileron
    )
    memory.last_roll_rate = state.roll_rate
    memory.roll_disturbance += (disturbance - memory.roll_disturbance) * min(1.0, dt / gains.roll_disturbance_lag)
    commands.aileron = (
        aileron_per_rate * roll_rate
        + (aileron_per_acceleration + gains.aileron_lead * aileron_per_rate) * roll_acceleration
        + gains.roll_gain * inverse_speed_ratio * inverse_speed_ratio * (memory.bank - state.roll)
        + gains.roll_rate_gain * inverse_speed_ratio * inverse_speed_ratio * (roll_rate - state.roll_rate)
        - memory.roll_disturbance
    )
    yaw_rate = GRAVITY / airspeed * math.sin(state.roll) * math.cos(state.pitch)
    commands.rudder = (
        -gains.rudder_per_yaw_rate * inverse_speed_ratio * yaw_rate
        - gains.yaw_rate_gain * inverse_speed_ratio * (yaw_rate - state.yaw_rate)
        - gains.sideslip_gain * (state.beta - memory.sideslip)
    )
