"""Parts of a move beside a zone, compiled: how far beyond the zone's limit they can be between their ends."""

import math

import numpy as np
from numpy.typing import NDArray

from world.airspace.zone_kernels import ZoneRecords, distance_to_edge, nearest_edge, outside_band
from world.frames import PolyMapRecord
from world.kernels import Record, compiled, inlined, record_dtype
from world.terrain import ground_height

Heights = NDArray[np.float32]

# A part of a move: its first and last share, and of both ends where they are, m, how far they are outside the zone's
# shape and band, m, and which of its edges is nearest.
PART = record_dtype(
    "first",
    "last",
    "east",
    "north",
    "away",
    "off",
    ("edge", np.int64),
    "to_east",
    "to_north",
    "to_away",
    "to_off",
    ("to_edge", np.int64),
)


@compiled
def look_at_zone(
    records: ZoneRecords, z: int, heights: Heights, to_pixel: PolyMapRecord, east: float, north: float, up: float
) -> tuple[float, float, int]:  # pragma: no cover - compiled
    """How far a place is outside zone z's shape and outside its band, m, negative inside; and its nearest edge.

    NaN outside a band that counts from the ground where that is not known.
    """
    zone = records.zones[z]
    away, edge = nearest_edge(records, z, east, north)
    ground = 0.0
    if zone.floor_above_ground or zone.ceiling_above_ground:
        ground = ground_height(heights, to_pixel, east, north)
    return away, outside_band(zone, up, ground), edge


@inlined
def beyond_limit(exclusion: bool, away: float, off: float) -> float:  # pragma: no cover - compiled
    """How far beyond a zone's limit a place is, m: the least way, level or straight up or down, that ends it.

    Negative on the right side: the way that there is at least.  away, off: as of `look_at_zone`.  NaN where only the
    ground would tell, which is not known.
    """
    if off != off:
        # Beside its shape it is outside whatever the ground.
        if away <= 0.0:
            return math.nan
        off = away
    outside = max(away, off)
    return -outside if exclusion else outside


@inlined
def copy_part(source: Record, target: Record) -> None:  # pragma: no cover - compiled
    """Make one part another."""
    target.first, target.last = source.first, source.last
    target.east, target.north, target.away, target.off = source.east, source.north, source.away, source.off
    target.to_east, target.to_north, target.to_away = source.to_east, source.to_north, source.to_away
    target.to_off, target.edge, target.to_edge = source.to_off, source.edge, source.to_edge


@inlined
def between_ends(
    exclusion: bool, part: Record, run: float, rise: float, farthest: float
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Least and greatest distance beyond a zone's limit that a part can have between its ends, m.

    run: its length, m.  rise: the most that its height in the band changes.  farthest: no place of it is further beyond
    the zone's outline, m.
    """
    sign = -1.0 if exclusion else 1.0
    level, upright = sign * (part.away + part.to_away), sign * (part.off + part.to_off)
    level_low, level_high = 0.5 * (level - run), min(farthest, 0.5 * (level + run))
    if upright != upright:
        # Over ground that is not known at an end the outline alone tells, of an exclusion that it is not inside.
        return (-math.inf, level_high) if exclusion else (level_low, math.inf)
    low, high = 0.5 * (upright - rise), 0.5 * (upright + rise)
    if exclusion:
        return min(level_low, low), min(level_high, high)
    return max(level_low, low), max(level_high, high)


@compiled
def farthest_from_outline(
    records: ZoneRecords, z: int, move: Record, part: Record, run: float
) -> float:  # pragma: no cover - compiled
    """No place of a part is further beyond zone z's outline than this, m, by the edges that are nearest to its ends.

    The distance from one edge, or from a centre, is greatest at an end of a straight way.  An arc leaves its chord by
    no more than an eighth of its curvature times its length squared, where it is less than a radian.
    """
    zone = records.zones[z]
    bow: float = 0.125 * abs(move.curvature) * run * run
    if abs(move.curvature) * run > 1.0:
        return math.inf
    if not zone.round:
        best = math.inf
        for k in (part.edge, part.to_edge):
            edge = records.edges[k]
            here, there = (
                distance_to_edge(edge, part.east, part.north),
                distance_to_edge(edge, part.to_east, part.to_north),
            )
            best = min(best, max(here, there))
        return best + bow
    if not zone.exclusion:
        return float(max(part.away, part.to_away) + bow)
    step_e, step_n = part.to_east - part.east, part.to_north - part.north
    off_e, off_n = zone.centre_east - part.east, zone.centre_north - part.north
    long2 = step_e * step_e + step_n * step_n
    share = min(1.0, max(0.0, (off_e * step_e + off_n * step_n) / long2)) if long2 > 0.0 else 0.0
    off_e -= share * step_e
    off_n -= share * step_n
    return float(zone.radius - math.sqrt(off_e * off_e + off_n * off_n) + bow)
