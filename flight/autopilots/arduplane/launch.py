"""Compute when ArduPlane starts the motor of a launched aircraft.

ArduPlane decides by acceleration, speed and attitude.

With TKOFF_THR_MINACC ArduPlane waits for an acceleration along the nose, and then for TKOFF_THR_DELAY. Within a tenth
of a second after that the ground speed must be above TKOFF_THR_MINSPD, and the nose between -30 and 45 degrees;
otherwise ArduPlane waits for an acceleration again (`Plane::auto_takeoff_check`, ArduPlane/takeoff.cpp, of ArduPlane
4.6). Without TKOFF_THR_MINACC it waits only for the speed; without both parameters the motor starts with the mission.
"""

import math

from flight.autopilots.arduplane.parameters import ArduPilotParameters

# Interval between ArduPlane's checks, s.
_CHECK_INTERVAL_S = 0.02
# Time after the delay within which the ground speed must be reached, s.
_SPEED_TIMEOUT_S = 0.1
# Range of pitch within which ArduPlane accepts a launch, rad.
_PITCH_RANGE_RAD = (math.radians(-30.0), math.radians(45.0))
# Time after the release at which a motor that has not started is assumed never to start, s.
_MOTOR_START_TIMEOUT_S = 5.0


def motor_start_time(acceleration: float, speed: float, incline: float, parameters: ArduPilotParameters) -> float:
    """Return the time from the release to the motor start, s; negative if the motor starts on the rail.

    The result is inf if the motor never starts, and -inf if the motor runs before the launch.

    acceleration: steady acceleration along the rail, m/s^2; 0 for a runway.
    speed: ground speed at the end of the rail, m/s.
    incline: pitch of the nose, rad.

    On a rail of 6 m an aircraft reaches 20 m/s in 0.6 s with 33 m/s^2, and 10 m/s with 8.3 m/s^2. Only the first
    acceleration exceeds TKOFF_THR_MINACC 15:

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> parameters = ArduPilotParameters.defaults().changed(TKOFF_THR_MINACC=15.0)
    >>> [round(motor_start_time(v * v / 12.0, v, 0.2, parameters), 2) for v in (20.0, 10.0)]
    [-0.4, inf]
    >>> motor_start_time(0.0, 0.0, 0.0, ArduPilotParameters.defaults()), motor_start_time(0.0, 0.0, 0.0, parameters)
    (-inf, inf)
    """
    min_acceleration, delay = parameters.takeoff_acceleration, parameters.takeoff_delay
    if min_acceleration <= 0.0 and parameters.takeoff_ground_speed <= 0.0:
        return -math.inf
    push_time = speed / acceleration if acceleration > 0.0 else 0.0
    push_start = math.nan
    for check in range(round((push_time + _MOTOR_START_TIMEOUT_S) / _CHECK_INTERVAL_S)):
        time = check * _CHECK_INTERVAL_S - push_time
        # The horizontal part of the acceleration on the rail; after the rail the aircraft slows down.
        measured_acceleration = acceleration if time < 0.0 else 0.0
        if math.isnan(push_start):
            if measured_acceleration < min_acceleration:
                continue
            push_start = time
        if time - push_start > delay + _SPEED_TIMEOUT_S or not _PITCH_RANGE_RAD[0] < incline < _PITCH_RANGE_RAD[1]:
            push_start = math.nan
            continue
        ground_speed = speed * math.cos(incline) * min(1.0, 1.0 + time / push_time if push_time else 1.0)
        if time - push_start >= delay - 1e-9 and (
            ground_speed > parameters.takeoff_ground_speed or parameters.takeoff_ground_speed <= 0.0
        ):
            return time
    return math.inf


def takeoff_slew(parameters: ArduPilotParameters) -> float:
    """Return the throttle slew rate of a take-off, fraction of the throttle range per s; inf for no limit.

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> [takeoff_slew(ArduPilotParameters.defaults().changed(TKOFF_THR_SLEW=slew)) for slew in (0.0, -1.0, 50.0)]
    [1.0, inf, 0.5]
    """
    if parameters.takeoff_slew < 0.0:
        return math.inf
    return parameters.takeoff_slew or parameters.throttle_slew or math.inf


def run_up_time(start_time: float, parameters: ArduPilotParameters) -> float:
    """Return the time that the motor needs on the ground to reach full throttle, s.

    The time is 0 if the motor starts during the launch or after it.

    start_time: result of `motor_start_time`, s; -inf if the motor starts on the ground before the launch.

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> parameters = ArduPilotParameters.defaults()
    >>> round(run_up_time(-math.inf, parameters), 2), run_up_time(-0.4, parameters)
    (1.2, 0.0)
    """
    return parameters.takeoff_delay + 1.0 / takeoff_slew(parameters) if start_time == -math.inf else 0.0
