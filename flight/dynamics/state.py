"""The packed arrays that pass between JSBSim and the guidance core: one index a quantity, SI and radians."""

from enum import IntEnum


class S(IntEnum):
    """Rows of the state array, written by `flight.dynamics.fdm.Fdm.read`."""

    TIME = 0  # s since the start
    LATITUDE = 1  # rad, geodetic
    LONGITUDE = 2  # rad
    AMSL = 3  # m
    V_NORTH = 4  # m/s over the ground
    V_EAST = 5
    V_DOWN = 6
    ROLL = 7  # rad
    PITCH = 8
    YAW = 9  # rad clockwise from true north
    P = 10  # rad/s, body rates
    Q = 11
    R = 12
    AIRSPEED = 13  # m/s, true
    ALPHA = 14  # rad
    BETA = 15
    ELEVATOR = 16  # rad, the surface after its actuator, trailing edge down positive
    AILERON = 17
    RUDDER = 18
    THROTTLE = 19  # 0..1, after the motor's lag
    CURRENT = 20  # A from the battery
    POWER = 21  # W from the battery
    ACCEL_N = 22  # normal load factor, g, 1 in level flight
    WIND_NORTH = 23  # m/s, total with gusts, the way the air moves
    WIND_EAST = 24
    WIND_DOWN = 25


class C(IntEnum):
    """Rows of the command array, read by `flight.dynamics.fdm.Fdm.write`."""

    ELEVATOR = 0  # rad
    AILERON = 1
    RUDDER = 2
    THROTTLE = 3  # 0..1


STATE_SIZE = len(S)
COMMAND_SIZE = len(C)
