"""The wind of a flight, as its autopilot estimated it."""

import math
from dataclasses import dataclass

import numpy as np

from logs.field_logs.field_flight import FieldFlight

# m/s.  The most that a scenario's wind may have.
_MOST = 30.0


@dataclass(frozen=True, slots=True)
class MeanWind:
    """Mean wind: m/s, rad clockwise from north where it comes from, and the message it is of."""

    speed: float
    from_course: float
    source: str


def mean_wind(flight: FieldFlight) -> MeanWind | None:
    """The mean over the stretches that followed the mission, or over the flight; None where the log holds none.

    The estimate's first part is left out: it begins at nothing, and finds the wind in the first turns.

    >>> from logs.field_logs.example_raw_log import example_raw_log
    >>> from logs.field_logs.field_flight import make_flight
    >>> mean_wind(make_flight(example_raw_log()))
    MeanWind(speed=3.0, from_course=0.0, source='XKF2')
    """
    wind = flight.columns["wind"]
    inside = np.zeros(len(flight.time), bool)
    for stretch in flight.stretches:
        inside |= (flight.time >= stretch.start) & (flight.time <= stretch.end)
    chosen = np.flatnonzero(np.isfinite(wind).all(axis=1) & (inside if inside.any() else True))
    if not chosen.size:
        return None
    east, north = wind[chosen[len(chosen) // 5 :]].mean(axis=0).tolist()
    speed = min(_MOST, math.hypot(east, north))
    return MeanWind(speed, math.atan2(-east, -north) % (2.0 * math.pi), flight.raw.series["wind"].source)
