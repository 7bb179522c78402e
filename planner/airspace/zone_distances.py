"""How far a piece of a path is from every zone: what a certificate looks at, exact on straight edges and circles."""

import math

import numpy as np
from numpy.typing import NDArray

from planner.airspace.kept_zones import KeptZones
from planner.airspace.zone_depths import Stretch, beyond, stretch_of
from planner.airspace.zone_reach import line_between, reach_of
from world.airspace.zone_kernels import ZoneRecords, box_distance, edge_distance
from world.frames import PolyMapRecord
from world.kernels import Record, compiled
from world.terrain import segment_clearance

Floats = NDArray[np.float64]
Heights = NDArray[np.float32]

# Pieces near a zone are cut to this length (m), so that heights and the way beside them belong together.
CUT = 25.0
# What a piece of a path keeps from zones.  nearest: least distance outside an exclusion or inside an inclusion, on the
# map or in height, m; negative where it is in one, or out of one.  kept: whether it has the margin of each.  zone: the
# nearest of those of which it has not, or of all; -1 for none.
ZONE_ROOM = np.dtype([("nearest", np.float64), ("kept", np.bool_), ("zone", np.int64)])


@compiled
def measure_zone_room(
    zones: KeptZones,
    heights: Heights,
    depths: Heights,
    to_pixel: PolyMapRecord,
    a: Floats,
    b: Floats,
    beside: Floats,
    below: float,
    above: float,
    room: Record,
) -> None:  # pragma: no cover - compiled
    """Fill the `ZONE_ROOM` record of the piece a-b.

    depths: the ground's heights, the other sign.  beside: (2,) how far beside a and b a flight may be; below, above:
    how far below and above the piece, m.
    """
    room.nearest, room.kept, room.zone = math.inf, True, -1
    records, most = zones.records, max(beside[0], beside[1])
    west, east = min(a[0], b[0]) - most, max(a[0], b[0]) + most
    south, north = min(a[1], b[1]) - most, max(a[1], b[1]) + most
    run = math.hypot(b[0] - a[0], b[1] - a[1])
    one, two, wide = a.copy(), b.copy(), beside.copy()
    for z in range(zones.kept.shape[0]):
        keeps, zone = zones.kept[z], records.zones[z]
        wanted = max(keeps.beside, keeps.beyond)
        far = max(wanted, min(room.nearest, 1e9))
        if zone.exclusion and box_distance(records, z, west, east, south, north) >= far:
            continue
        grounded = zone.floor_above_ground or zone.ceiling_above_ground
        stretch = stretch_of(a[2], b[2], below, above)
        if grounded:
            stretch = _exact_stretch(heights, depths, to_pixel, a, b, beside, below, above)
        away, over = _away(records, z, a, b, far + most) - most, beyond(zone, stretch)
        if _room(zone, away, over) >= far:
            continue
        pieces = max(1, math.ceil(run / CUT))
        for k in range(pieces):
            for axis in range(3):
                one[axis] = a[axis] + (b[axis] - a[axis]) * k / pieces
                two[axis] = a[axis] + (b[axis] - a[axis]) * (k + 1) / pieces
            for end in range(2):
                wide[end] = beside[0] + (beside[1] - beside[0]) * (k + end) / pieces
            stretch = stretch_of(one[2], two[2], below, above)
            if grounded:
                stretch = _exact_stretch(heights, depths, to_pixel, one, two, wide, below, above)
            off = max(wide[0], wide[1])
            away, over = _away(records, z, one, two, far + off) - off, beyond(zone, stretch)
            _note(zone, keeps, z, away, over, room)


@compiled
def _note(
    zone: Record, keeps: Record, z: int, away: float, over: float, room: Record
) -> None:  # pragma: no cover - compiled
    """Take a stretch's distances from a zone into account."""
    enough = away >= keeps.beside or over >= keeps.beyond
    if not zone.exclusion:
        enough = away >= keeps.beside and -over >= keeps.beyond
    here = _room(zone, away, over)
    # A zone of which the margin is not kept goes before one that is nearer.
    if room.kept != enough:
        if not enough:
            room.zone = z
    elif here < room.nearest or room.zone < 0:
        room.zone = z
    room.kept = room.kept and enough
    room.nearest = min(room.nearest, here)


@compiled
def _room(zone: Record, away: float, over: float) -> float:  # pragma: no cover - compiled
    """Distance from a zone, of the distances on the map and in height from what is forbidden, m."""
    return max(away, over) if zone.exclusion else min(away, -over)


@compiled
def _away(records: ZoneRecords, z: int, a: Floats, b: Floats, within: float) -> float:  # pragma: no cover - compiled
    """Least distance on the map of the line a-b outside an exclusion, or inside an inclusion, m; negative otherwise.

    A distance above `within` may be inf.
    """
    line = line_between(a[0], a[1], b[0], b[1])
    reach = reach_of(records, z, line, within)
    if records.zones[z].exclusion:
        if reach.inside or reach.distance == 0.0:
            return -max(0.0, min(reach.left, -reach.right))
        return reach.distance
    if reach.inside and reach.distance > 0.0:
        return reach.distance
    return -max(0.0, edge_distance(records, z, a[0], a[1]), edge_distance(records, z, b[0], b[1]))


@compiled
def _exact_stretch(
    heights: Heights,
    depths: Heights,
    to_pixel: PolyMapRecord,
    a: Floats,
    b: Floats,
    beside: Floats,
    below: float,
    above: float,
) -> Stretch:  # pragma: no cover - compiled
    """Heights along a-b, and above the ground below it and as far beside it as `beside` (2,) says."""
    plain = stretch_of(a[2], b[2], below, above)
    run = max(1e-9, math.hypot(b[0] - a[0], b[1] - a[1]))
    ux, uy = (b[0] - a[0]) / run, (b[1] - a[1]) / run
    one, two = a.copy(), b.copy()
    lowest, highest = math.inf, -math.inf
    for side in (0.0, -1.0, 1.0):
        for end, at, off in ((one, a, beside[0]), (two, b, beside[1])):
            end[0], end[1], end[2] = at[0] + side * off * uy, at[1] - side * off * ux, at[2]
        least, _ = segment_clearance(heights, to_pixel, one, two)
        one[2], two[2] = -a[2], -b[2]
        most, _ = segment_clearance(depths, to_pixel, one, two)
        if math.isnan(least) or math.isnan(most):
            return plain
        lowest, highest = min(lowest, least - below), max(highest, above - most)
    return Stretch(plain.lowest, plain.highest, lowest, highest)
