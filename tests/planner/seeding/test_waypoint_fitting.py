"""Moves of all waypoints at once straighten a zigzag."""

import math
from collections.abc import Callable

import numpy as np

from aircraft.path_limits import Limits
from planner.evaluation.encoding import ENCODINGS, rotated_vectors
from planner.evaluation.problem import make_problem
from planner.seeding.waypoint_fitting import move_all_waypoints
from world.arrays import Floats
from world.scenario import Scenario

FLAT = {"kind": "flat", "amsl_m": 0}


def test_moves_straighten_a_zigzag(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> None:
    scenario = small(terrain=FLAT, threats=[])
    problem = make_problem(scenario, make_limits(scenario))
    encoding = ENCODINGS["rotated"](problem.space, 8)
    path = np.linspace(scenario.start, scenario.destination, 8)
    path[1:-1, 1] += 300.0 * (-1.0) ** np.arange(6)
    vector = rotated_vectors(problem.space, encoding, path[None])[0]

    def length(numbers: Floats) -> float:
        return float(np.linalg.norm(np.diff(encoding.decode(numbers[None])[0], axis=0), axis=1).sum())

    moved, made = move_all_waypoints(problem.search, encoding, vector, 8, 1.0)
    assert made > 0
    assert (moved >= encoding.lower).all()
    assert (moved <= encoding.upper).all()
    straight = math.dist(scenario.start, scenario.destination)
    assert length(moved) - straight < 0.05 * (length(vector) - straight)
