"""How a flight of the field took each corner: its nearest pass, and how far past the new leg it went.

An autopilot of the field knows nothing of planfly's arcs: it turns where it holds the waypoint to be reached.  So its
corners are measured against what is known of them, the waypoint and the next leg.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from logs.verdict.measures.route_demands import RouteDemands
from logs.verdict.measures.track_alignment import AlignedTrack, along_across, approaches

Floats = NDArray[np.float64]

# Share of the next leg over which a corner is looked at: by its end the next corner has begun.
OF_NEXT_LEG = 0.7


@dataclass(frozen=True, slots=True)
class CornerPass:
    """How one waypoint was passed.

    time: s, of the nearest pass.  nearest: m, horizontal distance from the waypoint then.
    overshoot: m past the next leg, on the outside of the turn, from there to `OF_NEXT_LEG` of that leg, or to the next
    waypoint's pass where that is sooner; None where the next leg was not joined.
    beyond: m past the next leg's end at the nearest pass, where it was not joined.
    """

    time: float
    nearest: float
    overshoot: float | None
    beyond: float = 0.0


def corner_passes(demands: RouteDemands, aligned: AlignedTrack) -> tuple[CornerPass, ...]:
    """How each waypoint of a route was passed, in its order: each after the one before it.

    >>> from logs.recording.example_log import example_log
    >>> from logs.verdict.measures.route_demands import route_demands
    >>> from logs.verdict.measures.track_alignment import lay_track
    >>> log = example_log()
    >>> demands = route_demands(log.setup)
    >>> passes = corner_passes(demands, lay_track(demands, log.track))
    >>> len(passes) == demands.legs + 1, passes[1].nearest < 60.0
    (True, True)
    """
    found = _nearest(demands, aligned)
    times, tick = [time for time, _ in found], aligned.tick
    out = []
    for k, (time, nearest) in enumerate(found):
        overshoot, beyond = None, 0.0
        if 0 < k < demands.legs:
            later = next((other for other in times[k + 1 :] if other > time + tick), float(aligned.track.time[-1]))
            overshoot, beyond = _past_next_leg(demands, aligned, k, time, later)
        out.append(CornerPass(time, nearest, overshoot, beyond))
    return tuple(out)


def _nearest(demands: RouteDemands, aligned: AlignedTrack) -> list[tuple[float, float]]:
    """Time (s) and distance (m) of each waypoint's nearest pass, between the pass before it and the next one's."""
    time, rows = aligned.track.time, aligned.rows
    out: list[tuple[float, float]] = []
    begin = float(time[0])
    for k in range(len(rows)):
        # Of waypoints that lie by the same row none is a bound for the others.
        later = rows[k + 1 :][time[rows[k + 1 :]] > max(float(time[rows[k]]), begin)]
        moments, place = _way(aligned, begin, float(time[later[0]] if later.size else time[-1]))
        away, fraction = approaches(place, demands.points[k])
        nearest = int(np.argmin(away))
        begin = float(moments[nearest] + fraction[nearest] * (moments[nearest + 1] - moments[nearest]))
        out.append((begin, float(away[nearest])))
    return out


def _way(aligned: AlignedTrack, start: float, end: float) -> tuple[Floats, Floats]:
    """Moments (n,) s from one time to another, and places (n, 3) of the flight then."""
    time = aligned.track.time
    moments = np.concatenate([[start], time[(time > start) & (time < end)], [end]])
    return moments, np.column_stack([np.interp(moments, time, aligned.track.position[:, j]) for j in range(3)])


def _past_next_leg(
    demands: RouteDemands, aligned: AlignedTrack, k: int, start: float, end: float
) -> tuple[float | None, float]:
    """Overshoot (m; None without one) of the corner at a waypoint, and how far past the leg's end it began (m)."""
    run = float(demands.runs[k])
    along, across = along_across(demands, k, _way(aligned, start, end)[1])
    if along[0] > run:
        return None, float(along[0]) - run
    outside = -math.copysign(1.0, float(demands.turns[k])) * across
    gone = np.flatnonzero(along >= OF_NEXT_LEG * run)
    until = int(gone[0]) if gone.size else len(along)
    if 0 < until < len(along):
        # To the very place: rows may be a second apart.
        share = (OF_NEXT_LEG * run - along[until - 1]) / (along[until] - along[until - 1])
        last = outside[until - 1] + share * (outside[until] - outside[until - 1])
        return max(0.0, float(last), float(outside[:until].max())), 0.0
    return max(0.0, float(outside[: max(1, until)].max())), 0.0
