"""Define the state and commands that JSBSim and the guidance core exchange, in SI units and radians."""

from typing import NamedTuple

from world.kernels import record_dtype

# The state that `flight.dynamics.fdm.Fdm.read` returns.
STATE = record_dtype(
    "latitude",  # rad, geodetic
    "longitude",  # rad
    "amsl",  # m
    "velocity_north",  # m/s over the ground
    "velocity_east",
    "velocity_down",
    "roll",  # rad
    "pitch",
    "yaw",  # rad clockwise from true north
    "roll_rate",  # rad/s, about the body's axes
    "pitch_rate",
    "yaw_rate",
    "airspeed",  # m/s, true
    "alpha",  # rad
    "beta",
    "elevator",  # rad, the surface after its actuator, trailing edge down positive
    "aileron",
    "rudder",
    "throttle",  # 0..1, after the motor's lag
    "current",  # A from the battery
    "power",  # W from the battery
    "load_factor",  # g, normal to the wing, 1 in level flight
    "time",  # s since the start
    "wind_north",  # m/s, total with gusts, direction of air motion
    "wind_east",
    "wind_down",
)


class Commands(NamedTuple):
    """The four commands that `flight.dynamics.fdm.Fdm.write` sets.

    elevator, aileron, rudder: rad, positive with the trailing edge down, to roll right, to yaw left.
    throttle: 0..1.
    """

    elevator: float
    aileron: float
    rudder: float
    throttle: float


# The four commands as compiled code takes them: a record of the fields of `Commands`.
COMMANDS = record_dtype(*Commands._fields)
