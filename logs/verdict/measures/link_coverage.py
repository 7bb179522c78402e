"""Map the margin of a radio link around a flight, for an aircraft at the flight's height or altitude."""

from dataclasses import dataclass

import numpy as np

from world.arrays import Flags, Floats
from world.radio import RadioLink, link_margins
from world.terrain import Terrain

# Number of cells along the longer side of a map.
_CELLS = 150


@dataclass(frozen=True, slots=True)
class FlightHeight:
    """Height at which the radio link of a flight is mapped.

    value: height or altitude, m.
    is_above_ground: True for a height above ground, False for an altitude above mean sea level.
    """

    value: float
    is_above_ground: bool

    @property
    def text(self) -> str:
        """Text of the height, such as "120 m above ground"."""
        return f"{self.value:.0f} m {'above ground' if self.is_above_ground else 'AMSL'}"


@dataclass(frozen=True, slots=True, eq=False)
class LinkCoverage:
    """Margin of a radio link in square cells, at the height of a flight.

    west, south: south-western corner of the first cell, m.
    side: side of a cell, m.
    height: height of the aircraft in every cell.
    margin: dB above the fade margin at the centres of the cells, (n, e), rows from south to north; NaN where the ground
        is unknown, or above the aircraft.
    is_in_ground: True for a cell whose ground is above the aircraft, (n, e).
    """

    west: float
    south: float
    side: float
    height: FlightHeight
    margin: Floats
    is_in_ground: Flags


def flight_height(terrain: Terrain, positions: Floats) -> FlightHeight:
    """Return the median altitude of a path, or its median height above ground if the height varies less.

    positions: points of the path, m, (t, 3).

    >>> from world.terrain import make_flat_terrain
    >>> ground = make_flat_terrain(np.array([[0.0, 100.0], [0.0, 100.0]]), 20.0, 0.0)
    >>> flight_height(ground, np.array([[0.0, 0.0, 140.0], [50.0, 50.0, 140.0]])).text
    '140 m AMSL'
    """
    altitudes = positions[:, 2]
    heights = altitudes - terrain.height(positions[:, 0], positions[:, 1])
    known_heights = heights[np.isfinite(heights)]
    is_above_ground = bool(known_heights.size) and float(known_heights.std()) < float(altitudes.std())
    return FlightHeight(float(np.median(known_heights if is_above_ground else altitudes)), is_above_ground)


def link_coverage(
    link: RadioLink,
    terrain: Terrain,
    antenna: Floats,
    height: FlightHeight,
    extent: tuple[tuple[float, float], tuple[float, float]],
) -> LinkCoverage:
    """Compute the margin of a radio link in every cell of a map.

    The margin is NaN where the ground is unknown or above the aircraft.

    antenna: position of the station's antenna, m, (3,).
    extent: east and north range of the map, m.
    """
    (west, east), (south, north) = extent
    side = max(east - west, north - south) / _CELLS
    easts = west + side * (np.arange(round((east - west) / side)) + 0.5)
    norths = south + side * (np.arange(round((north - south) / side)) + 0.5)
    grid_east, grid_north = np.meshgrid(easts, norths)
    ground = terrain.height(grid_east, grid_north)
    altitudes = ground + height.value if height.is_above_ground else np.full(ground.shape, height.value)
    is_in_ground = altitudes <= ground
    is_in_air = np.isfinite(ground) & ~is_in_ground
    margin = np.full(ground.shape, np.nan)
    positions = np.column_stack([grid_east[is_in_air], grid_north[is_in_air], altitudes[is_in_air]])
    margin[is_in_air] = link_margins(link, terrain, antenna, positions)
    return LinkCoverage(west, south, side, height, margin, is_in_ground)
