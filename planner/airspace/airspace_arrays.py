"""The airspace of a problem for compiled code: zones, and the greatest height above ground."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.airspace.kept_zones import KeptZones, ZoneMargins, keep_zones
from world.scenario import Scenario

Floats = NDArray[np.float64]
Heights = NDArray[np.float32]


class KeptAirspace(NamedTuple):
    """Where a path may be beside the map, its floor and its ceiling; lengths in m.

    zones: to keep out of, and to stay in.
    max_height: greatest height above ground, inf for none.
    buffer: kept below it, and start_buffer and destination_buffer at the ends.
    depths: the ground's heights, the other sign: seen from below, what is not to be exceeded is what is to be cleared.
    """

    zones: KeptZones
    max_height: float
    buffer: float
    start_buffer: float
    destination_buffer: float
    depths: Heights


def keep_airspace(scenario: Scenario, margins: ZoneMargins, buffer: float) -> KeptAirspace:
    """The airspace of a scenario with what is kept from it.

    buffer: kept below the greatest height, m; where a fixed end leaves less, the margins' share of that.

    >>> from world.scenario import load_scenario
    >>> space = keep_airspace(load_scenario("tight"), ZoneMargins(10.0, 5.0, 1.0), 5.0)
    >>> space.max_height, len(space.zones.kept)
    (inf, 0)
    """
    terrain, most = scenario.terrain, scenario.limits.max_height_m
    ends = np.stack([scenario.start, scenario.destination])
    zones = keep_zones(scenario.zones, ends, terrain, margins)
    asked = most is not None or any(zone.above_ground for zone in scenario.zones)
    # Where nobody asks for them, next to nothing that fits.
    depths = -terrain.heights if terrain is not None and asked else np.zeros((2, 2), dtype=np.float32)
    depths.setflags(write=False)
    buffers = [buffer, buffer]
    if most is not None and terrain is not None:
        left = most - (ends[:, 2] - terrain.height(ends[:, 0], ends[:, 1])) - 0.01
        buffers = [buffer if one >= buffer else margins.share * max(0.0, float(one)) for one in left]
    return KeptAirspace(zones, math.inf if most is None else most, buffer, buffers[0], buffers[1], depths)


def is_limited(airspace: KeptAirspace) -> bool:
    """Whether there is a zone or a greatest height.

    >>> from world.scenario import load_scenario
    >>> is_limited(keep_airspace(load_scenario("tight"), ZoneMargins(10.0, 5.0, 1.0), 5.0))
    False
    """
    return len(airspace.zones.kept) > 0 or airspace.max_height < math.inf
