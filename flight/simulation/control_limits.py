"""The aircraft's controls: their limits, and when a flight asked for all that they give."""

import math

import numpy as np
from numpy.typing import NDArray

from aircraft.catalog import load_aircraft
from flight.simulation.track import Track
from world.errors import FlightError

# A control counts as at its limit within this share of its range.
_EDGE = 1e-3


def control_limits(aircraft: str) -> list[tuple[str, float]]:
    """Each control and its limit either way (rad; 1 for the throttle; NaN for an aircraft that is not known).

    >>> for name, limit in control_limits("aerosonde"):
    ...     print(f"{name} {limit:.2f}")
    elevator 0.52
    aileron 0.52
    rudder 0.52
    throttle 1.00
    """
    try:
        known = load_aircraft(aircraft)
    except FlightError:
        limits = (math.nan, math.nan, math.nan)
    else:
        limits = (known.max_elevator, known.max_aileron, known.max_rudder)
    return list(zip(("elevator", "aileron", "rudder", "throttle"), (*limits, 1.0), strict=True))


def held_at_limit(track: Track, k: int, low: float, high: float) -> NDArray[np.bool_]:
    """Rows at which control k (a column of `Track.commands`) is asked for its limit or more, (t,).

    low, high: its limits; none of the rows for NaN.

    >>> from flight.simulation.track import THROTTLE, TRACK_ROW, as_track
    >>> rows = np.zeros(3, TRACK_ROW)
    >>> rows["commands"][:, THROTTLE] = 0.5, 1.0, 0.9
    >>> held_at_limit(as_track(rows), THROTTLE, 0.0, 1.0)
    array([False,  True, False])
    """
    command = track.commands[:, k].astype(np.float64)
    edge = _EDGE * (high - low)
    return np.asarray((command <= low + edge) | (command >= high - edge))
