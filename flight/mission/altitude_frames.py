"""Find items whose altitude fits the terrain only in another frame.

The frames are above mean sea level and above home.

The altitude frame of an item is one number in a mission file (0 above mean sea level, 3 above home), and a wrong one
moves the item by the altitude of home. The number of the item then still looks right in a ground station's list.
"""

import math
import statistics
from typing import NamedTuple

from flight.mission.edits import movable_indices
from flight.mission.items import AMSL, LANDINGS, OVER_HOME, Mission, MissionItem
from world.frames import GeoOrigin, to_map
from world.terrain import Terrain

# Greatest height of a landing point above or below the ground with the right altitude frame, m.
LANDING_HEIGHT_TOLERANCE_M = 30.0


class AltitudeReading(NamedTuple):
    """Two heights of an item above ground, m: its altitude read in the stated and in the other frame.

    item_index: index of the item in the mission.
    height: height with the frame that the item states.
    other_height: height with the other frame.
    """

    item_index: int
    height: float
    other_height: float


def find_misread_altitudes(
    mission: Mission, origin: GeoOrigin, terrain: Terrain | None
) -> tuple[tuple[AltitudeReading, ...], tuple[AltitudeReading, ...]]:
    """Find the items whose altitudes fit the terrain only in the other altitude frame.

    Returns two tuples. The first has the items with an altitude AMSL that lie below the ground, but would lie above it
    if the number were a height above home. The second has the items with a height above home that is probably an
    altitude AMSL: see `_find_readings_too_high`.
    Both are empty if the ground or the altitude of home is unknown, and if home is near sea level.
    """
    home = mission.home
    if home is None or terrain is None or not home.alt > LANDING_HEIGHT_TOLERANCE_M:
        return (), ()
    below_ground, above_home, amsl_altitudes = [], [], []
    for k in movable_indices(mission):
        item = mission.items[k]
        east, north = to_map(origin, item.lat_deg, item.lon_deg)
        amsl_height = item.alt - float(terrain.height(float(east), float(north)))
        home_height = amsl_height + home.alt
        if item.frame in AMSL and amsl_height < 0.0 <= home_height + _height_tolerance(item):
            below_ground.append(AltitudeReading(k, amsl_height, home_height))
        elif item.frame in AMSL and amsl_height >= 0.0:
            amsl_altitudes.append(item.alt)
        elif item.frame in OVER_HOME:
            above_home.append(AltitudeReading(k, home_height, amsl_height))
    return tuple(below_ground), tuple(
        _find_readings_too_high(mission, home.alt, above_home, min(amsl_altitudes, default=math.inf))
    )


def _height_tolerance(item: MissionItem) -> float:
    """Return the depth below the ground, m, up to which an item's altitude is still plausible.

    For a landing point the depth allows for errors of the terrain map and of home. For other items it is 0.
    """
    return LANDING_HEIGHT_TOLERANCE_M if item.command in LANDINGS else 0.0


def _find_readings_too_high(
    mission: Mission, home_altitude: float, readings: list[AltitudeReading], lowest_amsl: float
) -> list[AltitudeReading]:
    """Return the readings of heights above home that are probably altitudes AMSL.

    readings: all items of the mission with a height above home.
    lowest_amsl: lowest altitude of the items with a plausible altitude AMSL, m; inf without any.

    An item is returned if its number, read as an altitude AMSL, lies above the ground, and one of these is true: the
    number exceeds the median of the other items by at least the altitude of home; it is not below ``lowest_amsl``; or
    a landing point of the mission is in the air, but would be on the ground if read as an altitude AMSL.
    """
    items = [mission.items[reading.item_index] for reading in readings]
    has_landing_in_air = any(
        item.command in LANDINGS and reading.height > LANDING_HEIGHT_TOLERANCE_M >= abs(reading.other_height)
        for item, reading in zip(items, readings, strict=True)
    )
    too_high = []
    for k, (item, reading) in enumerate(zip(items, readings, strict=True)):
        others = [other.alt for other in items[:k] + items[k + 1 :]]
        is_outlier = bool(others) and item.alt - statistics.median(others) >= home_altitude
        exceeds_amsl_altitude = item.alt >= lowest_amsl
        if (is_outlier or exceeds_amsl_altitude or has_landing_in_air) and reading.other_height >= -_height_tolerance(
            item
        ):
            too_high.append(reading)
    return too_high
