"""Which way past a zone a path would have to go: the least shift of its legs there that ends the violation."""

import math

import numpy as np

from logs.verdict.measures.path_moves import flown_moves, planned_moves
from logs.verdict.measures.route_demands import RouteDemands
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.measures.zone_visits import path_zones
from logs.verdict.places import Change, Place, Quantity, Suggestion
from logs.verdict.tolerances import BUFFER_LENGTH, FENCE_EDGE, ZONE_TRIES
from world.airspace.zone_kernels import ZoneRecords, zone_records
from world.kernels import Records
from world.terrain import Terrain

# Shifts of a path: their name, the coordinate, and its sign.
_LEVEL: tuple[tuple[Quantity, str, float], ...] = (
    ("north", "north", 1.0),
    ("east", "east", 1.0),
    ("south", "north", -1.0),
    ("west", "east", -1.0),
)
_UPRIGHT: tuple[tuple[Quantity, str, float], ...] = (("height", "up", 1.0), ("descent", "up", -1.0))


def zone_suggestions(demands: RouteDemands, aligned: AlignedTrack | None, place: Place) -> tuple[Suggestion, ...]:
    """Pass a zone further to one side, or higher or lower; the least change first.

    place: the zone's.  Of planned path and flight the one that goes further beyond the zone's limit is shifted, all of
    the legs on which it does.
    """
    z = place.index or 0
    record, terrain = zone_records([demands.airspace.zones[z]]), demands.setup.scenario.terrain
    candidates = [planned_moves(demands)]
    if aligned is not None:
        candidates.append(flown_moves(aligned))
    visits = [path_zones(moves, record, terrain)[0] for moves in candidates]
    moves, visit = max(zip(candidates, visits, strict=True), key=lambda pair: float(pair[1].depth))
    near = moves[(moves["leg"] >= visit.entry_leg) & (moves["leg"] <= visit.exit_leg)]
    found = []
    for ways in (_LEVEL, _UPRIGHT):
        best: tuple[float, Change] | None = None
        for what, axis, sign in ways:
            shift = _least_shift(near, record, terrain, axis, sign, math.inf if best is None else best[0])
            if shift is not None:
                best = shift, Change(what, place, None, float(math.ceil(shift + BUFFER_LENGTH)), "m")
        if best is not None:
            found.append(best)
    return tuple((change,) for _, change in sorted(found, key=lambda one: one[0]))


def _least_shift(
    moves: Records, record: ZoneRecords, terrain: Terrain | None, axis: str, sign: float, most: float
) -> float | None:
    """The least shift (m) one way that ends a violation; None where it is more than ``most``, or none was found.

    A path that is so deep beyond a limit does not come back from it by a smaller step: going on in steps of that depth
    leaves no smaller shift out.  A ground that rises faster than the step may be passed over.
    """
    shift, shifted = 0.0, np.array(moves)
    for _ in range(ZONE_TRIES):
        visit = path_zones(shifted, record, terrain)[0]
        if visit.unknown:
            return None
        if visit.depth <= FENCE_EDGE:
            return shift
        shift += float(visit.depth)
        if shift >= most:
            return None
        shifted[axis] = moves[axis] + sign * shift
    return None
