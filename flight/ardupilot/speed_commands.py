"""Which of a mission's airspeeds ArduPlane takes up."""

import numpy as np
from numpy.typing import NDArray

from flight.ardupilot.parameters import ArduPilotParameters

Floats = NDArray[np.float64]


def takes_speed(airspeed: float, parameters: ArduPilotParameters) -> bool:
    """Whether ArduPlane takes a commanded airspeed (m/s, equivalent): from AIRSPEED_MIN to AIRSPEED_MAX.

    A command of another speed changes nothing: told to fly at 17 m/s with AIRSPEED_MIN at 18, ArduPlane 4.6 flew on at
    its 25.

    >>> from flight.ardupilot.parameters import default_parameters
    >>> takes_speed(22.0, default_parameters()), takes_speed(22.1, default_parameters())
    (True, False)
    """
    return parameters.airspeed_min <= airspeed <= parameters.airspeed_max


def speeds_flown(commanded: Floats, cruise: float, parameters: ArduPilotParameters) -> Floats:
    """Airspeeds (l,) that ArduPlane flies on each leg, of those commanded (l,); m/s, equivalent.

    cruise: its airspeed until it takes up the first.

    >>> from flight.ardupilot.parameters import default_parameters
    >>> speeds_flown(np.array([8.0, 15.0, 30.0, 10.0]), 12.0, default_parameters()).tolist()
    [12.0, 15.0, 15.0, 10.0]
    """
    flown = []
    speed = cruise
    for wanted in commanded.tolist():
        speed = wanted if takes_speed(wanted, parameters) else speed
        flown.append(speed)
    return np.array(flown)
