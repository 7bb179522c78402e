"""Suggest what makes every return safe: RTL_ALTITUDE, a climb before the turn, or rally points.

The least altitude, and the fewest points.  Each is simulated from all places, like judged returns.  Plain set cover
does not work for rally points: the autopilot goes to the nearest point and not to the best, so a set is rated by the
autopilot's choice, and an added point may take returns away from a point that was good for them.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flight.autopilots.arduplane.parameters import CLIMB_BEFORE_TURN
from flight.autopilots.arduplane.rtl_point_mass import RETURN_ARRIVED
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
from logs.verdict.tolerances import ENERGY_RESERVE_FRACTION
from logs.verdict.trials import first_that_passes
from world.arrays import Flags, Floats
from world.kernels import Records

# Margin that is kept beyond each limit, m: twice the error of the point mass.
MARGIN = 15.0
# Step of RTL_ALTITUDE, m.
_ALTITUDE_STEP_M = 25.0
# Values of RTL_CLIMB_MIN that are tried, m.
_CLIMBS_M = (20.0, 50.0, 100.0, 200.0)


@dataclass(frozen=True, slots=True)
class Remedy:
    """Suggested change.

    parameters: changed parameters, by ArduPlane's names and in its units.
    rally: rally points that replace the mission's; None keeps the mission's.
    """

    parameters: dict[str, float] = field(default_factory=dict)
    rally: tuple[ReturnPlace, ...] | None = None

    def on(self, world: ReturnWorld) -> ReturnWorld:
        """Return a world with the change."""
        changed = world.with_parameters(**self.parameters) if self.parameters else world
        return changed if self.rally is None else changed.with_rally(self.rally)


def helps(before: Returns, after: Returns) -> bool:
    """Return True if fewer returns fail with a suggestion, and no kind of failure gets more frequent.

    Only the returns that get low, and the safe returns, may become more.
    """
    more = any(after.count(kind) > before.count(kind) for kind in KINDS if kind not in ("low", "safe"))
    low = after.count("low") > before.count("low") and len(after.unsafe) >= len(before.unsafe)
    return (
        not more and not low and (len(after.unsafe) < len(before.unsafe) or after.count("safe") > before.count("safe"))
    )


@dataclass(frozen=True, slots=True)
class _Needs:
    """Requirements on the return from each start: clearance and distance outside spheres (n,), m."""

    clearance: Floats
    outside: Floats

    def at(self, chosen: NDArray[np.intp]) -> "_Needs":
        return _Needs(self.clearance[chosen], self.outside[chosen])


def _requirements(world: ReturnWorld, starts: ReturnStarts, margin: float = MARGIN) -> _Needs:
    """Return the limits plus a margin, or, if smaller, the start's own values less the height lost in the turn."""
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


def meets_return_limits(world: ReturnWorld, starts: ReturnStarts) -> Flags:
    """Flag each RTL return that stays within the limits, without margin, in the point-mass simulation alone, (n,)."""
    return _returns_meeting(world, starts, _requirements(world, starts, 0.0), _keeps_all)


def _keeps_ground(_world: ReturnWorld, flown: Records, needs: _Needs) -> Flags:
    """Flag each return that stays above its required height above ground, and arrives, (n,)."""
    return np.asarray((flown["ended"] == RETURN_ARRIVED) & (flown["clearance"] >= needs.clearance))


def _keeps_all(world: ReturnWorld, flown: Records, needs: _Needs) -> Flags:
    """Flag each return that stays above its required height, arrives, and stays outside spheres, (n,).

    `_targets_meeting` checks zones and energy.
    """
    return np.asarray(_keeps_ground(world, flown, needs) & (flown["outside"] >= needs.outside))


Keeps = Callable[[ReturnWorld, Records, _Needs], Flags]


def _returns_meeting(world: ReturnWorld, starts: ReturnStarts, needs: _Needs, keeps: Keeps) -> Flags:
    """Flag each return that meets the requirements, (n,); with `_keeps_all`, check zones and energy too."""
    return _targets_meeting(world, starts, [world.target(row) for row in starts.rows], needs, keeps)


def _targets_meeting(
    world: ReturnWorld, starts: ReturnStarts, ends: Sequence[ReturnTarget], needs: _Needs, keeps: Keeps
) -> Flags:
    outside = needs.outside if keeps is _keeps_all else np.full(len(starts), -math.inf)
    flown, ways = fly_home(world, starts, ends, (needs.clearance, outside))
    good = keeps(world, flown, needs)
    if keeps is not _keeps_all:
        return good
    if world.setup.envelope.power_level.size and world.battery_known:
        left = world.setup.battery - np.nan_to_num(starts.used) - flown["energy"]
        good &= ~(left < ENERGY_RESERVE_FRACTION * world.setup.battery)
    for k, way in enumerate(ways):
        good[k] = good[k] and (len(way) < 2 or zone_met(world, way) < 0)
    return good


class _ReturnTrial:
    """Trial of a world from all starts, which tries the starts that failed before first."""

    def __init__(self, starts: ReturnStarts, needs: _Needs) -> None:
        self._starts, self._needs = starts, needs
        self._order = list(range(len(starts)))[::-1]

    def passes(self, world: ReturnWorld, keeps: Keeps) -> bool:
        """Return True if every return meets the requirements."""
        for at, k in enumerate(self._order):
            one = np.array([k])
            if not _returns_meeting(world, self._starts.at(one), self._needs.at(one), keeps)[0]:
                self._order.insert(0, self._order.pop(at))
                return False
        return True


def suggest_parameters(world: ReturnWorld, starts: ReturnStarts) -> list[Remedy]:
    """Suggest the lowest RTL_ALTITUDE that clears the ground, the lowest safe one, or a climb before the turn.

    Altitudes are tried one by one, because a higher altitude may lead through a sphere and so be less safe.
    """
    needs = _requirements(world, starts)
    trial = _ReturnTrial(starts, needs)
    if trial.passes(world, _keeps_all):
        return []
    found = []
    lowest = max(0.0, world.parameters.rtl_altitude)
    tops = world.around.heights[np.isfinite(world.around.heights)]
    top = float(tops.max()) - world.home.up + world.limit + 2.0 * MARGIN if world.around.known else lowest + 500.0
    altitudes = np.arange(
        _ALTITUDE_STEP_M * math.ceil(lowest / _ALTITUDE_STEP_M), min(9000.0, top) + _ALTITUDE_STEP_M, _ALTITUDE_STEP_M
    )
    higher = [float(one) for one in altitudes]

    def least_altitude(least: float, keeps: Keeps) -> float | None:
        """Return the lowest altitude, at least ``least``, with which all returns meet the requirements, or None."""
        return first_that_passes(
            (one for one in higher if one >= least),
            lambda altitude: trial.passes(world.with_parameters(RTL_ALTITUDE=altitude), keeps),
        )

    above = least_altitude(0.0, _keeps_ground)
    if above is not None and above > lowest:
        found.append(Remedy({"RTL_ALTITUDE": above}))
    clear = least_altitude(above or 0.0, _keeps_all)
    if clear is not None and clear not in (above, lowest):
        found.append(Remedy({"RTL_ALTITUDE": clear}))
    if clear is None:
        found += _suggest_climbs(world, trial, above)
    return found


def _suggest_climbs(world: ReturnWorld, trial: _ReturnTrial, altitude: float | None) -> list[Remedy]:
    """Suggest a climb before the turn, alone or with an altitude, with which all returns meet the requirements."""
    options = float(int(world.parameters.flight_options) | CLIMB_BEFORE_TURN)
    tried = [{"RTL_CLIMB_MIN": climb} for climb in _CLIMBS_M] + [{"FLIGHT_OPTIONS": options}]
    if altitude is not None:
        tried += [one | {"RTL_ALTITUDE": altitude} for one in tried]
    found = first_that_passes(tried, lambda one: trial.passes(world.with_parameters(**one), _keeps_all))
    return [] if found is None else [Remedy(found)]


# ----------------------------------------------------------------------
# The fewest rally points.

# Largest number of starts in a search; starts that it then leaves unsafe are added.
_MAX_STARTS = 120
# Greatest distance of candidates from the path, m.
_MAX_PATH_DISTANCE_M = 2500.0
# Largest number of candidates.
_MAX_CANDIDATES = 320
# Least grid spacing of candidates, m.
_GRID_SPACING_M = 600.0
# Number of nearest candidates that are flown to from each start.
_FLOWN_CANDIDATES = 60
# Greatest distance of a candidate that is flown to, m.
_MAX_FLOWN_DISTANCE_M = 4500.0
# Radius around a candidate within which the ground is checked, m: the width of ArduPlane's smallest loiters.
_LOITER_RADIUS_M = 280.0
# Largest number of rally points in a set.
_MAX_POINTS = 10
# Number of searches, each with the starts that the one before left unsafe.
_ROUNDS = 4
# Number of candidate grids, each finer near unsafe starts.
_GRIDS = 3
# Number of best single points that are paired with every other point.
_PAIR_SEEDS = 30


def suggest_rally(world: ReturnWorld, starts: ReturnStarts) -> Remedy | None:
    """Suggest the fewest rally points that make as many returns safe as possible, or None if no point helps.

    Add points greedily, given the autopilot's own choice between them, then swap points, then remove superfluous ones.
    """
    needs, total = _requirements(world, starts), len(starts)
    # Without the mission's own rally points, all returns go home.
    home = _returns_meeting(world.with_rally(()), starts, needs, _keeps_all)
    if home.all() or not total or world.way == "straight to land":
        return None
    searched = np.unique(np.linspace(0, total - 1, min(total, _MAX_STARTS)).round().astype(int))
    best: tuple[int, tuple[ReturnPlace, ...]] = (int(home.sum()), ())
    places = _candidates(world, starts, _GRID_SPACING_M, _MAX_PATH_DISTANCE_M)
    for _ in range(_GRIDS):
        if not places:
            break
        search = _Search(world, starts, needs, places, home)
        count, points, missed = _search_in_rounds(search, world, starts, needs, searched, len(best[1]))
        best = max(best, (count, points), key=lambda one: (one[0], -len(one[1])))
        if not missed.size:
            break
        # Keep the points found, and add a finer grid around the starts left unsafe.
        searched = np.union1d(searched, missed[:: max(1, len(missed) // 20)])
        places = [*best[1], *_candidates(world, starts.at(missed), _GRID_SPACING_M / 3.0, 0.6 * _MAX_PATH_DISTANCE_M)]
    points = tuple(point._replace(number=k) for k, point in enumerate(best[1], 1))
    return Remedy(rally=points) if points else None


def _search_in_rounds(
    search: "_Search",
    world: ReturnWorld,
    starts: ReturnStarts,
    needs: _Needs,
    searched: NDArray[np.intp],
    first: int,
) -> tuple[int, tuple[ReturnPlace, ...], NDArray[np.intp]]:
    """Search, simulate all starts, and search again with the starts that were left unsafe.

    first: the number of first candidates in the initial set.
    Returns the number of good returns, the points, and the starts that are left unsafe.
    """
    best: tuple[int, tuple[ReturnPlace, ...], NDArray[np.intp]] = (-1, (), np.zeros(0, dtype=np.intp))
    for _ in range(_ROUNDS):
        points = tuple(search.places[c] for c in search.find(searched, list(range(first))))
        good = _returns_meeting(world.with_rally(points), starts, needs, _keeps_all)
        missed = np.flatnonzero(~good)
        if int(good.sum()) > best[0]:
            best = int(good.sum()), points, missed
        unasked = np.setdiff1d(missed, searched)
        if not unasked.size:
            break
        # A few of each run are enough.
        searched = np.union1d(searched, unasked[:: max(1, len(unasked) // 20)])
    return best


def _candidates(world: ReturnWorld, starts: ReturnStarts, pitch: float, near: float) -> list[ReturnPlace]:
    """Return candidate rally points near the path whose loiters are clear of ground and spheres, low and 200 m higher.

    pitch: grid spacing, m, increased if there are too many candidates.  near: maximum distance from the path, m.
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
        if 2 * len(grid) <= _MAX_CANDIDATES or pitch > 20_000.0:
            break
        pitch *= 1.2
    found = []
    for x, y in grid.tolist():
        floor = _highest_ground(world, x, y) + world.limit + MARGIN
        for up in (floor, floor + 200.0):
            if math.isfinite(up) and _sphere_clearance(world, (x, y, up)) > _LOITER_RADIUS_M + MARGIN:
                height = math.ceil(up - world.home.up)
                found.append(ReturnPlace(x, y, world.home.up + height, world.home.up))
    return [one._replace(number=k) for k, one in enumerate(found, 1)]


def _highest_ground(world: ReturnWorld, east: float, north: float) -> float:
    """Return the highest ground within the loiter around a place, m AMSL; NaN if part of the ground is unknown."""
    if world.scenario.terrain is None:
        return world.home.up
    angles = np.arange(16) * (math.pi / 8.0)
    rings = np.concatenate([np.zeros(1), *(np.full(16, share * _LOITER_RADIUS_M) for share in (0.33, 0.67, 1.0))])
    turned = np.concatenate([np.zeros(1), angles, angles, angles])
    heights = world.scenario.terrain.height(east + rings * np.cos(turned), north + rings * np.sin(turned))
    return float(np.max(heights))


def _sphere_clearance(world: ReturnWorld, place: tuple[float, float, float]) -> float:
    """Return a place's distance outside the nearest kill sphere, m."""
    away = np.linalg.norm(world.around.spheres - np.array(place), axis=1) - world.around.radii
    return float(np.min(away[world.around.radii > 0.0], initial=math.inf))


class _Search:
    """Search for rally points, based on which returns to each candidate meet the requirements.

    Returns to the candidates are simulated when first needed.
    """

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
        """Return candidates that are good for as many of the starts as possible; chosen: the initial set."""
        self._simulate_candidates(asked[~self._known[asked]])
        while len(chosen) < _MAX_POINTS and self._count(asked, chosen) < len(asked):
            more = self._with_best_addition(asked, chosen)
            if self._count(asked, more) <= self._count(asked, chosen):
                break
            chosen = self._with_swaps(asked, more)
        return self._without_superfluous(asked, chosen)

    def _with_best_addition(self, searched: NDArray[np.intp], chosen: list[int]) -> list[int]:
        """Return the set with the best point added, or with the best pair if no single point is an improvement."""
        every = range(len(self.places))
        counts = [self._count(searched, [*chosen, c]) for c in every]
        if max(counts) > self._count(searched, chosen):
            return [*chosen, int(np.argmax(counts))]
        first = np.argsort(counts, kind="stable")[::-1][:_PAIR_SEEDS].tolist()
        return max(([*chosen, a, c] for a in first for c in every), key=lambda more: self._count(searched, more))

    def _simulate_candidates(self, searched: NDArray[np.intp]) -> None:
        """Simulate returns from starts to their nearest candidates; all other candidates are rated as bad."""
        pairs = [
            (k, int(c))
            for k in searched
            for c in np.argsort(self._away[k])[:_FLOWN_CANDIDATES]
            if self._away[k, c] < _MAX_FLOWN_DISTANCE_M
        ]
        self._known[searched] = True
        if not pairs:
            return
        first, second = (np.array(column) for column in zip(*pairs, strict=True))
        places = (self.places[c] for c in second.tolist())
        ends = [self._world.going_on(ReturnTarget(place[:3], "", "", 0.0, place.base)) for place in places]
        starts, needs = self._starts.at(first), self._needs.at(first)
        self._good[first, second] = _targets_meeting(self._world, starts, ends, needs, _keeps_all)

    def _count(self, searched: NDArray[np.intp], chosen: list[int]) -> int:
        """Return the number of good returns with these rally points, by the autopilot's choice."""
        if not chosen:
            return int(self._home[searched].sum())
        away = self._away[np.ix_(searched, np.array(chosen))]
        nearest = np.argmin(away, axis=1)
        least = away[np.arange(len(searched)), nearest]
        goes_home = least > self._limit
        if self._world.parameters.rally_includes_home > 0.0:
            goes_home |= self._to_home[searched] <= least
        good = np.where(goes_home, self._home[searched], self._good[searched, np.array(chosen)[nearest]])
        return int(good.sum())

    def _with_swaps(self, searched: NDArray[np.intp], chosen: list[int]) -> list[int]:
        """Return a set of the same size, after swapping points for better ones until no swap is an improvement."""
        best, improved = self._count(searched, chosen), True
        while improved:
            improved = False
            for i in range(len(chosen)):
                for c in range(len(self.places)):
                    other = [*chosen[:i], c, *chosen[i + 1 :]]
                    count = self._count(searched, other)
                    if count > best:
                        best, chosen, improved = count, other, True
        return chosen

    def _without_superfluous(self, searched: NDArray[np.intp], chosen: list[int]) -> list[int]:
        """Return the set without superfluous points."""
        for c in list(chosen):
            fewer = [one for one in chosen if one != c]
            if self._count(searched, fewer) >= self._count(searched, chosen):
                chosen = fewer
        return chosen
