"""Compute a Pareto front of plans in length, exposure, clearance, and time or energy.

An estimation of distribution algorithm (`planner.optimisers.front_sampling`) searches over the coordinates along,
across and up of all waypoints in the rotated frame. It starts from the planner's own paths: the default plan, and
routes past the obstacles, shortened for various preferences. Each preference is a bound or a cost of shortening: more
height above ground, more distance from radars, and time or energy instead of length. All paths meet the graded
constraints of a search, and every plan of the front has its own certificate.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from aircraft.path_limits import Limits
from planner.airspace.zone_limits import is_limited
from planner.evaluation.certify import certify
from planner.evaluation.encoding import RotatedFrame, rotated_frame
from planner.evaluation.front_scores import Value, front_values
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import Problem, ProblemArrays, make_problem, threat_records
from planner.evaluation.threat_index import make_missile_index
from planner.evaluation.travel_cost import TravelCost, energy_cost, time_cost
from planner.optimisers.front_sampling import FrontSampling
from planner.optimisers.hypervolume import covering_order
from planner.plan import Objective, Plan
from planner.search.algorithms import find_algorithm, limits_for
from planner.search.plan_path import plan_path
from planner.search.replan import with_waypoints
from planner.search.search_state import SearchProgress, StopCondition
from planner.seeding.first_samples import bridge_modes
from planner.seeding.shortening import resample, shorten_path
from planner.seeding.side_routes import optimistic_grid, side_routes
from world.arrays import Floats
from world.random_streams import PLANNER, stream
from world.scenario import Scenario

# Clearance preferences of the seeds, as fractions of the additional height above ground that the fixed ends allow.
CLEARANCE_SHARES = (0.0, 0.25, 0.5, 0.75, 0.95)
# Radar preferences of the seeds: fractions of the radars' radius that paths keep out of.
RADAR_SHARES = (0.0, 0.35, 0.5, 0.65, 0.8, 1.0)
# Grid for routes past the obstacles, which are shortened for each preference in addition to the default plan; see
# `planner.search.seeds`. Number of stages of the grid.
STAGES = 50
# Size of the area of highest ground, as a fraction of a step.
SPREAD = 0.2
# Spacing across, as a fraction of a step.
RATIO = 1.0 / 3.0
# Reduction of the spheres.
SHRINK = 0.3
# Maximum number of routes.
MAX_ROUTES = 3
# Maximum cost of a route relative to the length of the default path.
SLACK = 1.25
# Fractions of the search margins beyond the certificate's margins, tried in this order.
MARGINS = (0.5, 0.1, 0.0)
# Minimum number of solutions that the search keeps.
ARCHIVE = 100
# Number of solutions that the search keeps per requested plan.
KEPT = 2
# Samples per generation.
POPULATION = 120
# Number of generations.
GENERATIONS = 400
# Largest deviation of the noise along, as a fraction of an interval.
ALONG = 0.3
# Largest deviation of the noise across, as a fraction of the straight line.
ACROSS = 0.1
# Largest deviation of the noise up, as a fraction of the height range.
UP = 0.3
# Reference point: length and time or energy relative to the default plan.
MOST_LENGTH = 1.5
# Reference point: exposure relative to the default plan.
MOST_EXPOSURE = 1.5
# Exposure used in place of the default plan's exposure if that is lower, s.
LEAST_EXPOSURE = 1.0
# Noticeable gains: a plan that gains no more than these amounts over another plan in any objective is not a separate
# choice. With these amounts fronts of 20 plans cover as much as without (`benchmarks.planning.fronts`); with twice the
# amounts there were 17 plans for `jacksboro`.
# Noticeable gain of length and of time or energy, as a fraction of the default plan.
NOTICED = 0.001
# Noticeable gain of exposure, as a fraction of the default plan.
NOTICED_EXPOSURE = 0.01
# Noticeable gain of clearance, m.
NOTICED_CLEARANCE = 1.0


@dataclass(frozen=True, slots=True)
class FrontPlan:
    """Plan of a front, and its values in SI units: m, s, m, s, J (NaN if the aircraft's power is unknown)."""

    plan: Plan
    length: float
    exposure: float
    clearance: float
    time: float
    energy: float


@dataclass(frozen=True, slots=True)
class Front:
    """Plans, the shortest first; no plan is better than another plan in every objective.

    Of any two plans at least one gains more than `noticed_amounts` over the other in some objective.

    asked: maximum number of plans, as requested.
    fourth: fourth objective, after length, exposure and clearance: "time" or "energy".
    default: the shortest plan, found by the planner alone, and its values.
    reference: (4,) reference point of the hypervolume, clearance negated; plans beyond it are ignored.
    evaluations: paths evaluated, without the default plan's evaluations.
    refused: number of other plans that were not safe once they were completed.
    """

    plans: tuple[FrontPlan, ...]
    asked: int
    fourth: str
    default: FrontPlan
    reference: Floats
    evaluations: int
    refused: int = 0

    def objectives(self) -> Floats:
        """Return the objectives (n, 4) of the plans; smaller is better for all of them."""
        return np.array([_objective_row(one, self.fourth) for one in self.plans]).reshape(-1, 4)


def _objective_row(one: FrontPlan, fourth: str) -> list[float]:
    return [one.length, one.exposure, -one.clearance, one.time if fourth == "time" else one.energy]


def plan_front(
    scenario: Scenario,
    limits: Limits,
    count: int,
    *,
    seed: int,
    progress: SearchProgress | None = None,
    stop: StopCondition | None = None,
    default: Plan | None = None,
    waypoints: int | None = None,
    finish: Callable[[Plan], Plan] = lambda plan: plan,
    generations: int = GENERATIONS,
) -> Front:
    """Compute up to `count` plans of a front.

    The front is empty if the default planner finds no safe plan.
    There are fewer plans if no further plan has a noticeable gain over the others.
    The fourth objective is energy, or time if the scenario's objective is time or the aircraft's power is unknown.
    default: the completed plan to begin from; None to plan it here, and to finish it like the others.
    waypoints: number of waypoints of the other plans during the search, including both ends; None for the number of the
    default plan.
    finish: completes a plan, for example with departure and approach; only plans that are safe afterwards are taken.
    The same scenario, limits, count and seed give the same front.

    >>> from planfly.workflow.airframe import load_airframe
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("hard-07")
    >>> front = plan_front(scenario, load_airframe(scenario).limits, 4, seed=1, generations=5)
    >>> len(front.plans), all(one.plan.safe for one in front.plans)
    (4, True)
    """
    task = front_task(scenario, limits)
    if default is None:
        default = finish(plan_path(scenario, limits, seed=seed, progress=progress, stop=stop))
    path = with_waypoints(default.waypoints, waypoints or 0)
    task = fitted_task(task, path)
    first = _with_values(task, default)
    reference = reference_point(task, first)
    if not default.safe or len(path) == 2:
        # A path of two waypoints has no inner waypoint to move.
        return Front((first,) if default.safe else (), count, task.fourth, first, reference, 0)
    size = max(ARCHIVE, KEPT * count)
    search = make_sampling(task, len(path), reference, size, stream(seed, PLANNER))
    evaluations = _search(task, search, path, progress, stop, generations)
    chosen, refused = _certify_distinct(task, search, count, first, replace(default, evaluations=evaluations), finish)
    plans = tuple(sorted(chosen, key=lambda one: one.length))
    return Front(plans, count, task.fourth, first, reference, evaluations, refused)


# --- The problem ---


class FrontTask(NamedTuple):
    """Problem with several objectives.

    scored: the problem with margins between the search's and the certificate's: shortening ends at the margins of a
        search, within the tolerance of the certificate.
    frame: frame in which waypoints are sampled. energy: cost of energy, or None if the power is unknown.
    fourth: "time" or "energy". travel: cost of this fourth objective.
    """

    problem: Problem
    scored: ProblemArrays
    frame: RotatedFrame
    energy: TravelCost | None
    fourth: str
    travel: TravelCost

    def values(self, paths: Floats) -> Floats:
        """Return the values (n, 5) of paths (n, w, 3)."""
        return front_values(self.problem.search, self.energy, paths)

    def scores(self, paths: Floats) -> tuple[Floats, Floats]:
        """Return objectives (n, 4), and violations (n, 5) of four graded constraints and of the exposure to missiles.

        Objectives are infinite if a constraint is violated: they are not needed then, and take most of the time.
        """
        violations, graded = graded_scores(self.scored, paths)
        every = np.concatenate([violations, graded[:, Objective.KILL_EXPOSURE, None]], axis=1)
        out, met = np.full((len(paths), 4), np.inf), (every <= 0.0).all(axis=1)
        out[met] = self.objectives(self.values(paths[met]))
        return out, every

    def objectives(self, values: Floats) -> Floats:
        """Convert values (n, 5) to the objectives length, exposure, negated clearance, and time or energy, (n, 4)."""
        fourth = Value.TIME if self.fourth == "time" else Value.ENERGY
        out = values[:, [Value.LENGTH, Value.EXPOSURE, Value.CLEARANCE, fourth]]
        out[:, 2] *= -1.0
        return np.asarray(out)

    def vectors(self, paths: Floats) -> Floats:
        """Return the inner waypoints of paths (n, w, 3) in the rotated frame, (n, 3 (w - 2))."""
        return np.asarray(self.frame.rotate(paths[:, 1:-1]).reshape(len(paths), -1))

    def paths(self, vectors: Floats) -> Floats:
        """Return the paths (n, w, 3) of vectors (n, 3 (w - 2))."""
        data, count = self.problem.search, len(vectors)
        inside = self.frame.restore(vectors.reshape(count, -1, 3))
        ends = [np.broadcast_to(end, (count, 1, 3)) for end in (data.start, data.destination)]
        return np.ascontiguousarray(np.concatenate([ends[0], inside, ends[1]], axis=1))


def front_task(scenario: Scenario, limits: Limits) -> FrontTask:
    """Make the problem of a scenario with several objectives, with the margins of the default planner's search."""
    chosen = find_algorithm(None, scenario.name)
    problem = make_problem(scenario, limits_for(chosen, limits))
    table = problem.search.aircraft
    energy = energy_cost(limits.envelope, table)
    by_energy = energy is not None and scenario.planner.objective != "time"
    travel = energy if energy is not None and by_energy else time_cost(table)
    frame = rotated_frame(problem.space.start, problem.space.destination)
    scored = _with_margins(problem, MARGINS[0])
    return FrontTask(problem, scored, frame, energy, "energy" if by_energy else "time", travel)


def _with_margins(problem: Problem, share: float) -> ProblemArrays:
    """Return the problem with margins between the certificate's (share 0) and the search's (share 1)."""
    search, certified = problem.search, problem.certified
    names = ("buffer", "start_buffer", "destination_buffer", "kill_margin")
    least = {name: getattr(certified, name) for name in names}
    return search._replace(**{name: low + share * (getattr(search, name) - low) for name, low in least.items()})


def fitted_task(task: FrontTask, default: Floats) -> FrontTask:
    """Return the task with margins that the default path (w, 3) has, so that others may pass equally narrow gaps."""
    for share in MARGINS:
        task = task._replace(scored=_with_margins(task.problem, share))
        if (task.scores(default[None])[1] <= 0.0).all():
            break
    return task


def reference_point(task: FrontTask, default: FrontPlan) -> Floats:
    """Return the reference point of the hypervolume, beyond which plans are ignored, (4,).

    It is 1.5 times the default plan's length, exposure and time or energy, and the required clearance.
    """
    length, exposure, _, fourth = _objective_row(default, task.fourth)
    most = max(LEAST_EXPOSURE, MOST_EXPOSURE * exposure)
    required = -task.problem.certified.clearance
    return np.array([MOST_LENGTH * length, most, required, MOST_LENGTH * fourth])


def _with_values(task: FrontTask, plan: Plan) -> FrontPlan:
    """Return a plan with its values; the clearance is taken from the certificate."""
    row = task.values(np.array(plan.waypoints)[None])[0]
    required = task.problem.certified.clearance
    clearance = plan.certificate.clearance + required
    return FrontPlan(plan, row[Value.LENGTH], row[Value.EXPOSURE], clearance, row[Value.TIME], row[Value.ENERGY])


# --- Seeds ---


def seed_paths(task: FrontTask, default: Floats) -> Iterator[Floats]:
    """Yield paths (w, 3) for various preferences, from the default path (w, 3) and routes past the obstacles."""
    yield default
    count = len(default)
    routes = [default, *(resample(route, count) for route in _routes(task, default))]
    for wanted in _preferred_problems(task):
        for route in routes:
            path, _ = shorten_path(wanted, route)
            # Shorten again from equal legs, as for the default plan.
            path, _ = shorten_path(wanted, resample(path, count))
            yield path


def _routes(task: FrontTask, default: Floats) -> list[Floats]:
    """Return routes (k, 3) on other sides of the obstacles, or no routes among zones, which routes ignore."""
    data, frame = task.problem.search, task.frame
    if is_limited(data.airspace):
        return []
    half = 0.5 * SLACK * frame.length
    grid = optimistic_grid(data, frame, (-half, half), STAGES, shrink=SHRINK, spread=SPREAD, ratio=RATIO)
    bound = SLACK * float(np.sqrt((np.diff(default, axis=0) ** 2).sum(axis=1)).sum())
    return [frame.restore(route.points) for route in side_routes(data, frame, grid, bound, MAX_ROUTES)]


def _preferred_problems(task: FrontTask) -> Iterator[ProblemArrays]:
    """Yield variants of the problem with a larger clearance, with radars as obstacles, and with another cost."""
    data, scenario = task.problem.search, task.problem.scenario
    at_ends = np.stack([[end, end] for end in (data.start, data.destination)])
    spare = max(0.0, float(task.values(at_ends)[:, Value.CLEARANCE].min()) - data.clearance)
    radars = RADAR_SHARES if (scenario.threats.detection_radius > 0.0).any() else RADAR_SHARES[:1]
    for radar in radars:
        units = threat_records(scenario.threats).copy()
        units["kill_radius"] = np.maximum(units["kill_radius"], radar * units["detection_radius"])
        index = make_missile_index(units)
        for share in CLEARANCE_SHARES:
            more = max(data.buffer, share * spare)
            stricter = data._replace(missiles=index, buffer=more)
            yield stricter
            yield stricter._replace(travel=task.travel)


# --- The search ---


def _search(
    task: FrontTask,
    search: FrontSampling,
    default: Floats,
    progress: SearchProgress | None,
    stop: StopCondition | None,
    generations: int,
) -> int:
    """Sample generations from the seeds, and return the number of paths evaluated."""
    paths = []
    for path in seed_paths(task, np.array(default)):
        paths.append(path)
        if stop is not None and stop():
            break
    seeds = np.array(paths)
    search.tell(task.vectors(seeds), *task.scores(seeds))
    evaluations = len(seeds)
    for generation in range(generations):
        if len(search.vectors) == 0 or (stop is not None and stop()):
            break
        vectors = search.ask()
        search.tell(vectors, *task.scores(task.paths(vectors)))
        evaluations += len(vectors)
        if progress is not None:
            progress(generation + 1, generations, f"{len(search.vectors)} paths that no other dominates")
    return evaluations


def make_sampling(
    task: FrontTask, waypoints: int, reference: Floats, size: int, rng: np.random.Generator
) -> FrontSampling:
    """Make the estimation of distribution for paths of `waypoints` waypoints, with an archive of `size` solutions."""
    data, frame, inner = task.problem.search, task.frame, waypoints - 2
    corners = np.array([[x, y, 0.0] for x in (data.west, data.east) for y in (data.south, data.north)])
    rotated = frame.rotate(corners)
    low = np.array([rotated[:, 0].min(), rotated[:, 1].min(), data.floor])
    high = np.array([rotated[:, 0].max(), rotated[:, 1].max(), data.ceiling])
    scales = np.array([ALONG * frame.length / (inner + 1), ACROSS * frame.length, UP * (high[2] - low[2])])
    return FrontSampling(
        np.tile(low, inner), np.tile(high, inner), directions(inner, scales), reference, 3, size, POPULATION, rng
    )


def directions(inner: int, scales: Floats) -> Floats:
    """Return noise directions (k, 3 inner), smooth modes of the whole path and bumps of up to four waypoints.

    scales: (3,) largest deviations along, across and up.
    """
    modes, deviations = bridge_modes(inner)
    waves = (modes * deviations / np.abs(modes[:, 0]).max()).T
    bumps = [
        np.where((np.arange(inner) >= begin) & (np.arange(inner) < begin + width), 1.0, 0.0)
        for width in (1, 2, 4)
        for begin in range(max(1, inner - width + 1))
    ]
    shapes = np.array([*waves, *bumps])
    out = np.zeros((len(shapes), 3, inner, 3))
    for axis in range(3):
        out[:, axis, :, axis] = shapes * scales[axis]
    return out.reshape(3 * len(shapes), 3 * inner)


def noticed_amounts(default: FrontPlan, fourth: str) -> Floats:
    """Return the noticeable gains (4,) of the objectives relative to a default plan."""
    length, exposure, _, last = _objective_row(default, fourth)
    least = NOTICED_EXPOSURE * max(LEAST_EXPOSURE, exposure)
    return np.array([NOTICED * length, least, NOTICED_CLEARANCE, NOTICED * last])


def distinct_rows(objectives: Floats, amounts: Floats) -> list[int]:
    """Return the indices of objectives (n, m), in order, that gain more than an amount (m,) over all rows taken before.

    The additive epsilon-dominance of Laumanns, Thiele, Deb and Zitzler (Evolutionary Computation 10, 2002): a row is
    left out if a row taken before is worse by no more than the amounts in every objective.

    >>> distinct_rows(np.array([[1.0, 9.0], [1.1, 8.9], [2.0, 5.0], [9.0, 4.9]]), np.array([0.5, 0.5]))
    [0, 2]
    """
    taken: list[int] = []
    for row, values in enumerate(objectives):
        if not (objectives[taken] <= values + amounts).all(axis=1).any():
            taken.append(row)
    return taken


def _certify_distinct(
    task: FrontTask,
    search: FrontSampling,
    count: int,
    first: FrontPlan,
    template: Plan,
    finish: Callable[[Plan], Plan],
) -> tuple[list[FrontPlan], int]:
    """Return up to `count` distinct plans that cover most of the safe ones, and the number of unsafe others.

    Each plan is certified and completed. first: the completed default plan, which is included if no plan is better.
    """
    amounts, found = noticed_amounts(first, task.fourth), dict[int, FrontPlan]()
    left = np.arange(len(search.vectors))
    while True:
        ranked = left[covering_order(search.objectives[left], search.reference, len(left))]
        order = ranked[distinct_rows(search.objectives[ranked], amounts)][:count].tolist()
        for row in order:
            if row not in found:
                path = task.paths(search.vectors[row][None])[0]
                found[row] = _with_values(task, finish(_make_plan(task, path, template)))
        refused = [row for row in order if not found[row].plan.safe]
        chosen: list[FrontPlan] = []
        if not refused:
            chosen = _noticeable_undominated([*(found[row] for row in order), first], task.fourth, amounts)
            refused = [row for row in order if not any(one is found[row] for one in chosen)]
        if not refused:
            return chosen[:count], sum(not one.plan.safe for one in found.values())
        left = np.setdiff1d(left, refused)


def _noticeable_undominated(found: list[FrontPlan], fourth: str, amounts: Floats) -> list[FrontPlan]:
    """Return the plans that are undominated by the values of their certificates, and have a noticeable gain."""
    rows = np.array([_objective_row(one, fourth) for one in found])
    order = np.arange(len(rows))
    # Of equal plans the first is kept.
    less = (rows[:, None] < rows[None]).any(axis=2) | (order[:, None] < order)
    beaten = ((rows[:, None] <= rows[None]).all(axis=2) & less).any(axis=0)
    best = np.flatnonzero(~beaten)
    return [found[k] for k in best[distinct_rows(rows[best], amounts)].tolist()]


def _make_plan(task: FrontTask, path: Floats, template: Plan) -> Plan:
    counts, objectives = paper_scores(task.problem.certified, path[None])
    return replace(
        template,
        waypoints=path,
        violations=counts[0],
        objectives=objectives[0],
        certificate=certify(task.problem, path),
        ways=None,
    )
