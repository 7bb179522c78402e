"""What guidance keeps from tick to tick, and what one tick leaves for the track."""

import numpy as np

from world.kernels import record_dtype

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
