"""What pictures show of returns: the ways of the worst, and how low the aircraft could be called home from.

Neither is needed to judge returns, and both take as long as that: they are flown where a picture is asked for.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

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
from logs.verdict.returns.suggest_returns import come_home

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

# Ways that are drawn.
MAX_WAYS = 3
# The least height is looked for from so many places at the most, so far below and above the flight (m), in steps that
# are halved at the end.
_PLACES, _STEP, _STEPS, _HALVINGS = 40, 80.0, 15, 3


@dataclass(frozen=True, slots=True, eq=False)
class WorstReturn:
    """A return that is drawn, the worst of its seconds.

    found: these seconds.  way: (t, 3) places a second apart, m.  at: (3,) where it goes wrong, or comes lowest.
    """

    found: ReturnRange
    way: Floats
    at: Floats

    @property
    def one(self) -> ReturnFlown:
        """The return."""
        return self.found.worst


@dataclass(frozen=True, slots=True, eq=False)
class LeastHeights:
    """The least height that a return by RTL is safe from, at places of the way.

    time: (n,) s.
    height: (n,) m AMSL: from the flight's own height the nearest above it from which the return is safe, where that
        from its own is not; else how low it stays safe when the flight is lowered.  NaN where no height was found.
    searched: how far above the flight it was looked for, m.
    """

    time: Floats
    height: Floats
    searched: float = _STEP * _STEPS


@dataclass(frozen=True, slots=True, eq=False)
class DrawnReturns:
    """Returns with what is drawn of them.

    worst: the worst first.  glides: from the same places; none where that was not asked.
    """

    returns: Returns
    worst: tuple[WorstReturn, ...]
    least: LeastHeights
    glides: Glides = NOT_ASKED

    @property
    def by_kind(self) -> list[tuple[Kind, list[ReturnFlown]]]:
        """Stretches of the way from which returns come to the same; where there are two ways home the worse counts."""
        by_time = sorted(self.returns.each, key=lambda one: one.time)
        worst = [min(ones, key=badness) for _, ones in groupby(by_time, lambda one: one.time)]
        return stretches(worst, lambda one: one.kind)

    @property
    def by_reach(self) -> list[tuple[Reach, list[Glide]]]:
        """Stretches of the way from which the same can be reached without an engine."""
        return stretches(self.glides.each, lambda one: one.reach)


One = TypeVar("One")
Key = TypeVar("Key")


def stretches(ones: Sequence[One], key: Callable[[One], Key]) -> list[tuple[Key, list[One]]]:
    """What is alike in a row, by its key; each but the last goes on to where the next begins.

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
    """What is drawn of returns that were judged.

    starts: that they were judged from.
    """
    least = least_heights(world, starts if returns.each else starts.at(np.zeros(0, dtype=np.intp)))
    return DrawnReturns(returns, worst_returns(world, starts, returns), least, glides)


def plainly_drawn(world: ReturnWorld, starts: ReturnStarts, returns: Returns) -> DrawnReturns:
    """The same without glides and least heights, which take longest."""
    return DrawnReturns(returns, worst_returns(world, starts, returns), LeastHeights(np.zeros(0), np.zeros(0)))


def worst_returns(world: ReturnWorld, starts: ReturnStarts, returns: Returns) -> tuple[WorstReturn, ...]:
    """The worst of each kind of trouble first, and then the next worst; the lowest where all are safe."""
    wrong = [one for one in returns.ranges if not one.worst.safe]
    firsts = {one.worst.kind: one for one in reversed(wrong)}
    order = [one for one in wrong if firsts[one.worst.kind] is one]
    order += [one for one in wrong if firsts[one.worst.kind] is not one]
    chosen = order[:MAX_WAYS] or list(returns.ranges[:1])
    rows = np.array([int(np.argmin(np.abs(starts.time - one.worst.time))) for one in chosen], dtype=np.intp)
    if not chosen:
        return ()
    targets = [one.worst.target for one in chosen]
    _, ways = fly_home(world, starts.at(rows), targets, keep=True)
    return tuple(
        WorstReturn(found, way, _where(world, found.worst, way)) for found, way in zip(chosen, ways, strict=True)
    )


def _where(world: ReturnWorld, one: ReturnFlown, way: Floats) -> Floats:
    """Where a return goes wrong, or comes lowest."""
    if one.kind == "threat":
        away = np.linalg.norm(way - world.around.spheres[one.threat], axis=1)
        return np.asarray(way[int(np.argmin(away))])
    if one.kind in ("ground", "low", "safe", "unsure") and not math.isnan(one.clearance_at[0]):
        return np.array(one.clearance_at)
    return np.asarray(way[-1])


# ----------------------------------------------------------------------
# How low the aircraft could be called home from.


def least_heights(world: ReturnWorld, starts: ReturnStarts) -> LeastHeights:
    """The least heights at up to `_PLACES` of the starts; NaN where the ground is not known."""
    if not len(starts):
        return LeastHeights(np.zeros(0), np.zeros(0))
    rows = np.unique(np.linspace(0, len(starts) - 1, _PLACES).round().astype(np.intp))
    chosen = starts.at(rows)
    begins = heights_above_ground(world, chosen)
    lowest = np.where(np.isfinite(begins), np.minimum(0.0, world.limit - begins), math.nan)
    safe = come_home(world, chosen)
    # Heights over the flight's own, m: the last from which it was safe, and from which it was not.
    good, bad = np.where(safe, 0.0, math.nan), np.where(safe, math.nan, 0.0)
    direction = np.where(safe, -1.0, 1.0)
    going = np.isfinite(lowest)
    for step in range(1, _STEPS + 1):
        tried = np.maximum(direction * step * _STEP, lowest)
        ok = _safe_from(world, chosen, tried, going)
        good, bad = np.where(going & ok, tried, good), np.where(going & ~ok, tried, bad)
        going &= (ok == safe) & (tried > lowest)
    for _ in range(_HALVINGS):
        both = np.isfinite(good) & np.isfinite(bad)
        middle = np.where(both, 0.5 * (good + bad), 0.0)
        ok = _safe_from(world, chosen, middle, both)
        good, bad = np.where(both & ok, middle, good), np.where(both & ~ok, middle, bad)
    return LeastHeights(chosen.time, np.where(np.isfinite(lowest), chosen.rows["up"] + good, math.nan))


def _safe_from(world: ReturnWorld, starts: ReturnStarts, above: Floats, asked: Flags) -> Flags:
    """Whether returns are safe from so much higher, m; those that are not asked for are not flown."""
    found = np.zeros(len(starts), dtype=np.bool_)
    if asked.any():
        rows = starts.rows[asked].copy()
        rows["up"] += above[asked]
        found[asked] = come_home(world, replace(starts.at(np.flatnonzero(asked)), rows=rows))
    return found
