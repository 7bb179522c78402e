"""Align a track with a route: its usable rows, and the rows of each leg.

This is the flown side of every finding.  Only time, position, velocity, attitude, airspeed, throttle, wind, current and
energy are read.  The columns that guidance records about itself (leg, cross-track, height error, clearance) are not: a
verdict must not depend on them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from flight.simulation.setup import FlightSetup
from flight.simulation.tick import RTL_ARRIVAL_RADIUS_M
from flight.simulation.track import Track
from logs.verdict.measures.acceptance import reach
from logs.verdict.measures.path_sweeps import path_clearance
from logs.verdict.measures.route_progress import RouteProgress, route_progress
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.tolerances import (
    CAPTURE_RADIUS_M,
    CHORD_TIME_S,
    FINAL_WAYPOINT_TOLERANCE_M,
    MAX_PLAUSIBLE_POSITION_M,
    MAX_PLAUSIBLE_SPEED_MPS,
    MAX_PLAUSIBLE_VALUE,
)
from world.arrays import Floats
from world.kernels import compiled, read_only

RowNumbers = NDArray[np.int64]


# A waypoint was not passed if the route from the track's end to it is longer than its arrival distance and this, m.
_MISSED_MARGIN_M = 50.0
# Largest number of cells in the assignment of rows to waypoints; the track is thinned to stay within it.
_CELLS = 40_000_000


@dataclass(frozen=True, slots=True)
class AlignedTrack:
    """Track aligned with a route of w waypoints; t usable rows.

    track: the usable rows.
    bad_rows: number of rows with non-finite or implausible numbers or a time not later than the row before.
    first_bad: time of the first of them, s; NaN without any.
    rows: (w,) the row nearest to each waypoint's apex, never decreasing; the last row for a waypoint that the flight
        did not reach.
    distance: (w,) m from there to the apex.
    passed: (w,) bool, the flight passed the waypoint.
    course: (t,) rad over the ground, unwrapped.
    distance_run: (t,) m along the ground track.
    low, low_at: (t - 1,) least height above ground between a row and the next, m, and the fraction of the segment at
        which it occurs; NaN off the known terrain, and without terrain.
    tick: usual time between rows, s.
    """

    track: Track
    bad_rows: int
    first_bad: float
    rows: RowNumbers
    distance: Floats
    passed: NDArray[np.bool_]
    course: Floats
    distance_run: Floats
    low: Floats
    low_at: Floats
    tick: float

    def leg_rows(self, leg: int) -> slice:
        """Return the rows between a leg's two waypoints, both included."""
        return slice(int(self.rows[leg]), int(self.rows[leg + 1]) + 1)

    def leg_ends(self) -> tuple[float, ...]:
        """Return the end time of each leg but the last, s; inf if its waypoint was not reached."""
        ends = np.where(self.passed, self.track.time[self.rows], math.inf)[1:-1]
        return tuple(ends.tolist())

    def flew(self, leg: int) -> bool:
        """Return True if any part of a leg was flown."""
        return bool(self.passed[leg]) and self.rows[leg + 1] > self.rows[leg]

    def leg_at(self, row: int) -> int:
        """Return the leg on which a row was flown; the last row is on the leg that the flight ended on."""
        return int(np.searchsorted(self.rows[1:-1], min(row, len(self.track) - 2), side="right"))

    def where(self, row: int, fraction: float = 0.0) -> str:
        """Describe the place of a row, or of a fraction of the segment to the next row, on the map."""
        position = self.track.position
        east, north = (position[row] + fraction * (position[min(row + 1, len(position) - 1)] - position[row]))[:2]
        return f"east {east:.0f} m, north {north:.0f} m"

    def around(self, first: int, last: int, seconds: float) -> slice:
        """Return rows first..last and the rows within ``seconds`` of them."""
        time = self.track.time
        start = int(np.searchsorted(time, time[first] - seconds))
        return slice(start, int(np.searchsorted(time, time[last] + seconds, side="right")))


def align_track(requirements: RouteRequirements, track: Track) -> AlignedTrack | None:
    """Align a track with a route; return None if the track has fewer than two usable rows."""
    good = _usable_rows(track, own=requirements.setup.source is None)
    if int(good.sum()) < 2:
        return None
    if good.all():
        clean, first_bad = track, math.nan
    else:
        first_bad = float(track.time[int(np.argmin(good))])
        clean = Track(*(getattr(track, item.name)[good] for item in fields(track)))
    apexes, last = requirements.apexes(), len(clean) - 1
    progress = route_progress(requirements.setup.route, clean.position, anywhere=requirements.setup.source is not None)
    arrived = _arrival_distances(requirements)
    progress = _with_arrivals(requirements, clean, progress, arrived)
    rows, distance = _passage_rows(clean, apexes, progress)
    off = np.hypot(*(clean.position[rows, :2] - requirements.points[:, :2]).T)
    # The flight is past a waypoint that it passed, or at the waypoint where it ended; it did not pass one far ahead.
    ahead = progress.left > arrived + _MISSED_MARGIN_M
    ahead[-1] = False
    passed = ((rows < last) & ~ahead) | (off <= arrived)
    passed &= np.arange(len(rows)) <= progress.target
    passed = np.logical_and.accumulate(passed)
    rows[~passed] = last
    _begin_last_leg(requirements, clean, rows, passed, arrived)
    step = np.diff(clean.position[:, :2], axis=0)
    course = np.unwrap(np.arctan2(step[:, 0], step[:, 1]))
    ground = requirements.setup.scenario.terrain
    low, low_at = np.full(last, math.nan), np.zeros(last)
    if ground is not None:
        low, low_at = path_clearance(ground.heights, ground.to_pixel.record, clean.position)
    return AlignedTrack(
        track=clean,
        bad_rows=int(good.size - good.sum()),
        first_bad=first_bad,
        rows=rows,
        distance=distance,
        passed=passed,
        course=np.append(course, course[-1]),
        distance_run=np.concatenate([[0.0], np.cumsum(np.hypot(step[:, 0], step[:, 1]))]),
        low=low,
        low_at=low_at,
        tick=float(np.median(np.diff(clean.time))),
    )


def _arrival_distances(requirements: RouteRequirements) -> Floats:
    """Return the distance from each waypoint within which a track that ends has passed the waypoint, m, (w,)."""
    route, follows_path = requirements.setup.route, requirements.setup.autopilot.follows_path
    offsets = requirements.fly_by_offset if follows_path else np.zeros(len(route.waypoints))
    arrived = [
        max(float(offset) + FINAL_WAYPOINT_TOLERANCE_M, reach(requirements, i).radius)
        for i, offset in enumerate(offsets)
    ]
    first = route.return_from
    if first >= 0:
        # A return ends where its autopilot loiters, which is not where the loiter is drawn.
        until = route.return_until
        arrived[first + 1 : until] = [max(RTL_ARRIVAL_RADIUS_M, radius) for radius in arrived[first + 1 : until]]
    if requirements.setup.autopilot.loiter_rules.at_middle:
        # A mission that ends on a loiter about a center ends anywhere on it, as wide as it is flown.
        ends, item = route.arcs.size - 1, route.items[-1]
        while ends > 0 and route.items[ends] == item and route.arcs[ends - 1]:
            arrived[ends] = max(arrived[ends], RTL_ARRIVAL_RADIUS_M)
            ends -= 1
    return np.array(arrived)


def _with_arrivals(
    requirements: RouteRequirements, track: Track, progress: RouteProgress, arrived: Floats
) -> RouteProgress:
    """Add the waypoints at which a track ends to the waypoints that it set out for.

    A flight within reach of a waypoint is flying to the next one, from the row where it came within reach.
    """
    points, last, target = requirements.points, len(track) - 1, progress.target
    first, until = progress.first.copy(), progress.last.copy()
    while target + 1 < len(points):
        beyond = np.flatnonzero(np.hypot(*(track.position[:, :2] - points[target, :2]).T) > arrived[target])
        entry = int(beyond[-1]) + 1 if beyond.size else 0
        if entry > last:
            break
        target += 1
        first[target], until[target] = max(int(first[target - 1]), entry), last
    return replace(progress, first=first, last=until, target=target)


def _begin_last_leg(
    requirements: RouteRequirements, track: Track, rows: RowNumbers, passed: NDArray[np.bool_], arrived: Floats
) -> None:
    """Begin the track's last leg, in ``rows``, at the row that came within reach of the leg's first waypoint.

    Change ``rows`` only if the track ends within that reach, before the waypoint, because the autopilot is on the next
    leg by then.
    """
    k = int(np.flatnonzero(passed)[-1]) if passed.any() else 0
    if not 0 < k < len(rows) - 1 or rows[k] < len(track) - 1 or requirements.setup.route.arcs[k] > 0.0:
        return
    off = np.hypot(*(track.position[:, :2] - requirements.points[k, :2]).T)
    beyond = np.flatnonzero(off[rows[k - 1] :] > arrived[k])
    rows[k] = min(rows[k] - 1, rows[k - 1] + (int(beyond[-1]) + 1 if beyond.size else 0))


def along_across(requirements: RouteRequirements, leg: int, position: Floats) -> tuple[Floats, Floats]:
    """Return the distances of positions (n, 3) along a leg from its start, and to the right of its line, m."""
    east, north = position[:, 0] - requirements.points[leg, 0], position[:, 1] - requirements.points[leg, 1]
    ux, uy = math.sin(requirements.courses[leg]), math.cos(requirements.courses[leg])
    return east * ux + north * uy, east * uy - north * ux


def approaches(position: Floats, target: Floats) -> tuple[Floats, Floats]:
    """Return each track segment's minimum horizontal distance from a target, m, and its fraction of the segment.

    position: (n, 3).  target: (2,) or (3,).  Returns (n - 1,) twice.
    """
    start = position[:-1, :2]
    step = position[1:, :2] - start
    away = target[:2] - start
    length2 = np.maximum((step * step).sum(axis=1), 1e-12)
    fraction = np.clip((step * away).sum(axis=1) / length2, 0.0, 1.0)
    rest = away - fraction[:, None] * step
    return np.hypot(rest[:, 0], rest[:, 1]), fraction


def _usable_rows(track: Track, *, own: bool) -> NDArray[np.bool_]:
    """Return the rows with finite, plausible numbers, later than every usable row before them.

    own: the flight is planfly's own, with all numbers in every row; of an imported log only positions and velocities
    are checked here, and each rule checks what else it needs.
    """
    good = np.isfinite(track.time)
    plausible: tuple[tuple[str, float], ...] = (
        ("position", MAX_PLAUSIBLE_POSITION_M),
        ("velocity", MAX_PLAUSIBLE_SPEED_MPS),
    )
    if own:
        for name in ("airspeed", "current", "energy"):
            good &= np.isfinite(getattr(track, name))
        plausible = (
            *plausible,
            ("attitude", MAX_PLAUSIBLE_VALUE),
            ("controls", MAX_PLAUSIBLE_VALUE),
            ("wind", MAX_PLAUSIBLE_VALUE),
        )
    for name, largest in plausible:
        # A NaN is not within any bound.
        good &= (np.abs(getattr(track, name)) <= largest).all(axis=1)
    time = np.where(good, track.time, -math.inf)
    before = np.concatenate([[-math.inf], np.maximum.accumulate(time)[:-1]]) if time.size else time
    return np.asarray(good & (time > before))


def _passage_rows(track: Track, apexes: Floats, progress: RouteProgress) -> tuple[RowNumbers, Floats]:
    """Return the row of each waypoint's passage, and its distance, m.

    The assignment in time order with the least sum of squared distances.  Only rows along each waypoint's legs are
    considered.
    """
    position, count, last = track.position, len(apexes), len(track) - 1
    tick = max(1e-6, float(track.time[-1] - track.time[0]) / last)
    step = max(1, int(CHORD_TIME_S / tick), -(-len(track) * count // _CELLS))
    first, until = read_only(progress.first // step), read_only(progress.last // step)
    chords, capped = _align(read_only(position), apexes, first, until, step, CAPTURE_RADIUS_M)
    rows = np.zeros(count, dtype=np.int64)
    distance = np.zeros(count)
    # Missed waypoints lie between their neighbours; waypoints after the last one that was met lie at the end.
    met = np.flatnonzero(~capped)
    final = int(met[-1]) if met.size else -1
    low = 0
    for i in range(count):
        if i > final and i > 0:
            start, stop = last, last
        elif capped[i]:
            after = met[met > i]
            start, stop = low, min(last, (int(chords[after[0]]) + 1) * step) if after.size else last
        else:
            start, stop = max(low, (int(chords[i]) - 1) * step), min(last, (int(chords[i]) + 2) * step)
        start, stop = min(start, last), max(min(start, last), stop)
        off = position[start : stop + 1] - apexes[i]
        away = np.sqrt((off * off).sum(axis=1))
        nearest = int(np.argmin(away))
        rows[i], distance[i] = start + nearest, away[nearest]
        low = int(rows[i])
    return rows, distance


@compiled
def _align(
    position: Floats, marks: Floats, first: RowNumbers, until: RowNumbers, step: int, capture: float
) -> tuple[RowNumbers, NDArray[np.bool_]]:
    """Find the chord (of ``step`` rows) of each mark, in time order.

    The sum of min(distance, capture)^2 is the least.  By dynamic programming; among equal assignments the earliest.
    Also return which marks no row of their chord captures; only chords first..until can capture a mark.
    """
    last = position.shape[0] - 1
    chords = -(-last // step)
    count = marks.shape[0]
    best = np.zeros(chords)
    fresh = np.zeros((count, chords), dtype=np.uint8)
    for i in range(count):
        lowest = math.inf
        for j in range(chords):
            a, b = j * step, min(last, (j + 1) * step)
            length2 = 0.0
            along = 0.0
            start2 = 0.0
            for k in range(3):
                leg = position[b, k] - position[a, k]
                out = marks[i, k] - position[a, k]
                length2 += leg * leg
                along += leg * out
                start2 += out * out
            f = min(1.0, max(0.0, along / length2)) if length2 > 0.0 else 0.0
            away2 = max(0.0, start2 - 2.0 * f * along + f * f * length2)
            if not first[i] <= j <= until[i]:
                away2 = math.inf
            total = best[j] + min(away2, capture * capture)
            if total < lowest:
                lowest = total
                fresh[i, j] = 1
            best[j] = lowest
    chosen = np.zeros(count, dtype=np.int64)
    capped = np.zeros(count, dtype=np.bool_)
    j = chords - 1
    for i in range(count - 1, -1, -1):
        while fresh[i, j] == 0:
            j -= 1
        chosen[i] = j
        nearest2 = math.inf
        for row in range(j * step, min(last, (j + 1) * step) + 1):
            away2 = 0.0
            for k in range(3):
                away2 += (marks[i, k] - position[row, k]) ** 2
            nearest2 = min(nearest2, away2)
        capped[i] = nearest2 >= capture * capture or not first[i] <= j <= until[i]
    return chosen, capped


# ----------------------------------------------------------------------
# The leg on which each row of a track was flown, as a verdict aligned it.
#
# The legs recorded by guidance are ignored, so that a report's tables and a replay cannot differ from the verdict.

_IGNORED_COLUMNS = ("velocity", "attitude", "airspeed", "controls", "wind", "current", "energy")


def find_leg_ends(setup: FlightSetup, track: Track) -> tuple[float, ...]:
    """Return the end time of each leg except the last, s, for a track without a verdict.

    The time is inf if the leg's last waypoint was not reached.  Only time and position are used.  Return () for a track
    with fewer than two usable rows.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> find_leg_ends(log.setup, log.track)
    (20.0,)
    """
    places = replace(track, **{name: np.zeros_like(getattr(track, name)) for name in _IGNORED_COLUMNS})
    aligned = align_track(route_requirements(setup), places)
    return () if aligned is None else aligned.leg_ends()


def with_legs(track: Track, leg_ends: Sequence[float]) -> Track:
    """Return the track with its ``leg`` column computed again from the increasing end times of the legs, s.

    leg_ends: from a `logs.verdict.verdict.Verdict` or from `find_leg_ends`.  If empty, all rows are on leg 0.
    """
    ends = np.array(leg_ends, dtype=np.float64)
    return replace(track, leg=np.searchsorted(ends, track.time, side="right").astype(np.int32))
