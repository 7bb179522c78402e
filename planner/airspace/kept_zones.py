"""Zones with what a path is to keep from each, in an order in which those near a leg are found fast."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from world.airspace.zone_kernels import ZoneRecords, edge_distance, outside_band, zone_records
from world.airspace.zones import Zone
from world.kernels import Records, compiled, record_dtype
from world.terrain import Terrain

Floats = NDArray[np.float64]

# What a path keeps from one zone, m: beside its outline, and below its floor or above its ceiling (inside both, of an
# inclusion).  number: of the zone, as the scenario has them.  furthest_east: of this exclusion and of all before it, m.
KEPT = record_dtype(("number", np.int64), "beside", "beyond", "furthest_east")


class KeptZones(NamedTuple):
    """Zones in the order in which kernels read them: the inclusions, then the exclusions from west to east.

    records: the zones, and kept: `KEPT` records (z,) of them.
    inclusions: how many there are.
    beside: the most that is kept beside any, m.
    """

    records: ZoneRecords
    kept: Records
    inclusions: int
    beside: float


class ZoneMargins(NamedTuple):
    """What a path keeps from zones, m: beside and beyond as in `KEPT`.

    share: where a fixed end is nearer to a zone than that, of what the end keeps.
    """

    beside: float
    beyond: float
    share: float


def keep_zones(zones: Sequence[Zone], ends: Floats, terrain: Terrain | None, margins: ZoneMargins) -> KeptZones:
    """Zones with these margins, or with less from a zone that a fixed end is near.

    ends: (k, 3) m.  An end inside an exclusion, or outside an inclusion, leaves a margin of 0.

    >>> from world.airspace.zones import Cylinder
    >>> zone = Zone("mast", "exclusion", Cylinder(0.0, 500.0, 200.0))
    >>> ends = np.array([[0.0, 700.0 + 8.0, 60.0], [0.0, 3000.0, 60.0]])
    >>> kept = keep_zones([zone], ends, None, ZoneMargins(20.0, 10.0, 0.5)).kept
    >>> float(kept["beside"][0]), float(kept["beyond"][0])
    (4.0, 10.0)
    """
    given = zone_records(zones)
    order = np.lexsort((given.zones["west"], given.zones["exclusion"]))
    records = ZoneRecords(given.zones[order], given.edges)
    kept: Records = np.zeros(len(order), KEPT)
    kept["number"], kept["beside"], kept["beyond"] = order, margins.beside, margins.beyond
    inclusions = int((~records.zones["exclusion"]).sum())
    kept["furthest_east"][inclusions:] = np.maximum.accumulate(records.zones["east"][inclusions:])
    grounds = np.full(len(ends), np.nan) if terrain is None else terrain.height(ends[:, 0], ends[:, 1])
    _give_way(records, np.ascontiguousarray(ends), np.ascontiguousarray(grounds), margins.share, kept)
    for array in (records.zones, kept):
        array.setflags(write=False)
    return KeptZones(records, kept, inclusions, margins.beside)


@compiled
def _give_way(
    records: ZoneRecords, ends: Floats, grounds: Floats, share: float, kept: Records
) -> None:  # pragma: no cover - compiled
    """Let margins shrink to a share of what the ends (k, 3) keep; grounds: (k,) heights of the ground there."""
    for z in range(kept.shape[0]):
        zone, keeps = records.zones[z], kept[z]
        for k in range(ends.shape[0]):
            away = edge_distance(records, z, ends[k, 0], ends[k, 1])
            over = outside_band(zone, ends[k, 2], grounds[k])
            if not zone.exclusion:
                keeps.beside = min(keeps.beside, max(0.0, -share * away))
                keeps.beyond = min(keeps.beyond, max(0.0, -share * over))
            elif away < keeps.beside and not over >= keeps.beyond:
                # The one of the two of which more is left.
                if away * keeps.beyond >= over * keeps.beside or math.isnan(over):
                    keeps.beside = max(0.0, share * away)
                else:
                    keeps.beyond = max(0.0, share * over)


@compiled
def first_near(zones: KeptZones, west: float) -> int:  # pragma: no cover - compiled
    """The first exclusion of those, in their order, that may reach as far east as `west` (m)."""
    low, high = zones.inclusions, zones.kept.shape[0]
    while low < high:
        middle = (low + high) // 2
        if zones.kept[middle].furthest_east < west:
            low = middle + 1
        else:
            high = middle
    return low
