"""Limits with the tracking error of an autopilot, from plain numbers."""

import math
from dataclasses import replace

import numpy as np

from aircraft.path_limits import Limits
from aircraft.tracking import SPEED_RATIOS, TURNS, TrackingError


def with_tracking_error(
    limits: Limits, *, excursion: float = 20.0, before: float = 50.0, after: float = 200.0, **more: float
) -> Limits:
    """Limits with a tracking error that grows with the turn; the lengths (m) are those of a right angle."""
    share = np.outer(TURNS / (0.5 * math.pi), np.ones(SPEED_RATIOS.size))
    numbers = {"across": 0.0, "up": 0.0, "lag": 0.0, "step": 0.0} | more
    error = TrackingError(
        airspeed=limits.airspeed,
        acceptance=before * share,
        excursion=excursion * share,
        before=before * share,
        after=after * share,
        **numbers,
    )
    return replace(limits, tracking=error)
