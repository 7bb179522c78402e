"""What would make every return safe: the least RTL_ALTITUDE, a climb before the turn, or the fewest rally points.

Each is tried by the law from all places, as returns are judged.  Plain set cover would not do for rally points: the
autopilot goes to the nearest one and not to the best, so a set is counted by what it chooses, and a point that is
added may take returns away from one that was good for them.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flight.autopilots.arduplane.parameters import CLIMB_BEFORE_TURN
from flight.autopilots.arduplane.swift_return import CIRCLED
from flight.mission.return_path import ReturnPlace, ReturnTarget
from logs.verdict.returns.judge_returns import (
    KINDS,
    TURN,
    Returns,
    ReturnWorld,
    floors,
    fly_home,
    heights_above_ground,
    zone_met,
)
from logs.verdict.returns.return_starts import ReturnStarts
from logs.verdict.tolerances import RESERVE
from world.kernels import Records

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

# What is kept beyond each limit, m: twice what the point mass was wrong by.
MARGIN = 15.0
# m, of RTL_ALTITUDE.
_STEP = 25.0
# Heights that RTL_CLIMB_MIN is tried with, m.
_CLIMBS = (20.0, 50.0, 100.0, 200.0)


@dataclass(frozen=True, slots=True)
class Remedy:
    """What is suggested.

    parameters: by ArduPlane's names and in its units, that change.
    rally: rally points in place of the mission's; None leaves those.
    """

    parameters: dict[str, float] = field(default_factory=dict)
    rally: tuple[ReturnPlace, ...] | None = None

    def on(self, world: ReturnWorld) -> ReturnWorld:
        """A world with it."""
        changed = world.with_parameters(**self.parameters) if self.parameters else world
        return changed if self.rally is None else changed.with_rally(self.rally)


def helps(before: Returns, after: Returns) -> bool:
    """Whether returns with something suggested are better than without: fewer go wrong, and in no way more than before.

    Only of those that come low, and of those that are safe, there may be more.
    """
    more = any(after.count(kind) > before.count(kind) for kind in KINDS if kind not in ("low", "safe"))
    low = after.count("low") > before.count("low") and len(after.unsafe) >= len(before.unsafe)
    return (
        not more and not low and (len(after.unsafe) < len(before.unsafe) or after.count("safe") > before.count("safe"))
    )


@dataclass(frozen=True, slots=True)
class _Needs:
    """What is asked of the return from each start: clearance and distance outside spheres (n,), m."""

    clearance: Floats
    outside: Floats

    def at(self, chosen: NDArray[np.intp]) -> "_Needs":
        return _Needs(self.clearance[chosen], self.outside[chosen])


def _needs(world: ReturnWorld, starts: ReturnStarts, margin: float = MARGIN) -> _Needs:
    """The limits with their margin, or what the start itself has, less what the turn takes, where that is less."""
    rows = starts.rows
    outside = np.full(len(starts), math.inf)
    clear = np.nan_to_num(heights_above_ground(world, starts), nan=math.inf)
    place = np.stack([rows["east"], rows["north"], rows["up"]], axis=1)
    for centre, radius in zip(world.around.spheres, world.around.radii, strict=True):
        if radius > 0.0:
            outside = np.minimum(outside, np.linalg.norm(place - centre, axis=1) - radius)
    least = floors(world, starts)
    return _Needs(
        np.where(starts.low, least, np.minimum(world.limit + margin, np.maximum(least, clear - TURN))),
        np.minimum(margin, np.maximum(0.0, outside - TURN)),
    )


def come_home(world: ReturnWorld, starts: ReturnStarts) -> Flags:
    """Which returns (n,) by RTL keep the limits themselves, on the point mass alone."""
    return _flown_well(world, starts, _needs(world, starts, 0.0), _keep_all)


def _keep_ground(_world: ReturnWorld, flown: Records, needs: _Needs) -> Flags:
    """Whether returns keep what is asked of their height above ground, and arrive."""
    return np.asarray((flown["ended"] == CIRCLED) & (flown["clearance"] >= needs.clearance))


def _keep_all(world: ReturnWorld, flown: Records, needs: _Needs) -> Flags:
    """Whether they keep outside spheres too; zones and energy are asked of the whole set in the end."""
    return np.asarray(_keep_ground(world, flown, needs) & (flown["outside"] >= needs.outside))


Keeps = Callable[[ReturnWorld, Records, _Needs], Flags]


def _flown_well(world: ReturnWorld, starts: ReturnStarts, needs: _Needs, keeps: Keeps) -> Flags:
    """Which returns keep what is asked; zones and the energy at hand count too, where all is asked."""
    return _ends_well(world, starts, [world.target(row) for row in starts.rows], needs, keeps)


def _ends_well(
    world: ReturnWorld, starts: ReturnStarts, ends: Sequence[ReturnTarget], needs: _Needs, keeps: Keeps
) -> Flags:
    outside = needs.outside if keeps is _keep_all else np.full(len(starts), -math.inf)
    flown, ways = fly_home(world, starts, ends, (needs.clearance, outside))
    good = keeps(world, flown, needs)
    if keeps is not _keep_all:
        return good
    if world.setup.envelope.power_level.size and world.battery_known:
        left = world.setup.battery - np.nan_to_num(starts.used) - flown["energy"]
        good &= ~(left < RESERVE * world.setup.battery)
    for k, way in enumerate(ways):
        good[k] = good[k] and (len(way) < 2 or zone_met(world, way) < 0)
    return good


class _Trial:
    """Asks of all starts whether a world is good, those first that were not good before."""

    def __init__(self, starts: ReturnStarts, needs: _Needs) -> None:
        self._starts, self._needs = starts, needs
        self._order = list(range(len(starts)))[::-1]

    def passes(self, world: ReturnWorld, keeps: Keeps) -> bool:
        """Whether every return keeps what is asked."""
        for at, k in enumerate(self._order):
            one = np.array([k])
            if not _flown_well(world, self._starts.at(one), self._needs.at(one), keeps)[0]:
                self._order.insert(0, self._order.pop(at))
                return False
        return True


def suggest_parameters(world: ReturnWorld, starts: ReturnStarts) -> list[Remedy]:
    """The least RTL_ALTITUDE that keeps all returns above ground, and off all else; and a climb before the turn.

    Altitudes are tried one by one: that a higher one is safer is not certain, for it may lead through a sphere.
    """
    needs = _needs(world, starts)
    trial = _Trial(starts, needs)
    if trial.passes(world, _keep_all):
        return []
    found = []
    lowest = max(0.0, world.parameters.rtl_altitude)
    tops = world.around.heights[np.isfinite(world.around.heights)]
    top = float(tops.max()) - world.home.up + world.limit + 2.0 * MARGIN if world.around.known else lowest + 500.0
    altitudes = np.arange(_STEP * math.ceil(lowest / _STEP), min(9000.0, top) + _STEP, _STEP)
    higher = [float(one) for one in altitudes]
    above = next((a for a in higher if trial.passes(world.with_parameters(RTL_ALTITUDE=a), _keep_ground)), None)
    if above is not None and above > lowest:
        found.append(Remedy({"RTL_ALTITUDE": above}))
    higher = [a for a in higher if a >= (above or 0.0)]
    clear = next((a for a in higher if trial.passes(world.with_parameters(RTL_ALTITUDE=a), _keep_all)), None)
    if clear is not None and clear not in (above, lowest):
        found.append(Remedy({"RTL_ALTITUDE": clear}))
    if clear is None:
        found += _climbs(world, trial, above)
    return found


def _climbs(world: ReturnWorld, trial: _Trial, altitude: float | None) -> list[Remedy]:
    """A climb before the turn, alone or with an altitude, that is good for all."""
    options = float(int(world.parameters.flight_options) | CLIMB_BEFORE_TURN)
    tried = [{"RTL_CLIMB_MIN": climb} for climb in _CLIMBS] + [{"FLIGHT_OPTIONS": options}]
    if altitude is not None:
        tried += [one | {"RTL_ALTITUDE": altitude} for one in tried]
    good = (one for one in tried if trial.passes(world.with_parameters(**one), _keep_all))
    return [Remedy(one) for one in [next(good, None)] if one is not None]


# ----------------------------------------------------------------------
# The fewest rally points.

# Starts that a search looks at, at most; those that it then leaves unsafe join them.
_STARTS = 120
# Candidates: so near to the way (m), at most so many, on a grid of at least so many metres.
_NEAR, _CANDIDATES, _GRID = 2500.0, 320, 600.0
# How many of the nearest candidates, and how far away, are flown to from each start.
_FLOWN_TO, _FAR = 60, 4500.0
# The ground is looked at so far around a candidate, m: as wide as ArduPlane's smallest circles are flown.
_CIRCLE = 280.0
# Rally points of a set; times that a search begins again with what it left unsafe, and with finer candidates there.
_MAX_POINTS, _ROUNDS, _FINER = 10, 4, 3
# Of the best single points, so many are tried with every other one.
_PAIRS = 30


def suggest_rally(world: ReturnWorld, starts: ReturnStarts) -> Remedy | None:
    """The fewest rally points found that make every return safe, or as many as can be; None for none that help.

    Greedy by the autopilot's own choice, then swaps, then what can be left out.
    """
    needs, total = _needs(world, starts), len(starts)
    # With the aircraft's own rally points taken away, the rest goes home.
    home = _flown_well(world.with_rally(()), starts, needs, _keep_all)
    if home.all() or not total or world.way == "straight to land":
        return None
    asked = np.unique(np.linspace(0, total - 1, min(total, _STARTS)).round().astype(int))
    best: tuple[int, tuple[ReturnPlace, ...]] = (int(home.sum()), ())
    places = _candidates(world, starts, _GRID, _NEAR)
    for _ in range(_FINER):
        if not places:
            break
        search = _Search(world, starts, needs, places, home)
        count, points, missed = _rounds(search, world, starts, needs, asked, len(best[1]))
        best = max(best, (count, points), key=lambda one: (one[0], -len(one[1])))
        if not missed.size:
            break
        # What was found, and a finer grid about what it left unsafe.
        asked = np.union1d(asked, missed[:: max(1, len(missed) // 20)])
        places = [*best[1], *_candidates(world, starts.at(missed), _GRID / 3.0, 0.6 * _NEAR)]
    points = tuple(point._replace(number=k) for k, point in enumerate(best[1], 1))
    return Remedy(rally=points) if points else None


def _rounds(
    search: "_Search", world: ReturnWorld, starts: ReturnStarts, needs: _Needs, asked: NDArray[np.intp], first: int
) -> tuple[int, tuple[ReturnPlace, ...], NDArray[np.intp]]:
    """Search, ask all starts, and search again with those that were left unsafe.

    first: so many of the first candidates are the set to begin with.
    Returns how many returns are good, the points, and the starts that are left unsafe.
    """
    best: tuple[int, tuple[ReturnPlace, ...], NDArray[np.intp]] = (-1, (), np.zeros(0, dtype=np.intp))
    for _ in range(_ROUNDS):
        points = tuple(search.places[c] for c in search.find(asked, list(range(first))))
        good = _flown_well(world.with_rally(points), starts, needs, _keep_all)
        missed = np.flatnonzero(~good)
        if int(good.sum()) > best[0]:
            best = int(good.sum()), points, missed
        unasked = np.setdiff1d(missed, asked)
        if not unasked.size:
            break
        # A few of each stretch are enough.
        asked = np.union1d(asked, unasked[:: max(1, len(unasked) // 20)])
    return best


def _candidates(world: ReturnWorld, starts: ReturnStarts, pitch: float, near: float) -> list[ReturnPlace]:
    """Places near the way whose circle is above ground and outside spheres, low and 200 m higher.

    pitch: of their grid, m, wider where they would be too many.  near: how far from the way they are at most, m.
    """
    east, north = starts.rows["east"], starts.rows["north"]
    while True:
        grid = np.stack(
            np.meshgrid(
                np.arange(east.min() - near, east.max() + near, pitch),
                np.arange(north.min() - near, north.max() + near, pitch),
            ),
            axis=-1,
        ).reshape(-1, 2)
        away = np.min(np.hypot(grid[:, :1] - east[None], grid[:, 1:] - north[None]), axis=1)
        grid = grid[away < near]
        if 2 * len(grid) <= _CANDIDATES or pitch > 20_000.0:
            break
        pitch *= 1.2
    found = []
    for x, y in grid.tolist():
        floor = _highest_around(world, x, y) + world.limit + MARGIN
        for up in (floor, floor + 200.0):
            if math.isfinite(up) and _outside(world, (x, y, up)) > _CIRCLE + MARGIN:
                height = math.ceil(up - world.home.up)
                found.append(ReturnPlace(x, y, world.home.up + height, world.home.up))
    return [one._replace(number=k) for k, one in enumerate(found, 1)]


def _highest_around(world: ReturnWorld, east: float, north: float) -> float:
    """Highest ground within the circle about a place, m AMSL; NaN where some of it is not known."""
    if world.scenario.terrain is None:
        return world.home.up
    angles = np.arange(16) * (math.pi / 8.0)
    rings = np.concatenate([np.zeros(1), *(np.full(16, share * _CIRCLE) for share in (0.33, 0.67, 1.0))])
    turned = np.concatenate([np.zeros(1), angles, angles, angles])
    heights = world.scenario.terrain.height(east + rings * np.cos(turned), north + rings * np.sin(turned))
    return float(np.max(heights))


def _outside(world: ReturnWorld, place: tuple[float, float, float]) -> float:
    """How far outside every kill sphere a place is, m."""
    away = np.linalg.norm(world.around.spheres - np.array(place), axis=1) - world.around.radii
    return float(np.min(away[world.around.radii > 0.0], initial=math.inf))


class _Search:
    """Which rally points to choose, by which returns to each candidate are good; these are flown when first asked."""

    def __init__(
        self, world: ReturnWorld, starts: ReturnStarts, needs: _Needs, places: list[ReturnPlace], home: Flags
    ) -> None:
        self._world, self._starts, self._needs, self.places, self._home = world, starts, needs, places, home
        at = np.array([(place.east, place.north) for place in places])
        rows = starts.rows
        self._away = np.hypot(rows["east"][:, None] - at[None, :, 0], rows["north"][:, None] - at[None, :, 1])
        self._to_home = np.hypot(rows["east"] - world.home.east, rows["north"] - world.home.north)
        limit = world.parameters.rally_limit
        self._limit = limit if limit > 0.0 else math.inf
        self._good = np.zeros(self._away.shape, dtype=np.bool_)
        self._known = np.zeros(len(starts), dtype=np.bool_)

    def find(self, asked: NDArray[np.intp], chosen: list[int]) -> list[int]:
        """Candidates that are good for the starts asked, as many as can be; chosen: to begin with."""
        self._fly(asked[~self._known[asked]])
        while len(chosen) < _MAX_POINTS and self._count(asked, chosen) < len(asked):
            more = self._longer(asked, chosen)
            if self._count(asked, more) <= self._count(asked, chosen):
                break
            chosen = self._swapped(asked, more)
        return self._pruned(asked, chosen)

    def _longer(self, asked: NDArray[np.intp], chosen: list[int]) -> list[int]:
        """With the best point more; or the best two, where one alone takes away as much as it gives."""
        every = range(len(self.places))
        counts = [self._count(asked, [*chosen, c]) for c in every]
        if max(counts) > self._count(asked, chosen):
            return [*chosen, int(np.argmax(counts))]
        first = np.argsort(counts, kind="stable")[::-1][:_PAIRS].tolist()
        return max(([*chosen, a, c] for a in first for c in every), key=lambda more: self._count(asked, more))

    def _fly(self, asked: NDArray[np.intp]) -> None:
        """Fly from starts to their nearest candidates; the others count as bad."""
        pairs = [(k, int(c)) for k in asked for c in np.argsort(self._away[k])[:_FLOWN_TO] if self._away[k, c] < _FAR]
        self._known[asked] = True
        if not pairs:
            return
        first, second = (np.array(column) for column in zip(*pairs, strict=True))
        places = (self.places[c] for c in second.tolist())
        ends = [self._world.going_on(ReturnTarget(place[:3], "", "", 0.0, place.base)) for place in places]
        starts, needs = self._starts.at(first), self._needs.at(first)
        self._good[first, second] = _ends_well(self._world, starts, ends, needs, _keep_all)

    def _count(self, asked: NDArray[np.intp], chosen: list[int]) -> int:
        """How many returns are good with these rally points, by the autopilot's choice."""
        if not chosen:
            return int(self._home[asked].sum())
        away = self._away[np.ix_(asked, np.array(chosen))]
        nearest = np.argmin(away, axis=1)
        least = away[np.arange(len(asked)), nearest]
        goes_home = least > self._limit
        if self._world.parameters.rally_includes_home > 0.0:
            goes_home |= self._to_home[asked] <= least
        good = np.where(goes_home, self._home[asked], self._good[asked, np.array(chosen)[nearest]])
        return int(good.sum())

    def _swapped(self, asked: NDArray[np.intp], chosen: list[int]) -> list[int]:
        """The same number of points, each swapped for a better one while there is one."""
        best, improved = self._count(asked, chosen), True
        while improved:
            improved = False
            for i in range(len(chosen)):
                for c in range(len(self.places)):
                    other = [*chosen[:i], c, *chosen[i + 1 :]]
                    count = self._count(asked, other)
                    if count > best:
                        best, chosen, improved = count, other, True
        return chosen

    def _pruned(self, asked: NDArray[np.intp], chosen: list[int]) -> list[int]:
        """Without the points that nothing is lost without."""
        for c in list(chosen):
            fewer = [one for one in chosen if one != c]
            if self._count(asked, fewer) >= self._count(asked, chosen):
                chosen = fewer
        return chosen
