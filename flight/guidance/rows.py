"""Rows of the packed arrays that the guidance core reads and keeps."""

from enum import IntEnum


class G(IntEnum):
    """Rows of the packed gains, in the order of `flight.guidance.gains.Gains`."""

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
    AILERON_PER_ROLL_ACCELERATION = 18
    ALPHA_PER_G = 19
    ELEVATOR_PER_ALPHA = 20
    ELEVATOR_PER_PITCH_RATE = 21
    PITCH_RATE_GAIN = 22
    YAW_RATE_GAIN = 23
    L1_PERIOD = 24
    L1_DAMPING = 25
    L1_INTEGRAL = 26
    FIELD_APPROACH = 27
    FIELD_PATH = 28
    FIELD_ORBIT = 29
    FIELD_COURSE = 30
    FIELD_COURSE_INTEGRAL = 31
    SIDE_GAIN = 32
    SIDE_LAG = 33
    ROLL_FREQUENCY = 34
    ROLL_RATE_MAX = 35
    ROLL_ACCELERATION_MAX = 36
    ROLL_DISTURBANCE_LAG = 37
    AILERON_LEAD = 38
    LOAD_LEAD = 39
    SIDE_PER_AILERON = 40
    RUDDER_PER_YAW_RATE = 41
    SIDESLIP_GAIN = 42
    SIDE_PER_SIDESLIP = 43
    SIDESLIP_MAX = 44
    ARC_SLOWING_TIME = 45
    ARC_SLOWING_MAX = 46
    ASIDE_FREQUENCY = 47
    PUSH_LEAD = 48
    PUSH_SMOOTHING = 49


class Lateral(IntEnum):
    """Which law steers, by its name in a scenario's `[flight] guidance`."""

    PATH = 0
    L1 = 1
    VECTOR_FIELD = 2


class M(IntEnum):
    """Rows of the guidance memory and of what one tick leaves for the log."""

    PIECE = 0  # index of the piece of the path
    CROSS_TRACK_SUM = 1  # m s
    HEIGHT_SUM = 2  # m s
    SPEED_SUM = 3  # m
    BANK = 4  # rad, of the model roll
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
    GUIDANCE = 19  # a `Lateral`
    L1_LEG = 20  # the leg that L1 is on
    L1_SUM = 21  # rad
    COURSE_SUM = 22  # rad s, of the vector field
    LAST_EAST = 23  # m/s over the ground, a tick ago
    LAST_NORTH = 24
    SIDE = 25  # m/s^2 to the right that the bank does not explain
    BANK_RATE = 26  # rad/s, of the model roll
    LAST_ROLL_RATE = 27  # rad/s, a tick ago
    ROLLED = 28  # rad of aileron that gusts and the propeller amount to
    LAST_UP = 29  # m/s, a tick ago
    BEND = 30  # m/s^2 upwards, of the path ahead
    SIDESLIP = 31  # rad, wanted
    PATH_BANK = 33  # rad and rad/s, of the model roll into the path's curvature alone
    PATH_BANK_RATE = 34
    ASIDE = 35  # m right of the path and m/s, where that roll takes it
    ASIDE_RATE = 36
    PUSH = 37  # m/s^2 to the right that corrects errors, smoothed
    ARC_SPEED = 32  # m/s over the ground, of the sharpest arc near ahead; 0 for no limit


MEMORY_SIZE = len(M)
