"""When ArduPlane starts the motor of a launched aircraft: what its acceleration, its speed and its attitude say.

With TKOFF_THR_MINACC it waits for an acceleration along the nose, and from there TKOFF_THR_DELAY; then the ground speed
has to be above TKOFF_THR_MINSPD within a tenth of a second, and the nose between -30 and 45 degrees, or it waits anew
(`Plane::auto_takeoff_check`, ArduPlane/takeoff.cpp, of ArduPlane 4.6).  Without MINACC it waits for the speed alone,
and without either the motor runs as soon as the mission does.
"""

import math

from flight.autopilots.arduplane.parameters import ArduPilotParameters

# It looks so often, s, and gives up waiting for the speed so long after the delay, s.
_LOOK, _PATIENCE = 0.02, 0.1
# Nose up, between which it takes a launch for one, rad.
_NOSE = (math.radians(-30.0), math.radians(45.0))
# A launched aircraft that has not got its motor after so long flies without, s.
_LATEST = 5.0


def motor_start(acceleration: float, speed: float, incline: float, parameters: ArduPilotParameters) -> float:
    """When the motor starts, s after the release, negative on the rail; inf for never, -inf for before the launch.

    acceleration: steady along the rail, m/s^2; 0 for a runway.  speed: at its end over the ground, m/s.
    incline: of the nose, rad.

    A rail of 6 m takes 0.6 s to 20 m/s, at 33 m/s^2; 10 m/s are 8.3 m/s^2.

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> made = ArduPilotParameters.defaults().changed(TKOFF_THR_MINACC=15.0)
    >>> [round(motor_start(v * v / 12.0, v, 0.2, made), 2) for v in (20.0, 10.0)]
    [-0.4, inf]
    >>> motor_start(0.0, 0.0, 0.0, ArduPilotParameters.defaults()), motor_start(0.0, 0.0, 0.0, made)
    (-inf, inf)
    """
    least, delay = parameters.takeoff_acceleration, parameters.takeoff_delay
    if least <= 0.0 and parameters.takeoff_ground_speed <= 0.0:
        return -math.inf
    pushed = speed / acceleration if acceleration > 0.0 else 0.0
    began = math.nan
    for k in range(round((pushed + _LATEST) / _LOOK)):
        now = k * _LOOK - pushed
        # The level part of what the accelerometer feels on the rail; after it the aircraft slows down.
        felt = acceleration if now < 0.0 else 0.0
        if math.isnan(began):
            if felt < least:
                continue
            began = now
        if now - began > delay + _PATIENCE or not _NOSE[0] < incline < _NOSE[1]:
            began = math.nan
            continue
        over_ground = speed * math.cos(incline) * min(1.0, 1.0 + now / pushed if pushed else 1.0)
        if now - began >= delay - 1e-9 and (
            over_ground > parameters.takeoff_ground_speed or parameters.takeoff_ground_speed <= 0.0
        ):
            return now
    return math.inf


def takeoff_slew(parameters: ArduPilotParameters) -> float:
    """How fast the throttle opens in a take-off, of its range a second; inf for at once.

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> [takeoff_slew(ArduPilotParameters.defaults().changed(TKOFF_THR_SLEW=slew)) for slew in (0.0, -1.0, 50.0)]
    [1.0, inf, 0.5]
    """
    if parameters.takeoff_slew < 0.0:
        return math.inf
    return parameters.takeoff_slew or parameters.throttle_slew or math.inf


def run_up(starts: float, parameters: ArduPilotParameters) -> float:
    """How long whoever launches waits for all of the motor, s; 0 where it starts on the rail, in the hand or later.

    starts: what `motor_start` says.

    >>> from flight.autopilots.arduplane.parameters import ArduPilotParameters
    >>> round(run_up(-math.inf, ArduPilotParameters.defaults()), 2), run_up(-0.4, ArduPilotParameters.defaults())
    (1.2, 0.0)
    """
    return parameters.takeoff_delay + 1.0 / takeoff_slew(parameters) if math.isinf(starts) and starts < 0.0 else 0.0
