"""Which way past a zone a path would have to go: the least shift of its legs there that ends the violation."""

import math

import numpy as np

from logs.verdict.findings import Finding
from logs.verdict.measures.path_moves import flown_moves, planned_moves
from logs.verdict.measures.route_demands import RouteDemands
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.measures.zone_visits import DEPTH_PRECISION, path_zones
from logs.verdict.places import Change, Quantity, Suggestion
from logs.verdict.tolerances import BUFFER_LENGTH, ROUNDING, ZONE_TRIES
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


def zone_suggestions(demands: RouteDemands, aligned: AlignedTrack | None, item: Finding) -> tuple[Suggestion, ...]:
    """Pass a zone further to one side, or higher or lower; the least change first.

    item: the finding of the zone that is violated.  All of the legs on which it is are shifted: of the planned path
    where that violates it, and by as much more as the flight went deeper; of the flight where only that does.
    """
    z, facts = item.place.index or 0, {fact.what: fact.value for fact in item.facts}
    if "entry leg" not in facts:
        return ()
    first, last = int(facts["entry leg"]), int(facts["exit leg"])
    record, terrain = zone_records([demands.airspace.zones[z]]), demands.setup.scenario.terrain
    planned, flown = item.planned or 0.0, item.flown or 0.0
    if aligned is not None and planned <= ROUNDING:
        moves, deeper = flown_moves(aligned, first, last), 0.0
    else:
        moves, deeper = planned_moves(demands, first, last), max(0.0, flown - planned)
    near = moves[(moves["leg"] >= first) & (moves["leg"] <= last)]
    found = []
    for ways in (_LEVEL, _UPRIGHT):
        best: tuple[float, Change] | None = None
        for what, axis, sign in ways:
            shift = _least_shift(near, record, terrain, axis, sign, math.inf if best is None else best[0])
            if shift is not None:
                best = shift, Change(what, item.place, None, float(math.ceil(shift + deeper + BUFFER_LENGTH)), "m")
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
        if visit.depth <= DEPTH_PRECISION:
            return shift
        shift += float(visit.depth)
        if shift >= most:
            return None
        shifted[axis] = moves[axis] + sign * shift
    return None
