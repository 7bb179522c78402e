"""Heights for a plan that states none: those at which the flight passed."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flight.mission.items import Mission
from logs.field_logs.clean_places import DEGREE

Floats = NDArray[np.float64]


def with_flown_heights(mission: Mission, lat: Floats, lon: Floats, up: Floats) -> Mission:
    """A mission whose items have the height (m) of the row (n,) nearest to each.

    >>> from flight.mission.items import MissionItem
    >>> task = Mission(None, tuple(MissionItem(k, 16, 0, (0.0,) * 4, 46.0 + k, 8.0, 0.0) for k in (0, 1)))
    >>> flown = with_flown_heights(task, np.array([46.0, 47.0]), np.array([8.0, 8.0]), np.array([900.0, 1500.0]))
    >>> [item.alt for item in flown.items]
    [900.0, 1500.0]
    """
    known = np.isfinite(up)
    heights = up[known] if known.any() else np.zeros(len(up))
    lat, lon = (lat[known], lon[known]) if known.any() else (lat, lon)
    items = []
    for item in mission.items:
        if item.has_position and heights.size:
            east = ((lon - item.lon_deg + 180.0) % 360.0 - 180.0) * np.cos(np.radians(item.lat_deg))
            away = np.hypot((lat - item.lat_deg) * DEGREE, east * DEGREE)
            items.append(replace(item, alt=round(float(heights[int(np.argmin(away))]), 2)))
        else:
            items.append(item)
    return replace(mission, items=tuple(items))
