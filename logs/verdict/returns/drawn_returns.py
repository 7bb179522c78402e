"""Prepare simulated returns to launch for drawing.

The drawing has the worst paths, and the lowest safe altitudes along the flight.

Neither is needed to judge returns, and each takes as long as judging them, so they are computed only for a drawing.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import TypeVar

import numpy as np

from logs.verdict.returns.judge_glides import NO_GLIDES, Glides
from logs.verdict.returns.judge_returns import (
    Kind,
    ReturnRange,
    Returns,
    ReturnWorld,
    SimulatedReturn,
    heights_above_ground,
    worst_first_key,
)
from logs.verdict.returns.return_starts import ReturnStarts
from logs.verdict.returns.suggest_returns import meets_return_limits
from world.arrays import Flags, Floats

# Largest number of return paths that are drawn.
MAX_DRAWN_PATHS = 3
# Largest number of starts at which the lowest safe altitude is searched.
_MAX_STARTS = 40
# Step of that search above or below the flight's altitude, m.
_STEP_M = 80.0
# Largest number of steps above or below the flight's altitude.
_MAX_STEPS = 15
# Number of bisections between the last safe and the last unsafe altitude.
_HALVING_COUNT = 3


@dataclass(frozen=True, slots=True, eq=False)
class WorstReturn:
    """Worst return from a time range of the flight, to be drawn.

    return_range: the time range.
    path: positions at intervals of one second, m, (t, 3).
    marked_position: position at which the return fails, or at which it is lowest, m, (3,).
    """

    return_range: ReturnRange
    path: Floats
    marked_position: Floats

    @property
    def simulated(self) -> SimulatedReturn:
        """The simulated return."""
        return self.return_range.worst


@dataclass(frozen=True, slots=True, eq=False)
class MinSafeAltitudes:
    """Lowest altitude from which a return to launch is safe, at n starts on the path.

    time: flight times of the starts, s, (n,).
    altitude: lowest safe altitudes, m AMSL, (n,); NaN if none was found.  If the return from the flight's own altitude
        is unsafe, this is the nearest higher altitude from which the return is safe.
    search_range: range of the search above and below the flight, m.
    """

    time: Floats
    altitude: Floats
    search_range: float = _STEP_M * _MAX_STEPS


@dataclass(frozen=True, slots=True, eq=False)
class DrawnReturns:
    """Returns with the data for drawing them.

    worst: the returns to draw, the worst first.
    glides: glides from the same starts; empty if they are not drawn.
    """

    returns: Returns
    worst: tuple[WorstReturn, ...]
    min_safe_altitudes: MinSafeAltitudes
    glides: Glides = NO_GLIDES

    @property
    def worst_by_start(self) -> list[SimulatedReturn]:
        """Worst return from each start, in order of time."""
        by_time = sorted(self.returns.each, key=lambda ret: ret.time)
        return [min(group, key=worst_first_key) for _, group in groupby(by_time, lambda ret: ret.time)]

    @property
    def segments_by_outcome(self) -> list[tuple[Kind, list[SimulatedReturn]]]:
        """Segments of the path, each with one outcome of the returns that start on it."""
        return group_segments(self.worst_by_start, lambda ret: ret.kind)


Element = TypeVar("Element")
Key = TypeVar("Key")


def group_segments(elements: Sequence[Element], key: Callable[[Element], Key]) -> list[tuple[Key, list[Element]]]:
    """Group consecutive elements by key; end each group with the first element of the next group.

    >>> group_segments([1, 3, 2, 5], lambda one: one % 2)
    [(1, [1, 3, 2]), (0, [2, 5]), (1, [5])]
    """
    groups = [(key, list(group)) for key, group in groupby(elements, key)]
    for (_, group), (_, next_group) in pairwise(groups):
        group.append(next_group[0])
    return groups


def collect_drawn_returns(
    world: ReturnWorld, starts: ReturnStarts, returns: Returns, glides: Glides = NO_GLIDES
) -> DrawnReturns:
    """Collect the data for a drawing of the returns to launch.

    These are the worst paths and the lowest safe altitudes.

    starts: places on the route from which the returns were simulated; they are ignored if `returns` is empty.
    glides: glides after an engine failure, if they were simulated.
    """
    min_altitudes = min_safe_altitudes(world, starts if returns.each else starts.subset(np.zeros(0, dtype=np.intp)))
    return DrawnReturns(returns, worst_returns(world, starts, returns), min_altitudes, glides)


def collect_drawn_returns_without_glides(world: ReturnWorld, starts: ReturnStarts, returns: Returns) -> DrawnReturns:
    """Collect the data for a quick drawing of the returns to launch: the worst paths only.

    Glides and lowest safe altitudes, which take the most time, are left out.
    """
    return DrawnReturns(returns, worst_returns(world, starts, returns), MinSafeAltitudes(np.zeros(0), np.zeros(0)))


def worst_returns(world: ReturnWorld, starts: ReturnStarts, returns: Returns) -> tuple[WorstReturn, ...]:
    """Select at most `MAX_DRAWN_PATHS` returns to draw, and simulate them again to get their paths.

    The worst return of each kind of failure comes first, and then other failures.  If all returns are safe, only the
    return with the least clearance is selected.  Return () if `returns` is empty.
    """
    unsafe_ranges = [return_range for return_range in returns.ranges if not return_range.worst.safe]
    worst_range_by_kind = {return_range.worst.kind: return_range for return_range in reversed(unsafe_ranges)}
    ranked_ranges = [
        return_range for return_range in unsafe_ranges if worst_range_by_kind[return_range.worst.kind] is return_range
    ]
    ranked_ranges += [
        return_range
        for return_range in unsafe_ranges
        if worst_range_by_kind[return_range.worst.kind] is not return_range
    ]
    drawn_ranges = ranked_ranges[:MAX_DRAWN_PATHS] or list(returns.ranges[:1])
    rows = np.array(
        [int(np.argmin(np.abs(starts.time - return_range.worst.time))) for return_range in drawn_ranges], dtype=np.intp
    )
    if not drawn_ranges:
        return ()
    targets = [return_range.worst.target for return_range in drawn_ranges]
    paths = world.fly(starts.subset(rows).rows, targets, store_positions=True).tracks
    worst = []
    for drawn_range, path in zip(drawn_ranges, paths, strict=True):
        # A drawing marks the position nearest to the center of an entered sphere, or the lowest position.  For a
        # failure without a place, such as a return that does not arrive, it marks the end of the path.
        ret, position = drawn_range.worst, path[-1]
        if ret.kind == "threat":
            distances = np.linalg.norm(path - world.environment.spheres[ret.threat], axis=1)
            position = path[int(np.argmin(distances))]
        elif ret.kind not in ("zone", "lost", "energy", "unknown") and not math.isnan(ret.lowest_position[0]):
            position = np.array(ret.lowest_position)
        worst.append(WorstReturn(drawn_range, path, position))
    return tuple(worst)


# ----------------------------------------------------------------------
# The minimum altitude from which a return to launch is safe.


def min_safe_altitudes(world: ReturnWorld, starts: ReturnStarts) -> MinSafeAltitudes:
    """Find the lowest altitude from which a return is safe, at up to `_MAX_STARTS` of the starts.

    The search goes up or down from the flight's altitude in steps, and then bisects the last step.  The result
    is NaN for a start over unknown ground, and if no altitude is safe.
    """
    if not len(starts):
        return MinSafeAltitudes(np.zeros(0), np.zeros(0))
    rows = np.unique(np.linspace(0, len(starts) - 1, _MAX_STARTS).round().astype(np.intp))
    selected_starts = starts.subset(rows)
    start_heights = heights_above_ground(world, selected_starts)
    min_offset = np.where(np.isfinite(start_heights), np.minimum(0.0, world.limit - start_heights), math.nan)
    is_safe = meets_return_limits(world, selected_starts)
    # Last safe and last unsafe offset from the flight's altitude, m.
    last_safe_offset = np.where(is_safe, 0.0, math.nan)
    last_unsafe_offset = np.where(is_safe, math.nan, 0.0)
    search_direction = np.where(is_safe, -1.0, 1.0)
    is_unfinished = np.isfinite(min_offset)
    for step in range(1, _MAX_STEPS + 1):
        offsets = np.maximum(search_direction * step * _STEP_M, min_offset)
        is_offset_safe = _are_safe_at_offset(world, selected_starts, offsets, is_unfinished)
        last_safe_offset = np.where(is_unfinished & is_offset_safe, offsets, last_safe_offset)
        last_unsafe_offset = np.where(is_unfinished & ~is_offset_safe, offsets, last_unsafe_offset)
        is_unfinished &= (is_offset_safe == is_safe) & (offsets > min_offset)
    for _ in range(_HALVING_COUNT):
        is_bracketed = np.isfinite(last_safe_offset) & np.isfinite(last_unsafe_offset)
        midpoints = np.where(is_bracketed, 0.5 * (last_safe_offset + last_unsafe_offset), 0.0)
        is_offset_safe = _are_safe_at_offset(world, selected_starts, midpoints, is_bracketed)
        last_safe_offset = np.where(is_bracketed & is_offset_safe, midpoints, last_safe_offset)
        last_unsafe_offset = np.where(is_bracketed & ~is_offset_safe, midpoints, last_unsafe_offset)
    return MinSafeAltitudes(
        selected_starts.time, np.where(np.isfinite(min_offset), selected_starts.rows["up"] + last_safe_offset, math.nan)
    )


def _are_safe_at_offset(world: ReturnWorld, starts: ReturnStarts, offsets: Floats, is_simulated: Flags) -> Flags:
    """Return a mask (n,): True for each start from which a return is safe after a change of its altitude.

    offsets: changes of the starts' altitudes, m, (n,).
    is_simulated: mask of the starts to simulate; the result is False for all others.
    """
    is_safe = np.zeros(len(starts), dtype=np.bool_)
    if is_simulated.any():
        rows = starts.rows[is_simulated].copy()
        rows["up"] += offsets[is_simulated]
        is_safe[is_simulated] = meets_return_limits(
            world, replace(starts.subset(np.flatnonzero(is_simulated)), rows=rows)
        )
    return is_safe
