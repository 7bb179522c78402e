"""Planning problem in the form that all optimisers of the benchmarks use: a box, one evaluation, one certificate."""

import json
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from planfly.workflow.uav import Uav, load_uav
from planner.evaluation.certify import certify
from planner.evaluation.encoding import ENCODINGS, Encoding, rotated_frame, rotated_vectors
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.problem import Problem, make_problem
from planner.plan import Certificate
from planner.seeding.first_samples import bridge_basis, bridge_modes
from planner.seeding.grids import grid_routes
from planner.seeding.waypoint_fitting import fit_waypoints
from world.arrays import Floats
from world.scenario import Scenario, load_scenario, scenario_from_spec

PROBLEMS = (7, 15, 30, 60)
# Numbers of stages of the grids that seed a peer.
GRIDS = (36, 66, 130)
# Number of routes from each grid.
ROUTES = 2
# File of the best known paths.
BEST_KNOWN = Path(__file__).parents[1] / "tests" / "authorities" / "best_known.json"


@dataclass(frozen=True, slots=True)
class Task:
    """Scenario in the form of compiled code, in the rotated encoding."""

    scenario: Scenario
    uav: Uav
    problem: Problem
    encoding: Encoding

    @property
    def evaluations(self) -> int:
        """Evaluation budget of the paper: the first population, then half of it in each generation."""
        table = self.scenario.planner
        return table.population + table.generations * (table.population // 2)

    def scores(self, vectors: Floats) -> tuple[Floats, Floats]:
        """Return graded violations (n, 4) and objectives (n, 4), which the default planner's search ranks."""
        return graded_scores(self.problem.search, np.ascontiguousarray(self.encoding.decode(vectors)))

    def certificate(self, path: Floats) -> Certificate:
        """Return the continuous check of a path (w, 3) for all four constraints."""
        return certify(self.problem, np.ascontiguousarray(path))

    def length_ratio(self, path: Floats) -> float:
        """Return the length of a path (w, 3) relative to the straight distance, in three dimensions (eq. 8)."""
        legs = np.sqrt((np.diff(path, axis=0) ** 2).sum(axis=1)).sum()
        return float(legs / np.sqrt(((self.scenario.destination - self.scenario.start) ** 2).sum()))


def is_safe(certificate: Certificate) -> bool:
    """Return True if all four constraints are met everywhere and no missile reaches the path."""
    return certificate.ok and certificate.kill_distance > 0.0


def exact_uav(scenario: Scenario) -> Uav:
    """Return a scenario's UAV for plans without tracking error, like the best known paths."""
    uav = load_uav(scenario)
    return replace(uav, limits=replace(uav.limits, tracking=None))


@cache
def make_task(name: str) -> Task:
    """Make the task of an embedded scenario."""
    scenario = load_scenario(name)
    uav = exact_uav(scenario)
    problem = make_problem(scenario, uav.limits)
    return Task(scenario, uav, problem, ENCODINGS["rotated"](problem.space, scenario.planner.waypoints))


def best_known(name: str) -> float:
    """Return the length ratio of the best known certified path, NaN if unknown.

    The ratios are in tests/authorities/best_known.json.
    """
    known = json.loads(BEST_KNOWN.read_text(encoding="utf-8"))
    return float(known[name]["length_ratio"]) if name in known else float("nan")


def all_known() -> list[str]:
    """Return the problems with a known best path."""
    return list(json.loads(BEST_KNOWN.read_text(encoding="utf-8")))


def with_planner(scenario: Scenario, **changes: object) -> Scenario:
    """Return the same scenario with other keys in ``[planner]``."""
    spec = scenario.spec
    return scenario_from_spec(
        spec.model_copy(update={"planner": spec.planner.model_copy(update=changes)}), scenario.name
    )


def seed_vectors(task: Task) -> Floats:
    """Return planfly's coarse seeds as vectors (n, d).

    They are ordered by violations, then kill exposure, then length.
    """
    low, high = task.encoding.lower, task.encoding.upper
    span = (float(low[1::3].min()), float(high[1::3].max()))
    data = task.problem.search
    frame = rotated_frame(data.start, data.destination)
    routes = grid_routes(data, frame, span, tuple((stages, ROUTES) for stages in GRIDS))
    paths = [fit_waypoints(data, frame, route.points, task.encoding.waypoints) for route in routes]
    vectors = rotated_vectors(task.problem.space, task.encoding, np.array(paths))
    return np.asarray(vectors[np.argsort(scalar(*task.scores(vectors)), kind="stable")])


def scalar(violations: Floats, objectives: Floats) -> Floats:
    """Return one number (n,) for optimisers without constraints, in the default planner's order.

    Below 100: no violation; below 10: no kill exposure either, and the number is the length ratio.
    """
    violated = (violations * np.array([1.0, 1.0, 1.0, 0.01])).sum(axis=1)
    kill, length = objectives[:, 1], objectives[:, 0]
    safe = np.where(kill > 0.0, 10.0 + 80.0 * kill / (1.0 + kill), np.minimum(length, 9.9))
    return np.where((violations > 0.0).any(axis=1), 100.0 + violated, safe)


def smooth_axes(task: Task) -> tuple[Floats, Floats]:
    """Return the directions of the smooth basis, (d, d), and the spread of paths along each, m, (d,).

    A step along a direction moves all waypoints of a path together, so that the path stays smooth.
    """
    inner = task.encoding.waypoints - 2
    _, deviations = bridge_modes(inner)
    low, high = task.encoding.lower.reshape(inner, 3), task.encoding.upper.reshape(inner, 3)
    spread = np.empty((inner, 3))
    spread[:, 0] = 0.3 * (high[:, 0] - low[:, 0])
    grow = np.sqrt((inner + 1) / 2.0)
    spread[:, 1] = deviations * grow * 0.25 * np.median(high[:, 1] - low[:, 1])
    spread[:, 2] = deviations * grow * 0.25 * np.median(high[:, 2] - low[:, 2])
    return bridge_basis(inner), spread.ravel()
