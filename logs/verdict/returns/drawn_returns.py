"""Prepare returns for drawing: the worst paths, and the lowest altitude from which a return is safe.

Neither is needed to judge returns, and both take as long as judging: they are computed only if a picture is wanted.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import TypeVar

import numpy as np

from logs.verdict.returns.judge_glides import NOT_ASKED, Glide, Glides, Reach
from logs.verdict.returns.judge_returns import (
    Kind,
    ReturnFlown,
    ReturnRange,
    Returns,
    ReturnWorld,
    badness,
    fly_home,
    heights_above_ground,
)
from logs.verdict.returns.return_starts import ReturnStarts
from logs.verdict.returns.suggest_returns import meets_return_limits
from world.arrays import Flags, Floats

# Largest number of return paths that are drawn.
MAX_WAYS = 3
# Largest number of places at which the least safe altitude is searched.
_MAX_PLACES = 40
# Step of that search above or below the flight, m.
_STEP_M = 80.0
# Number of steps in one direction.
_STEPS = 15
# Number of times that the last step is halved.
_HALVINGS = 3


@dataclass(frozen=True, slots=True, eq=False)
class WorstReturn:
    """Return that is drawn, the worst of its time range.

    found: the range.  way: (t, 3) positions a second apart, m.  at: (3,) where it goes wrong, or is lowest.
    """

    found: ReturnRange
    way: Floats
    at: Floats

    @property
    def one(self) -> ReturnFlown:
        """The return itself."""
        return self.found.worst


@dataclass(frozen=True, slots=True, eq=False)
class LeastHeights:
    """Least altitude from which a return by RTL is safe, at places on the path.

    time: (n,) s.
    height: (n,) m AMSL: if the return from the flight's own altitude is unsafe, the nearest higher altitude from which
        it is safe; otherwise the lowest altitude at which it stays safe.  NaN if no altitude was found.
    searched: range of the search above the flight, m.
    """

    time: Floats
    height: Floats
    searched: float = _STEP_M * _STEPS


@dataclass(frozen=True, slots=True, eq=False)
class DrawnReturns:
    """Returns with the data for drawing them.

    worst: the worst first.  glides: from the same places; empty if not wanted.
    """

    returns: Returns
    worst: tuple[WorstReturn, ...]
    least: LeastHeights
    glides: Glides = NOT_ASKED

    @property
    def by_kind(self) -> list[tuple[Kind, list[ReturnFlown]]]:
        """Segments of the path by the outcome of their returns; of two return paths the worse one applies."""
        by_time = sorted(self.returns.each, key=lambda one: one.time)
        worst = [min(ones, key=badness) for _, ones in groupby(by_time, lambda one: one.time)]
        return stretches(worst, lambda one: one.kind)

    @property
    def by_reach(self) -> list[tuple[Reach, list[Glide]]]:
        """Segments of the track with the same best glide destination."""
        return stretches(self.glides.each, lambda one: one.reach)


One = TypeVar("One")
Key = TypeVar("Key")


def stretches(ones: Sequence[One], key: Callable[[One], Key]) -> list[tuple[Key, list[One]]]:
    """Group consecutive items by their key; each group but the last includes the first item of the next.

    >>> stretches([1, 3, 2, 5], lambda one: one % 2)
    [(1, [1, 3, 2]), (0, [2, 5]), (1, [5])]
    """
    groups = [(key, list(group)) for key, group in groupby(ones, key)]
    for (_, group), (_, after) in pairwise(groups):
        group.append(after[0])
    return groups


def drawn_returns(
    world: ReturnWorld, starts: ReturnStarts, returns: Returns, glides: Glides = NOT_ASKED
) -> DrawnReturns:
    """Add all data for drawing to judged returns.

    starts: the places from which they were judged.
    """
    least = least_heights(world, starts if returns.each else starts.at(np.zeros(0, dtype=np.intp)))
    return DrawnReturns(returns, worst_returns(world, starts, returns), least, glides)


def draw_returns_without_glides(world: ReturnWorld, starts: ReturnStarts, returns: Returns) -> DrawnReturns:
    """Add data for drawing to judged returns, without glides and minimum altitudes, which take longest to compute."""
    return DrawnReturns(returns, worst_returns(world, starts, returns), LeastHeights(np.zeros(0), np.zeros(0)))


def worst_returns(world: ReturnWorld, starts: ReturnStarts, returns: Returns) -> tuple[WorstReturn, ...]:
    """Return the worst return of each kind of failure, then the next worst; the lowest return if all are safe."""
    unsafe = [one for one in returns.ranges if not one.worst.safe]
    firsts = {one.worst.kind: one for one in reversed(unsafe)}
    order = [one for one in unsafe if firsts[one.worst.kind] is one]
    order += [one for one in unsafe if firsts[one.worst.kind] is not one]
    chosen = order[:MAX_WAYS] or list(returns.ranges[:1])
    rows = np.array([int(np.argmin(np.abs(starts.time - one.worst.time))) for one in chosen], dtype=np.intp)
    if not chosen:
        return ()
    targets = [one.worst.target for one in chosen]
    _, ways = fly_home(world, starts.at(rows), targets, keep=True)
    return tuple(
        WorstReturn(found, way, _failure_place(world, found.worst, way))
        for found, way in zip(chosen, ways, strict=True)
    )


def _failure_place(world: ReturnWorld, one: ReturnFlown, way: Floats) -> Floats:
    """Return the place where a return fails, or where it is lowest, m, (3,)."""
    if one.kind == "threat":
        away = np.linalg.norm(way - world.around.spheres[one.threat], axis=1)
        return np.asarray(way[int(np.argmin(away))])
    if one.kind in ("ground", "low", "safe", "unsure") and not math.isnan(one.clearance_at[0]):
        return np.array(one.clearance_at)
    return np.asarray(way[-1])


# ----------------------------------------------------------------------
# The least altitude from which the aircraft could be called home.


def least_heights(world: ReturnWorld, starts: ReturnStarts) -> LeastHeights:
    """Return the least altitudes at up to `_MAX_PLACES` of the starts; NaN if the ground is unknown."""
    if not len(starts):
        return LeastHeights(np.zeros(0), np.zeros(0))
    rows = np.unique(np.linspace(0, len(starts) - 1, _MAX_PLACES).round().astype(np.intp))
    chosen = starts.at(rows)
    begins = heights_above_ground(world, chosen)
    lowest = np.where(np.isfinite(begins), np.minimum(0.0, world.limit - begins), math.nan)
    safe = meets_return_limits(world, chosen)
    # Altitudes relative to the flight, m: the last one that was safe, and the last one that was not.
    good, bad = np.where(safe, 0.0, math.nan), np.where(safe, math.nan, 0.0)
    direction = np.where(safe, -1.0, 1.0)
    going = np.isfinite(lowest)
    for step in range(1, _STEPS + 1):
        tried = np.maximum(direction * step * _STEP_M, lowest)
        ok = _safe_at_offset(world, chosen, tried, going)
        good, bad = np.where(going & ok, tried, good), np.where(going & ~ok, tried, bad)
        going &= (ok == safe) & (tried > lowest)
    for _ in range(_HALVINGS):
        both = np.isfinite(good) & np.isfinite(bad)
        middle = np.where(both, 0.5 * (good + bad), 0.0)
        ok = _safe_at_offset(world, chosen, middle, both)
        good, bad = np.where(both & ok, middle, good), np.where(both & ~ok, middle, bad)
    return LeastHeights(chosen.time, np.where(np.isfinite(lowest), chosen.rows["up"] + good, math.nan))


def _safe_at_offset(world: ReturnWorld, starts: ReturnStarts, above: Floats, asked: Flags) -> Flags:
    """Flag each return that is safe from a start ``above`` m higher, (n,); fly only those flagged in ``asked``."""
    found = np.zeros(len(starts), dtype=np.bool_)
    if asked.any():
        rows = starts.rows[asked].copy()
        rows["up"] += above[asked]
        found[asked] = meets_return_limits(world, replace(starts.at(np.flatnonzero(asked)), rows=rows))
    return found
