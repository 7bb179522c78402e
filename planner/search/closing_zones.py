"""Which zones close the way from start to destination: cells of a coarse grid that hang together, and their bounds."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from world.airspace.zone_kernels import ZoneRecords, edge_distance, outside_band, zone_records
from world.kernels import compiled
from world.scenario import Scenario

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Cells along the map's longer side, and heights from the lowest to the highest that a path may be at.
CELLS, HEIGHTS = 150, 5
# What a cell is closed by, if not by the zone of a number.
_OPEN, _GROUND = -1, -2


class Closed(NamedTuple):
    """What closes the way.

    zones: names of the zones that bound both what can be reached from the start and from the destination.
    pitch: of the cells, m.
    """

    zones: tuple[str, ...]
    pitch: float


def closing_zones(scenario: Scenario) -> Closed | None:
    """What of a scenario's zones closes the way; None where none does, or the ground does it without them.

    A gap narrower than a cell counts as closed.  Missiles and what an aircraft can climb are not looked at.

    >>> from world.scenario import load_scenario
    >>> closing_zones(load_scenario("tight")) is None
    True
    """
    terrain = scenario.terrain
    if terrain is None or not scenario.zones:
        return None
    pitch = float(np.ptp(scenario.bounds, axis=1).max()) / CELLS
    east, north = (np.arange(low + 0.5 * pitch, high, pitch) for low, high in scenario.bounds)
    ground = terrain.height(east[None, :], north[:, None])
    low = np.maximum(ground + scenario.limits.min_clearance_m, scenario.floor)
    top = np.full(ground.shape, scenario.ceiling)
    if scenario.limits.max_height_m is not None:
        top = np.minimum(top, ground + scenario.limits.max_height_m)
    cells = np.full((HEIGHTS, *ground.shape), _OPEN, dtype=np.int64)
    cells[:, ~(low <= top)] = _GROUND
    ends = [_cell_of(scenario, end, pitch, low, top) for end in (scenario.start, scenario.destination)]
    if not _reached(cells, ends):
        return None
    _close(zone_records(scenario.zones), east, north, ground, low, top, cells)
    for end in ends:
        cells[end] = _OPEN
    if _reached(cells, ends):
        return None
    # Imported here, as below: only the explanation of a failure needs it.
    from scipy import ndimage

    regions, _ = ndimage.label(cells == _OPEN)
    beside = [ndimage.binary_dilation(regions == regions[end]) for end in ends]
    both = [set(cells[edge].tolist()) for edge in beside]
    found = (both[0] & both[1]) or (both[0] | both[1])
    return Closed(tuple(scenario.zones[z].name for z in sorted(found) if z >= 0), pitch)


def _cell_of(scenario: Scenario, end: Floats, pitch: float, low: Floats, top: Floats) -> tuple[int, int, int]:
    """Height, row and column of the cell of a fixed end."""
    place = ((end[:2] - scenario.bounds[:, 0]) / pitch).astype(np.int64)
    column, row = (int(np.clip(at, 0, size - 1)) for at, size in zip(place, (low.shape[1], low.shape[0]), strict=True))
    share = (end[2] - low[row, column]) / max(float(top[row, column] - low[row, column]), 1e-6)
    return int(np.clip(round(share * (HEIGHTS - 1)), 0, HEIGHTS - 1)), row, column


def _reached(cells: Ints, ends: list[tuple[int, int, int]]) -> bool:
    """Whether open cells lead from the one end to the other."""
    from scipy import ndimage

    regions, _ = ndimage.label(cells == _OPEN)
    return bool(regions[ends[0]] == regions[ends[1]] != 0)


@compiled
def _close(
    records: ZoneRecords, east: Floats, north: Floats, ground: Floats, low: Floats, top: Floats, cells: Ints
) -> None:  # pragma: no cover - compiled
    """Note in open cells (heights, rows, columns) the first zone that closes them."""
    for z in range(records.zones.shape[0]):
        zone = records.zones[z]
        for i in range(north.size):
            for j in range(east.size):
                near = zone.south <= north[i] <= zone.north and zone.west <= east[j] <= zone.east
                inside = near and edge_distance(records, z, east[j], north[i]) <= 0.0
                if zone.exclusion and not inside:
                    continue
                for k in range(cells.shape[0]):
                    up = low[i, j] + (top[i, j] - low[i, j]) * k / (cells.shape[0] - 1)
                    within = inside and not outside_band(zone, up, ground[i, j]) > 0.0
                    if cells[k, i, j] == _OPEN and within == zone.exclusion:
                        cells[k, i, j] = z
