"""Suggest changes that make every return to launch safe.

These are other parameters (`ReturnTrials`), or rally points.

The suggested altitude is the lowest that was found, and the number of rally points is the smallest.  Each suggestion is
simulated from all starts, like judged returns.  Plain set cover does not work for rally points: the autopilot goes to
the nearest point and not to the best, so a set is rated by the autopilot's choice, and an added point may take returns
away from a better point.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from flight.autopilots.simulated_returns import RETURN_ARRIVED
from flight.mission.return_path import ReturnPoint, ReturnTarget, rally_target
from logs.verdict.returns.judge_returns import (
    KINDS,
    TURN_HEIGHT_LOSS_M,
    Returns,
    ReturnWorld,
    deepest_violation,
    exclude_approaches,
    flies_landing_approach,
    heights_above_ground,
    possible_heights,
    required_heights,
)
from logs.verdict.returns.return_starts import ReturnStarts
from logs.verdict.tolerances import ENERGY_RESERVE_FRACTION
from logs.verdict.trials import first_that_passes
from world.arrays import Flags, Floats
from world.kernels import Records

# Margin that is kept beyond each limit, m: twice the error of the point mass.
RETURN_LIMIT_MARGIN_M = 15.0
# Step of the height of a return above its destination, m.
_ALTITUDE_STEP_M = 25.0


@dataclass(frozen=True, slots=True)
class Remedy:
    """Suggested change of parameters or rally points.

    parameters: changed parameters, by the autopilot's names and in its units.
    rally: rally points that replace the mission's; None keeps the mission's.
    """

    parameters: dict[str, float] = field(default_factory=dict, hash=False)
    rally: tuple[ReturnPoint, ...] | None = None

    def apply_to(self, world: ReturnWorld) -> ReturnWorld:
        """Return the world with the change applied."""
        changed_world = world.with_parameters(**self.parameters) if self.parameters else world
        return changed_world if self.rally is None else changed_world.with_rally(self.rally)


def is_improvement(before: Returns, after: Returns) -> bool:
    """Return True if a change gives more safe or fewer unsafe returns, and no more failures of any kind.

    before, after: returns without and with the change.

    "low" returns may become more frequent only if fewer returns are unsafe.
    """
    has_more_failures = any(after.count(kind) > before.count(kind) for kind in KINDS if kind not in ("low", "safe"))
    has_more_low_returns = after.count("low") > before.count("low") and len(after.unsafe) >= len(before.unsafe)
    return (
        not has_more_failures
        and not has_more_low_returns
        and (len(after.unsafe) < len(before.unsafe) or after.count("safe") > before.count("safe"))
    )


@dataclass(frozen=True, slots=True)
class _ReturnLimits:
    """Limits of the return to launch from each of n starts.

    clearance: required height above ground, m, (n,).
    sphere_distance: required distance outside kill spheres, m, (n,).
    """

    clearance: Floats
    sphere_distance: Floats

    def subset(self, indices: NDArray[np.intp]) -> "_ReturnLimits":
        """Return the limits of the starts with these indices."""
        return _ReturnLimits(self.clearance[indices], self.sphere_distance[indices])


def _return_limits(world: ReturnWorld, starts: ReturnStarts, margin: float = RETURN_LIMIT_MARGIN_M) -> _ReturnLimits:
    """Return the height above ground and the sphere distance that the return from each start must keep.

    If the start itself is lower or closer to a sphere, only its own value minus the height lost in the turn is
    required.

    margin: margin that is added to the required height, and required as distance from the spheres, m.
    """
    rows = starts.rows
    sphere_distances = np.full(len(starts), math.inf)
    start_heights = np.nan_to_num(heights_above_ground(world, starts), nan=math.inf)
    positions = np.stack([rows["east"], rows["north"], rows["up"]], axis=1)
    for center, radius in zip(world.environment.spheres, world.environment.radii, strict=True):
        if radius > 0.0:
            sphere_distances = np.minimum(sphere_distances, np.linalg.norm(positions - center, axis=1) - radius)
    min_heights = possible_heights(world, starts)
    return _ReturnLimits(
        np.where(
            starts.is_low,
            min_heights,
            np.minimum(world.limit + margin, np.maximum(min_heights, start_heights - TURN_HEIGHT_LOSS_M)),
        ),
        np.minimum(margin, np.maximum(0.0, sphere_distances - TURN_HEIGHT_LOSS_M)),
    )


def meets_return_limits(world: ReturnWorld, starts: ReturnStarts) -> Flags:
    """Return a mask (n,): True for each start whose simulated RTL keeps all limits, without any margin."""
    limits = replace(_return_limits(world, starts, margin=0.0), clearance=required_heights(world, starts))
    return _rtls_meet_criterion(world, starts, limits, _meets_all_limits)


def _clears_ground(_world: ReturnWorld, results: Records, limits: _ReturnLimits) -> Flags:
    """Return a mask (n,): True for each return that arrives and keeps the required height above ground."""
    return np.asarray((results["outcome"] == RETURN_ARRIVED) & (results["clearance"] >= limits.clearance))


def _meets_all_limits(world: ReturnWorld, results: Records, limits: _ReturnLimits) -> Flags:
    """Return a mask (n,): True for each return that arrives, keeps the required height and avoids spheres.

    Zones and energy are not in the results; `_meets_criterion` checks them.
    """
    return np.asarray(_clears_ground(world, results, limits) & (results["sphere_distance"] >= limits.sphere_distance))


# Function that returns a mask of the simulated returns (dtype `RETURN_RESULT`) that keep certain limits.
Criterion = Callable[[ReturnWorld, Records, _ReturnLimits], Flags]


def _rtls_meet_criterion(
    world: ReturnWorld, starts: ReturnStarts, limits: _ReturnLimits, criterion: Criterion
) -> Flags:
    """Return a mask (n,): True for each start whose RTL meets a criterion.

    The RTL goes to the destination that the autopilot chooses.

    criterion: see `_meets_criterion`.
    """
    return _meets_criterion(world, starts, [world.target(row) for row in starts.rows], limits, criterion)


def _meets_criterion(
    world: ReturnWorld,
    starts: ReturnStarts,
    targets: Sequence[ReturnTarget],
    limits: _ReturnLimits,
    criterion: Criterion,
) -> Flags:
    """Simulate returns and return a mask (n,): True for each return to its target that meets a criterion.

    starts, targets, limits: start, target and limits of each return, n of each.
    criterion: `_clears_ground` or `_meets_all_limits`; with the latter, zones and energy are checked, too.
    """
    sphere_distances = limits.sphere_distance if criterion is _meets_all_limits else np.full(len(starts), -math.inf)
    # A return that is too close or too low is aborted, but not on its approach to a landing.
    abort_heights = np.where(flies_landing_approach(targets), -math.inf, limits.clearance)
    simulated = world.fly(
        starts.rows,
        targets,
        store_positions=bool(world.airspace.zones),
        abort_limits=(abort_heights, sphere_distances),
    )
    results = exclude_approaches(world, starts, targets, simulated.results, limits.clearance)
    is_met = criterion(world, results, limits)
    if criterion is not _meets_all_limits:
        return is_met
    if world.is_energy_known:
        energy_left = world.setup.battery - np.nan_to_num(starts.energy_used) - results["energy"]
        is_met &= ~(energy_left < ENERGY_RESERVE_FRACTION * world.setup.battery)
    for k, path in enumerate(simulated.tracks):
        is_met[k] = is_met[k] and (len(path) < 2 or deepest_violation(world, path) is None)
    return is_met


class _ReturnTrial:
    """Test whether the returns from all starts meet a criterion in a changed world.

    The starts that failed last are tested first.
    """

    def __init__(self, starts: ReturnStarts, limits: _ReturnLimits) -> None:
        self._starts, self._limits = starts, limits
        self._order = list(range(len(starts)))[::-1]

    def passes(self, world: ReturnWorld, criterion: Criterion) -> bool:
        """Return True if every return meets the criterion.

        A start that fails is moved to the front, so that the next trial fails early.
        """
        for position, start in enumerate(self._order):
            index = np.array([start])
            if not _rtls_meet_criterion(world, self._starts.subset(index), self._limits.subset(index), criterion)[0]:
                self._order.insert(0, self._order.pop(position))
                return False
        return True


def suggest_parameters(world: ReturnWorld, starts: ReturnStarts) -> list[Remedy]:
    """Suggest RTL altitudes, or else other parameters, with which every return is safe.

    Up to two heights are suggested: the lowest with which all returns clear the ground, and the lowest with which all
    are safe.  Return [] if the returns already keep all limits with the present parameters.
    Heights are tried one by one, because a higher return may lead through a sphere and need not be safer.

    If the returns fly straight to a landing sequence, where the RTL altitude has no effect, other endings of the return
    are suggested, alone or with the changes that they need.
    """
    limits = _return_limits(world, starts)
    trial = _ReturnTrial(starts, limits)
    if trial.passes(world, _meets_all_limits):
        return []
    endings = world.autopilot.returns.trials.endings
    if world.rtl_ending == "straight to land" and endings:
        passing_ending = first_that_passes(
            endings, lambda ending: trial.passes(world.with_parameters(**ending), _meets_all_limits)
        )
        if passing_ending is not None:
            return [Remedy(dict(passing_ending))]
        return [
            Remedy({**ending, **remedy.parameters})
            for ending in endings
            for remedy in suggest_parameters(world.with_parameters(**ending), starts)
        ]
    remedies: list[Remedy] = []
    lowest_values: dict[str, float] = {}
    for present_values in world.autopilot.returns.trials.altitudes:
        search = _AltitudeSearch(world, present_values)
        ground_altitude = search.lowest(min_altitude=0.0, criterion=_clears_ground, trial=trial)
        if ground_altitude is not None and ground_altitude > search.current:
            lowest_values = lowest_values or search.values(ground_altitude)
            remedies.append(Remedy(search.values(ground_altitude)))
        safe_altitude = search.lowest(ground_altitude or 0.0, _meets_all_limits, trial)
        if safe_altitude is None:
            # No height keeps the margin on all returns: take the lowest height with which they are safe.
            trial_without_margin = _ReturnTrial(starts, _return_limits(world, starts, margin=0.0))
            safe_altitude = search.lowest(min_altitude=0.0, criterion=_meets_all_limits, trial=trial_without_margin)
        if safe_altitude is not None and safe_altitude not in (ground_altitude, search.current):
            remedies.append(Remedy(search.values(safe_altitude)))
        if safe_altitude is not None:
            return remedies
    # Other parameters with which all returns are safe.
    candidates = [dict(values) for values in world.autopilot.returns.trials.others]
    if lowest_values:
        candidates += [candidate | lowest_values for candidate in candidates]
    passing_candidate = first_that_passes(
        candidates, lambda candidate: trial.passes(world.with_parameters(**candidate), _meets_all_limits)
    )
    return [*remedies, *([] if passing_candidate is None else [Remedy(passing_candidate)])]


class _AltitudeSearch:
    """Search upwards for the lowest sufficient RTL altitude above the destination.

    The search starts at the present value.
    """

    def __init__(self, world: ReturnWorld, present_values: Mapping[str, float]) -> None:
        """Prepare the heights to try.

        present_values: parameters of the return height and their present values, m, as in `ReturnTrials.altitudes`.
        """
        self._world, self._present_values = world, present_values
        self.current = next(iter(present_values.values()))
        ground_heights = world.environment.heights[np.isfinite(world.environment.heights)]
        # Up to the height that clears all ground; without terrain, up to 500 m more than at present.
        max_altitude = (
            float(ground_heights.max()) - world.home.up + world.limit + 2.0 * RETURN_LIMIT_MARGIN_M
            if world.environment.known
            else self.current + 500.0
        )
        altitude_grid = np.arange(
            _ALTITUDE_STEP_M * math.ceil(self.current / _ALTITUDE_STEP_M),
            min(9000.0, max_altitude) + _ALTITUDE_STEP_M,
            _ALTITUDE_STEP_M,
        )
        self._candidates = [float(altitude) for altitude in altitude_grid]

    def values(self, altitude: float) -> dict[str, float]:
        """Return the new values, by name, of the parameters that are now below an altitude, m."""
        return {name: altitude for name, present in self._present_values.items() if altitude > present}

    def lowest(self, min_altitude: float, criterion: Criterion, trial: _ReturnTrial) -> float | None:
        """Return the lowest altitude from `min_altitude` on at which all returns pass, m, or None."""
        return first_that_passes(
            (altitude for altitude in self._candidates if altitude >= min_altitude),
            lambda altitude: trial.passes(self._world.with_parameters(**self.values(altitude)), criterion),
        )


# ----------------------------------------------------------------------
# The fewest rally points.

# Largest number of starts in the first search; starts that remain unsafe are added later.
_MAX_STARTS = 120
# Greatest distance of candidates from the path, m.
_MAX_PATH_DISTANCE_M = 2500.0
# Largest number of candidates.
_MAX_CANDIDATES = 320
# Smallest grid spacing of candidates, m.
_GRID_SPACING_M = 600.0
# Number of candidates, the nearest ones, to which returns are simulated from each start.
_SIMULATED_CANDIDATES = 60
# Greatest distance from a start of a candidate to which returns are simulated, m.
_MAX_SIMULATED_DISTANCE_M = 4500.0
# Radius around a candidate within which the ground is checked, m: the width of ArduPlane's smallest loiters.
_LOITER_RADIUS_M = 280.0
# Largest number of rally points in a set.
_MAX_POINTS = 10
# Number of searches, each including starts that the previous search left unsafe.
_SEARCH_ROUNDS = 4
# Number of candidate grids, each finer near unsafe starts.
_GRID_COUNT = 3
# Number of best single points that are paired with every other point.
_PAIR_SEED_COUNT = 30


def suggest_rally_points(world: ReturnWorld, starts: ReturnStarts) -> Remedy | None:
    """Suggest the fewest rally points that make the most returns safe; None if no point helps.

    The search adds the best points one by one, swaps points, and removes superfluous points.  Each return goes to the
    point that the autopilot would choose.
    """
    limits, start_count = _return_limits(world, starts), len(starts)
    # Without the mission's own rally points, all returns go home.
    is_good_from_home = _rtls_meet_criterion(world.with_rally(()), starts, limits, _meets_all_limits)
    if is_good_from_home.all() or not start_count or world.rtl_ending == "straight to land":
        return None
    searched_starts = np.unique(np.linspace(0, start_count - 1, min(start_count, _MAX_STARTS)).round().astype(int))
    best_set: tuple[int, tuple[ReturnPoint, ...]] = (int(is_good_from_home.sum()), ())
    candidates = _rally_candidates(world, starts, _GRID_SPACING_M, _MAX_PATH_DISTANCE_M)
    for _ in range(_GRID_COUNT):
        if not candidates:
            break
        search = _RallySearch(world, starts, limits, candidates, is_good_from_home)
        good_count, points, unsafe_starts = _search_in_rounds(
            search, world, starts, limits, searched_starts, len(best_set[1])
        )
        best_set = max(best_set, (good_count, points), key=lambda result: (result[0], -len(result[1])))
        if not unsafe_starts.size:
            break
        # Keep the points found, and add a finer grid around the starts that remain unsafe.
        searched_starts = np.union1d(searched_starts, unsafe_starts[:: max(1, len(unsafe_starts) // 20)])
        candidates = [
            *best_set[1],
            *_rally_candidates(world, starts.subset(unsafe_starts), _GRID_SPACING_M / 3.0, 0.6 * _MAX_PATH_DISTANCE_M),
        ]
    points = tuple(point._replace(number=k) for k, point in enumerate(best_set[1], 1))
    return Remedy(rally=points) if points else None


def _search_in_rounds(
    search: "_RallySearch",
    world: ReturnWorld,
    starts: ReturnStarts,
    limits: _ReturnLimits,
    searched_starts: NDArray[np.intp],
    initial_count: int,
) -> tuple[int, tuple[ReturnPoint, ...], NDArray[np.intp]]:
    """Search for rally points, simulate all returns, and search again with the starts that remain unsafe.

    searched_starts: indices of the starts of the first search.
    initial_count: the first `initial_count` candidates are the initial set.

    Return for the best round the number of returns that keep all limits, the points, and the starts that remain unsafe.
    """
    best_result: tuple[int, tuple[ReturnPoint, ...], NDArray[np.intp]] = (-1, (), np.zeros(0, dtype=np.intp))
    for _ in range(_SEARCH_ROUNDS):
        points = tuple(
            search.candidates[candidate] for candidate in search.find(searched_starts, list(range(initial_count)))
        )
        is_good = _rtls_meet_criterion(world.with_rally(points), starts, limits, _meets_all_limits)
        unsafe_starts = np.flatnonzero(~is_good)
        if int(is_good.sum()) > best_result[0]:
            best_result = int(is_good.sum()), points, unsafe_starts
        unsearched_starts = np.setdiff1d(unsafe_starts, searched_starts)
        if not unsearched_starts.size:
            break
        # About 20 of the unsafe starts are enough.
        searched_starts = np.union1d(searched_starts, unsearched_starts[:: max(1, len(unsearched_starts) // 20)])
    return best_result


def _rally_candidates(
    world: ReturnWorld, starts: ReturnStarts, spacing: float, max_distance: float
) -> list[ReturnPoint]:
    """Return candidate rally points on a grid near the path, at two altitudes, clear of kill spheres.

    spacing: grid spacing, m, increased if there are too many candidates.
    max_distance: maximum distance from the path, m.
    """
    east, north = starts.rows["east"], starts.rows["north"]
    while True:
        grid = np.stack(
            np.meshgrid(
                np.arange(east.min() - max_distance, east.max() + max_distance, spacing),
                np.arange(north.min() - max_distance, north.max() + max_distance, spacing),
            ),
            axis=-1,
        ).reshape(-1, 2)
        distances = np.min(np.hypot(grid[:, :1] - east[None], grid[:, 1:] - north[None]), axis=1)
        grid = grid[distances < max_distance]
        if 2 * len(grid) <= _MAX_CANDIDATES or spacing > 20_000.0:
            break
        spacing *= 1.2
    candidates = []
    # PX4 ends its return at this height above a rally point, which lies on the ground.  ArduPlane ends at the point.
    end_height = world.autopilot.returns.rules.rally_height
    for grid_east, grid_north in grid.tolist():
        # Highest ground below a loiter around the point, m AMSL; NaN if any of the ground is unknown.
        if world.scenario.terrain is None:
            highest_ground = world.home.up
        else:
            # The center, and 16 points on each of three circles.
            angles = np.arange(16) * (math.pi / 8.0)
            radii = np.concatenate(
                [np.zeros(1), *(np.full(16, fraction * _LOITER_RADIUS_M) for fraction in (0.33, 0.67, 1.0))]
            )
            directions = np.concatenate([np.zeros(1), angles, angles, angles])
            heights = world.scenario.terrain.height(
                grid_east + radii * np.cos(directions), grid_north + radii * np.sin(directions)
            )
            highest_ground = float(np.max(heights))
        min_altitude = highest_ground + world.limit + RETURN_LIMIT_MARGIN_M
        for altitude in (min_altitude, min_altitude + 200.0):
            # Distance outside the nearest kill sphere.
            spheres, sphere_radii = world.environment.spheres, world.environment.radii
            distances = np.linalg.norm(spheres - np.array([grid_east, grid_north, altitude]), axis=1) - sphere_radii
            sphere_distance = float(np.min(distances[sphere_radii > 0.0], initial=math.inf))
            if math.isfinite(altitude) and sphere_distance > _LOITER_RADIUS_M + RETURN_LIMIT_MARGIN_M:
                point_altitude = altitude
                if end_height > 0.0:
                    terrain = world.scenario.terrain
                    point_altitude = max(
                        world.home.up if terrain is None else float(terrain.height(grid_east, grid_north)),
                        altitude - end_height,
                    )
                height = math.ceil(point_altitude - world.home.up)
                candidates.append(ReturnPoint(grid_east, grid_north, world.home.up + height, world.home.up))
    return [place._replace(number=k) for k, place in enumerate(candidates, 1)]


class _RallySearch:
    """Search for the set of candidate rally points with the most good returns.

    A return is good if it keeps all limits.  Returns to the candidates are simulated when first needed.
    """

    def __init__(
        self,
        world: ReturnWorld,
        starts: ReturnStarts,
        limits: _ReturnLimits,
        candidates: list[ReturnPoint],
        is_good_from_home: Flags,
    ) -> None:
        self._world, self._starts, self._limits, self.candidates, self._is_good_from_home = (
            world,
            starts,
            limits,
            candidates,
            is_good_from_home,
        )
        positions = np.array([(place.east, place.north) for place in candidates])
        rows = starts.rows
        self._distances = np.hypot(
            rows["east"][:, None] - positions[None, :, 0], rows["north"][:, None] - positions[None, :, 1]
        )
        # Without rally points the return goes home, or to the mission's landing, which competes with them.
        other_targets = [world.with_rally(()).target(row) for row in rows]
        includes_home = world.autopilot.returns.rules.includes_home
        self._other_distances = np.array(
            [target.distance if includes_home or target.straight else math.inf for target in other_targets]
        )
        limit = world.autopilot.returns.rules.rally_limit
        self._max_rally_distance = limit if limit > 0.0 else math.inf
        self._is_good = np.zeros(self._distances.shape, dtype=np.bool_)
        self._is_simulated = np.zeros(len(starts), dtype=np.bool_)

    def find(self, searched_starts: NDArray[np.intp], point_set: list[int]) -> list[int]:
        """Find a set of candidates with as many good returns from the searched starts as possible.

        The search adds the best candidate and swaps candidates, as long as this increases the number of good returns,
        up to `_MAX_POINTS` candidates.

        point_set: initial set, as indices of candidates.
        """
        # Simulate the returns from new starts to their nearest candidates; all other returns are taken as unsafe.
        new_starts = searched_starts[~self._is_simulated[searched_starts]]
        pairs = [
            (start, int(candidate))
            for start in new_starts
            for candidate in np.argsort(self._distances[start])[:_SIMULATED_CANDIDATES]
            if self._distances[start, candidate] < _MAX_SIMULATED_DISTANCE_M
        ]
        self._is_simulated[new_starts] = True
        if pairs:
            start_indices, candidate_indices = (np.array(column) for column in zip(*pairs, strict=True))
            rules, starts = self._world.autopilot.returns.rules, self._starts.subset(start_indices)
            targets = [
                self._world.with_landing(
                    rally_target(rules, (row["east"], row["north"], row["up"]), self.candidates[candidate])
                )
                for row, candidate in zip(starts.rows, candidate_indices.tolist(), strict=True)
            ]
            self._is_good[start_indices, candidate_indices] = _meets_criterion(
                self._world, starts, targets, self._limits.subset(start_indices), _meets_all_limits
            )
        candidates = range(len(self.candidates))
        while len(point_set) < _MAX_POINTS and self._count_good(searched_starts, point_set) < len(searched_starts):
            # Add the best point, or the best pair if no single point is an improvement.
            counts = [self._count_good(searched_starts, [*point_set, candidate]) for candidate in candidates]
            extended_set = [*point_set, int(np.argmax(counts))]
            if max(counts) <= self._count_good(searched_starts, point_set):
                best_single_points = np.argsort(counts, kind="stable")[::-1][:_PAIR_SEED_COUNT].tolist()
                extended_set = max(
                    ([*point_set, point, candidate] for point in best_single_points for candidate in candidates),
                    key=lambda pair_set: self._count_good(searched_starts, pair_set),
                )
            if self._count_good(searched_starts, extended_set) <= self._count_good(searched_starts, point_set):
                break
            # Swap points for other candidates until no swap increases the number of good returns.
            point_set, has_improved = extended_set, True
            while has_improved:
                best_count, has_improved = self._count_good(searched_starts, point_set), False
                for position, candidate in itertools.product(range(len(point_set)), candidates):
                    swapped_set = [*point_set[:position], candidate, *point_set[position + 1 :]]
                    count = self._count_good(searched_starts, swapped_set)
                    if count > best_count:
                        best_count, point_set, has_improved = count, swapped_set, True
        # Remove the points that do not increase the number of good returns.
        for candidate in list(point_set):
            smaller_set = [other for other in point_set if other != candidate]
            if self._count_good(searched_starts, smaller_set) >= self._count_good(searched_starts, point_set):
                point_set = smaller_set
        return point_set

    def _count_good(self, searched_starts: NDArray[np.intp], point_set: list[int]) -> int:
        """Return the number of good returns from the searched starts if these candidates are the rally points.

        The autopilot chooses the nearest point.  It returns as without rally points if this point is too far away, or
        farther than another destination.
        """
        if not point_set:
            return int(self._is_good_from_home[searched_starts].sum())
        distances = self._distances[np.ix_(searched_starts, np.array(point_set))]
        nearest_indices = np.argmin(distances, axis=1)
        min_distances = distances[np.arange(len(searched_starts)), nearest_indices]
        ignores_rally_points = min_distances > self._max_rally_distance
        ignores_rally_points |= self._other_distances[searched_starts] <= min_distances
        is_good = np.where(
            ignores_rally_points,
            self._is_good_from_home[searched_starts],
            self._is_good[searched_starts, np.array(point_set)[nearest_indices]],
        )
        return int(is_good.sum())
