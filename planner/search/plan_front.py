"""Compute a Pareto front of plans in length, exposure, clearance, and time or energy.

An estimation of distribution algorithm (`planner.optimisers.front_sampling`) searches over the coordinates along,
across and up of all waypoints in the rotated frame. It starts from the planner's own paths: the default plan, and
routes past the obstacles, shortened for various preferences. Each preference is a bound or a cost of shortening: more
height above ground, more distance from radars, and time or energy instead of length. All paths meet the graded
constraints of a search, and every plan of the front has its own certificate.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from aircraft.path_limits import Limits
from planner.airspace.zone_limits import is_limited
from planner.evaluation.certify import certify, least_height
from planner.evaluation.encoding import RotatedFrame, rotated_frame
from planner.evaluation.front_scores import Value, front_values
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import Problem, ProblemArrays, make_problem, threat_records
from planner.evaluation.threat_index import make_missile_index
from planner.evaluation.travel_cost import TravelCost, make_energy_cost, make_time_cost
from planner.optimisers.front_sampling import FrontSampling
from planner.optimisers.hypervolume import covering_order
from planner.plan import Objective, Objectives, Plan, Violations
from planner.search.algorithms import find_algorithm, limits_for
from planner.search.plan_path import plan_path
from planner.search.search_state import SearchProgress, StopCondition
from planner.search.seeds import halve_longest_legs
from planner.seeding.airspace_grids import airspace_routes
from planner.seeding.first_samples import bridge_modes
from planner.seeding.shortening import resample, shorten_path
from planner.seeding.side_routes import optimistic_grid, side_routes
from planner.seeding.waypoint_fitting import QUICK_FIT, fit_waypoints
from world.arrays import Floats
from world.geometry import path_length
from world.html_table import html_table
from world.random_streams import PLANNER, stream
from world.scenario import Scenario

# Clearance preferences of the seeds, as fractions of the additional height above ground that the fixed ends allow.
CLEARANCE_FRACTIONS = (0.0, 0.25, 0.5, 0.75, 0.95)
# Radar preferences of the seeds: fractions of the radars' radius that paths keep out of.
RADAR_FRACTIONS = (0.0, 0.35, 0.5, 0.65, 0.8, 1.0)
# Grids for routes past missiles and radars, which are shortened in addition to the default plan; see
# `planner.search.seeds`. Number of stages of a grid.
STAGE_COUNT = 50
# Size of the area of highest ground, as a fraction of a step.
GROUND_SPREAD_STEPS = 0.2
# Spacing across, as a fraction of a step.
SPACING_ACROSS_STEPS = 2.0 / 3.0
# Reduction of the spheres.
SPHERE_REDUCTION_FACTOR = 0.1
# Maximum number of routes per grid.
MAX_ROUTES = 3
# Grid among zones: number of stages and number of routes; see `planner.seeding.airspace_grids.airspace_routes`.
ZONE_GRIDS = ((25, 2),)
# Fractions of the search margins beyond the certificate's margins, tried in this order.
MARGIN_FRACTIONS = (0.5, 0.1, 0.0)
# Minimum number of solutions that the search keeps.
MIN_ARCHIVE_SIZE = 100
# Number of solutions that the search keeps per requested plan.
SOLUTIONS_PER_PLAN = 2
# Samples per generation.
POPULATION_SIZE = 120
# Number of generations.
GENERATION_COUNT = 400
# Largest deviation of the noise along, as a fraction of an interval.
NOISE_ALONG_FRACTION = 0.3
# Largest deviation of the noise across, as a fraction of the straight line.
NOISE_ACROSS_FRACTION = 0.1
# Largest deviation of the noise up, as a fraction of the height range.
NOISE_UP_FRACTION = 0.3
# Reference point: length and time or energy relative to the default plan.
MAX_LENGTH_RATIO = 1.5
# Reference point: exposure relative to the default plan.
MAX_EXPOSURE_RATIO = 1.5
# Exposure used in place of the default plan's exposure if that is lower, s.
MIN_EXPOSURE_S = 1.0
# Noticeable gains: a plan that gains no more than these amounts over another plan in any objective is not a separate
# choice. With these amounts fronts of 20 plans cover as much as without (`benchmarks.planning.fronts`); with twice the
# amounts there were 17 plans for `jacksboro`.
# Noticeable gain of length and of time or energy, as a fraction of the default plan.
NOTICEABLE_GAIN_FRACTION = 0.001
# Noticeable gain of exposure, as a fraction of the default plan.
NOTICEABLE_EXPOSURE_FRACTION = 0.01
# Noticeable gain of clearance, m.
NOTICEABLE_CLEARANCE_M = 1.0


@dataclass(frozen=True, slots=True)
class FrontPlan:
    """Plan of a front, and its values in SI units: m, s, m, s, J (NaN if the aircraft's power is unknown).

    exposure: detection density of the radars, integrated over the flight time, in seconds at full density.
    clearance: least height above ground of the legs and fly-by arcs.
    """

    plan: Plan
    length: float
    exposure: float
    clearance: float
    time: float
    energy: float


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Front:
    """Plans of a Pareto front, the shortest first; no plan is better than another plan in every objective.

    Of any two plans at least one gains more than `noticeable_gains` over the other in some objective.

    asked: requested maximum number of plans.
    fourth: fourth objective, after length, exposure and clearance: "time" or "energy".
    default: the default planner's plan and its values; a plan of the front may be a little shorter.
    reference: (4,) reference point of the hypervolume, with negated clearance; plans beyond it are ignored.
    evaluations: number of evaluated paths, without the default plan's evaluations.
    refused: number of plans that were discarded because they were not safe once they were completed.
    ended: "completed", or the reason why the search ended early: "budget" or "interrupted".
    """

    plans: tuple[FrontPlan, ...]
    asked: int
    fourth: str
    default: FrontPlan
    reference: Floats
    evaluations: int
    refused: int = 0
    ended: str = "completed"

    def __repr__(self) -> str:
        """Describe the front in a line: scenario, number of plans, and why the search ended."""
        return f"<Front {self.default.plan.scenario.name}: {len(self.plans)} of {self.asked} plans, {self.ended}>"

    def _repr_html_(self) -> str:
        """Return an HTML table of the plans for notebooks."""
        head = ("plan", "length, km", "exposure, s", "above ground at least, m", "energy, Wh", "time, s")
        rows = [
            (
                number,
                f"{plan.length / 1000.0:.3f}",
                f"{plan.exposure:.2f}",
                f"{plan.clearance:.1f}",
                f"{plan.energy / 3600.0:.2f}" if math.isfinite(plan.energy) else "unknown",
                f"{plan.time:.1f}",
            )
            for number, plan in enumerate(self.plans, 1)
        ]
        name = self.default.plan.scenario.name
        return html_table(f"Front of {name}: {len(self.plans)} of {self.asked} plans, {self.ended}", rows, head)

    def objectives(self) -> Floats:
        """Return the four objectives of the plans, (n, 4); smaller is better.

        They are length, exposure, negated clearance, and time or energy.
        """
        return np.array([_objective_row(plan, self.fourth) for plan in self.plans]).reshape(-1, 4)


def _objective_row(plan: FrontPlan, fourth: str) -> list[float]:
    """Return a plan's length, exposure, negated clearance, and time or energy, as `fourth` states."""
    return [plan.length, plan.exposure, -plan.clearance, plan.time if fourth == "time" else plan.energy]


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
    generations: int = GENERATION_COUNT,
) -> Front:
    """Compute up to `count` plans of a Pareto front.

    default: the completed default plan; None to plan it here, and to finish it like the others.
    waypoints: number of waypoints of the other plans during the search, including both ends; None for the number in the
        default plan.
    finish: completes a plan, for example with departure and approach; only plans that are then safe enter the front.
    generations: maximum number of generations.

    The front is empty if the default planner finds no safe plan. It has fewer than `count` plans if no further plan has
    a noticeable gain over the others. The fourth objective is energy. It is time if the scenario's objective is time,
    or if the aircraft's power is unknown.

    The same scenario, limits, count and seed give the same front.

    >>> from planfly.workflow.uav import load_uav
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("hard-07")
    >>> front = plan_front(scenario, load_uav(scenario).limits, 4, seed=1, generations=5)
    >>> len(front.plans), all(one.plan.safe for one in front.plans)
    (4, True)
    """
    task = front_task(scenario, limits)
    if default is None:
        default = finish(plan_path(scenario, limits, seed=seed, progress=progress, stop=stop))
    path = halve_longest_legs(default.waypoints, waypoints or 0)
    task = fit_margins(task, path)
    default_plan = _with_values(task, default)
    reference = reference_point(task, default_plan)
    if not default.safe or len(path) == 2:
        # A path of two waypoints has no inner waypoint to move.
        only_plans = (default_plan,) if default.safe else ()
        return Front(only_plans, count, task.fourth, default_plan, reference, 0, ended=default.ended)
    size = max(MIN_ARCHIVE_SIZE, SOLUTIONS_PER_PLAN * count)
    search = make_sampling(task, len(path), reference, size, stream(seed, PLANNER))
    evaluations, ended = _run_generations(task, search, path, progress, stop, generations)
    front_plans, unsafe_count = _certify_distinct(
        task, search, count, default_plan, replace(default, evaluations=evaluations), finish
    )
    plans = tuple(sorted(front_plans, key=lambda plan: plan.length))
    return Front(plans, count, task.fourth, default_plan, reference, evaluations, unsafe_count, ended)


# --- The problem ---


class FrontTask(NamedTuple):
    """Planning problem with the four objectives of a front.

    scored: the problem with margins between the margins of a search and of the certificate, because shortening ends at
        the margins of a search only within a tolerance.
    frame: frame in which waypoints are sampled.
    energy: cost function for energy, or None if the power is unknown.
    fourth: "time" or "energy".
    travel: cost function of this fourth objective.
    """

    problem: Problem
    scored: ProblemArrays
    frame: RotatedFrame
    energy: TravelCost | None
    fourth: str
    travel: TravelCost

    def values(self, paths: Floats) -> Floats:
        """Return the values of paths (n, w, 3), (n, 5), in the order of `Value`."""
        return front_values(self.problem.search, self.energy, paths)

    def scores(self, paths: Floats) -> tuple[Floats, Floats]:
        """Return the objectives (n, 4) and violations (n, 5) of paths.

        The violations are the graded constraints and then the exposure to missiles. If a constraint is violated, the
        objectives are infinite, because computing them would take most of the time.
        """
        violations, graded = graded_scores(self.scored, paths)
        all_violations = np.concatenate([violations, graded[:, Objective.KILL_EXPOSURE, None]], axis=1)
        objectives, is_feasible = np.full((len(paths), 4), np.inf), (all_violations <= 0.0).all(axis=1)
        objectives[is_feasible] = self.objectives(self.values(paths[is_feasible]))
        return objectives, all_violations

    def objectives(self, values: Floats) -> Floats:
        """Convert values (n, 5) to objectives (n, 4): length, exposure, negated clearance, and time or energy."""
        fourth = Value.TIME if self.fourth == "time" else Value.ENERGY
        out = values[:, [Value.LENGTH, Value.EXPOSURE, Value.CLEARANCE, fourth]]
        out[:, 2] *= -1.0
        return np.asarray(out)

    def to_vectors(self, paths: Floats) -> Floats:
        """Convert paths (n, w, 3) to vectors of their inner waypoints in the rotated frame, (n, 3 (w - 2))."""
        return np.asarray(self.frame.to_frame(paths[:, 1:-1]).reshape(len(paths), -1))

    def to_paths(self, vectors: Floats) -> Floats:
        """Convert vectors (n, 3 (w - 2)) of inner waypoints to paths (n, w, 3); inverts `to_vectors`."""
        data, count = self.problem.search, len(vectors)
        inner_waypoints = self.frame.to_world(vectors.reshape(count, -1, 3))
        ends = [np.broadcast_to(end, (count, 1, 3)) for end in (data.start, data.destination)]
        return np.ascontiguousarray(np.concatenate([ends[0], inner_waypoints, ends[1]], axis=1))


def front_task(scenario: Scenario, limits: Limits) -> FrontTask:
    """Make the problem of a front, with the margins that the search of the default planner keeps."""
    algorithm = find_algorithm(None, scenario.name)
    problem = make_problem(scenario, limits_for(algorithm, limits))
    aircraft = problem.search.aircraft
    winds = problem.search.travel.winds
    energy = make_energy_cost(limits.envelope, aircraft, winds)
    by_energy = energy is not None and scenario.planner.objective != "time"
    travel = energy if energy is not None and by_energy else make_time_cost(aircraft, winds)
    frame = rotated_frame(problem.space.start, problem.space.destination)
    scored = _with_margins(problem, MARGIN_FRACTIONS[0])
    return FrontTask(problem, scored, frame, energy, "energy" if by_energy else "time", travel)


def _with_margins(problem: Problem, fraction: float) -> ProblemArrays:
    """Return the problem with margins between the certificate's margins and a search's margins.

    fraction: 0 for the margins of the certificate, 1 for the margins of the search.
    """
    search, certified = problem.search, problem.certified
    field_names = ("buffer", "start_buffer", "destination_buffer", "kill_margin")
    certified_margins = {name: getattr(certified, name) for name in field_names}
    return search._replace(
        **{name: margin + fraction * (getattr(search, name) - margin) for name, margin in certified_margins.items()}
    )


def fit_margins(task: FrontTask, default: Floats) -> FrontTask:
    """Reduce a task's margins until the default path (w, 3) keeps them.

    Other paths may then be as tight.
    """
    for fraction in MARGIN_FRACTIONS:
        task = task._replace(scored=_with_margins(task.problem, fraction))
        if (task.scores(default[None])[1] <= 0.0).all():
            break
    return task


def reference_point(task: FrontTask, default: FrontPlan) -> Floats:
    """Return the reference point of the hypervolume, (4,); plans beyond it are ignored.

    Its length, exposure, and time or energy are `MAX_LENGTH_RATIO` or `MAX_EXPOSURE_RATIO` times the default plan's
    values; its clearance is the required clearance, negated.
    """
    length, exposure, _, fourth = _objective_row(default, task.fourth)
    max_exposure = max(MIN_EXPOSURE_S, MAX_EXPOSURE_RATIO * exposure)
    negated_clearance = -task.problem.certified.clearance
    return np.array([MAX_LENGTH_RATIO * length, max_exposure, negated_clearance, MAX_LENGTH_RATIO * fourth])


def _with_values(task: FrontTask, plan: Plan) -> FrontPlan:
    """Add the values to a plan; the clearance is computed exactly, not at samples."""
    row = task.values(np.array(plan.waypoints)[None])[0]
    clearance = least_height(task.problem.certified, plan.waypoints)
    return FrontPlan(plan, row[Value.LENGTH], row[Value.EXPOSURE], clearance, row[Value.TIME], row[Value.ENERGY])


# --- Seeds ---


def seed_paths(task: FrontTask, default: Floats) -> Iterator[Floats]:
    """Yield paths (w, 3) from which the search of a front begins.

    default: (w, 3) path of the default plan.

    The first is the default path. The others are made of it, and of routes on all sides of the missiles and radars, by
    shortening under various preferences. Shortening ignores zones; if there are any, the unshortened routes are
    yielded, too.

    A preference combines three settings. Each radar becomes a missile sphere with one of `RADAR_FRACTIONS` of its
    detection radius. The clearance buffer is at least one of `CLEARANCE_FRACTIONS` of the spare height of the lower end
    above the required clearance. The cost is the cost of the problem or of the fourth objective.
    """
    yield default
    count, all_threats = len(default), task.problem.scenario.threats
    bound = MAX_LENGTH_RATIO * float(path_length(default))
    span = (-0.5 * bound, 0.5 * bound)
    has_radar = (all_threats.detection_radius > 0.0).any()
    for radar_fraction in RADAR_FRACTIONS if has_radar else RADAR_FRACTIONS[:1]:
        threats = threat_records(all_threats).copy()
        threats["kill_radius"] = np.maximum(threats["kill_radius"], radar_fraction * threats["detection_radius"])
        # Read-only like a scenario's threats: for a writable array the kernels would be compiled again.
        threats.setflags(write=False)
        data = task.problem.search._replace(threats=threats, missiles=make_missile_index(threats))
        # Routes that pass the missile spheres and zones on different sides.
        if is_limited(data.airspace):
            zone_routes = airspace_routes(data, task.frame, span, ZONE_GRIDS)
            routes = [fit_waypoints(data, task.frame, route.points, count, QUICK_FIT) for route in zone_routes]
            yield from routes
        else:
            grid = optimistic_grid(
                data,
                task.frame,
                span,
                STAGE_COUNT,
                shrink=SPHERE_REDUCTION_FACTOR,
                spread=GROUND_SPREAD_STEPS,
                ratio=SPACING_ACROSS_STEPS,
            )
            grid_routes = side_routes(data, task.frame, grid, bound, MAX_ROUTES)
            routes = [resample(task.frame.to_world(route.points), count) for route in grid_routes]
        end_legs = np.stack([[end, end] for end in (data.start, data.destination)])
        spare_height = max(0.0, float(task.values(end_legs)[:, Value.CLEARANCE].min()) - data.clearance)
        for clearance_fraction, travel in product(CLEARANCE_FRACTIONS, (data.travel, task.travel)):
            buffer = max(data.buffer, clearance_fraction * spare_height)
            preferred_problem = data._replace(buffer=buffer, travel=travel)
            for route in [default, *routes]:
                path, _ = shorten_path(preferred_problem, route)
                # Shorten again from equal legs, as for the default plan.
                path, _ = shorten_path(preferred_problem, resample(path, count))
                yield path


# --- The search ---


def _run_generations(
    task: FrontTask,
    search: FrontSampling,
    default: Floats,
    progress: SearchProgress | None,
    stop: StopCondition | None,
    generations: int,
) -> tuple[int, str]:
    """Sample generations from the seeds; return the number of evaluated paths and why the search ended.

    task: the planning task, which scores paths.
    search: sampler, whose archive receives the front.
    default: (w, 3) path of the default plan, from which the seeds are made, m.
    progress: called after each generation, or None.
    stop: returns a reason to end the search, or "" to continue; or None.
    generations: maximum number of generations.
    """
    paths, reason = [], ""
    for path in seed_paths(task, np.array(default)):
        paths.append(path)
        if stop is not None and (reason := stop()):
            break
    seeds = np.array(paths)
    search.tell(task.to_vectors(seeds), *task.scores(seeds))
    evaluations = len(seeds)
    for generation in range(generations):
        if len(search.vectors) == 0 or (stop is not None and (reason := stop())):
            break
        vectors = search.ask()
        search.tell(vectors, *task.scores(task.to_paths(vectors)))
        evaluations += len(vectors)
        if progress is not None:
            progress(generation + 1, generations, f"{len(search.vectors)} paths that no other dominates")
    return evaluations, reason or "completed"


def make_sampling(
    task: FrontTask, waypoints: int, reference: Floats, size: int, rng: np.random.Generator
) -> FrontSampling:
    """Make the estimation-of-distribution algorithm that samples paths.

    waypoints: number of waypoints of a path.
    reference: (4,) reference point of the hypervolume.
    size: number of solutions in the archive.
    """
    data, frame, inner_count = task.problem.search, task.frame, waypoints - 2
    corners = np.array([[x, y, 0.0] for x in (data.west, data.east) for y in (data.south, data.north)])
    rotated = frame.to_frame(corners)
    min_corner = np.array([rotated[:, 0].min(), rotated[:, 1].min(), data.floor])
    max_corner = np.array([rotated[:, 0].max(), rotated[:, 1].max(), data.ceiling])
    scales = np.array(
        [
            NOISE_ALONG_FRACTION * frame.length / (inner_count + 1),
            NOISE_ACROSS_FRACTION * frame.length,
            NOISE_UP_FRACTION * (max_corner[2] - min_corner[2]),
        ]
    )
    return FrontSampling(
        np.tile(min_corner, inner_count),
        np.tile(max_corner, inner_count),
        noise_directions(inner_count, scales),
        reference,
        3,
        size,
        POPULATION_SIZE,
        rng,
    )


def noise_directions(inner_count: int, scales: Floats) -> Floats:
    """Return the directions of the sampling noise, (k, 3 inner_count).

    scales: (3,) largest deviations along, across and up, m.

    The directions are smooth modes of the whole path, and bumps of a few waypoints.
    """
    modes, deviations = bridge_modes(inner_count)
    waves = (modes * deviations / np.abs(modes[:, 0]).max()).T
    bumps = [
        np.where((np.arange(inner_count) >= first_index) & (np.arange(inner_count) < first_index + width), 1.0, 0.0)
        for width in (1, 2, 4)
        for first_index in range(max(1, inner_count - width + 1))
    ]
    shapes = np.array([*waves, *bumps])
    out = np.zeros((len(shapes), 3, inner_count, 3))
    for axis in range(3):
        out[:, axis, :, axis] = shapes * scales[axis]
    return out.reshape(3 * len(shapes), 3 * inner_count)


def noticeable_gains(default: FrontPlan, fourth: str) -> Floats:
    """Return the smallest gain in each objective that makes a plan a separate choice, (4,).

    default: the default plan, of which some gains are fractions.
    fourth: "time" or "energy".

    The objectives are length (m), radar exposure (s), clearance (m), and time (s) or energy (J).
    """
    length, exposure, _, fourth_value = _objective_row(default, fourth)
    exposure_gain = NOTICEABLE_EXPOSURE_FRACTION * max(MIN_EXPOSURE_S, exposure)
    return np.array(
        [
            NOTICEABLE_GAIN_FRACTION * length,
            exposure_gain,
            NOTICEABLE_CLEARANCE_M,
            NOTICEABLE_GAIN_FRACTION * fourth_value,
        ]
    )


def distinct_rows(objectives: Floats, amounts: Floats) -> list[int]:
    """Return the indices of the objectives (n, m) that differ noticeably from every row chosen before.

    amounts: (m,) noticeable gains.

    A row is omitted if an earlier chosen row is worse by no more than the amounts in every objective. This is the
    additive epsilon-dominance of Laumanns, Thiele, Deb and Zitzler (Evolutionary Computation 10, 2002).

    >>> distinct_rows(np.array([[1.0, 9.0], [1.1, 8.9], [2.0, 5.0], [9.0, 4.9]]), np.array([0.5, 0.5]))
    [0, 2]
    """
    distinct_indices: list[int] = []
    for row, values in enumerate(objectives):
        if not (objectives[distinct_indices] <= values + amounts).all(axis=1).any():
            distinct_indices.append(row)
    return distinct_indices


def _certify_distinct(
    task: FrontTask,
    search: FrontSampling,
    count: int,
    default_plan: FrontPlan,
    template: Plan,
    finish: Callable[[Plan], Plan],
) -> tuple[list[FrontPlan], int]:
    """Certify and complete distinct plans that cover the front; return up to `count` safe plans.

    default_plan: the completed default plan, which is included if no plan is better.
    template: plan from which all fields other than path, scores and certificate are copied.
    finish: completes a plan.

    Also returns the number of plans that were not safe.
    """
    amounts, plans = noticeable_gains(default_plan, task.fourth), dict[int, FrontPlan]()
    remaining_rows = np.arange(len(search.vectors))
    while True:
        ranked_rows = remaining_rows[
            covering_order(search.objectives[remaining_rows], search.reference, len(remaining_rows))
        ]
        rows = ranked_rows[distinct_rows(search.objectives[ranked_rows], amounts)][:count].tolist()
        for row in rows:
            if row not in plans:
                path = task.to_paths(search.vectors[row][None])[0]
                counts, scores = paper_scores(task.problem.certified, path[None])
                plan = replace(
                    template,
                    waypoints=path,
                    violations=Violations(*counts[0]),
                    objectives=Objectives(*scores[0]),
                    certificate=certify(task.problem, path),
                    procedures=None,
                )
                plans[row] = _with_values(task, finish(plan))
        rejected_rows = [row for row in rows if not plans[row].plan.safe]
        accepted_plans: list[FrontPlan] = []
        if not rejected_rows:
            # Accept the plans that no other plan dominates and that differ noticeably from each other; of several equal
            # plans, the first.
            candidates = [*(plans[row] for row in rows), default_plan]
            objectives = np.array([_objective_row(plan, task.fourth) for plan in candidates])
            indices = np.arange(len(objectives))
            is_better = (objectives[:, None] < objectives[None]).any(axis=2) | (indices[:, None] < indices)
            is_dominated = ((objectives[:, None] <= objectives[None]).all(axis=2) & is_better).any(axis=0)
            undominated_rows = np.flatnonzero(~is_dominated)
            accepted_rows = undominated_rows[distinct_rows(objectives[undominated_rows], amounts)]
            accepted_plans = [candidates[k] for k in accepted_rows.tolist()]
            rejected_rows = [row for row in rows if not any(plan is plans[row] for plan in accepted_plans)]
        if not rejected_rows:
            return accepted_plans[:count], sum(not plan.plan.safe for plan in plans.values())
        remaining_rows = np.setdiff1d(remaining_rows, rejected_rows)
