"""Pieces of legs in zones or too high, counted; and that the paper's algorithms keep out of zones by them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.airspace_counts import airspace_counts
from planner.evaluation.problem import SEARCH_BUFFER, SEARCH_ZONE_MARGIN, make_problem
from planner.search.plan_path import plan_path
from world.scenario import Scenario

# One leg of 6 km, whose pieces are 1 km.
STRAIGHT = np.array([[0.0, 0.0, 150.0], [6000.0, 0.0, 150.0]])
GROUND: dict[str, Any] = {"terrain": {"kind": "flat", "amsl_m": 0}, "threats": []}


def mast(east: float, off: float, radius: float = 300.0) -> list[dict[str, Any]]:
    return [{"name": "mast", "kind": "exclusion", "east_m": east, "north_m": off, "radius_m": radius}]


@pytest.mark.parametrize(("more", "inside"), [(1.0, 0), (-1.0, 1)])
@pytest.mark.parametrize(("east", "pieces"), [(2500.0, 1), (3000.0, 2)])
def test_pieces_that_touch_a_zone_are_counted(
    more: float,
    inside: int,
    east: float,
    pieces: int,
    small: Callable[..., Scenario],
    make_limits: Callable[[Scenario], Limits],
) -> None:
    scenario = small(**GROUND, zones=mast(east, 300.0 + SEARCH_ZONE_MARGIN + more))
    data = make_problem(scenario, make_limits(scenario)).search
    assert airspace_counts(data, STRAIGHT[None]).tolist() == [inside * pieces]


@pytest.mark.parametrize(("more", "pieces"), [(-1.0, 0), (1.0, 6)])
def test_pieces_above_the_greatest_height_are_counted(
    more: float, pieces: int, small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    scenario = small(**GROUND, limits={"max_height_m": 200.0})
    data = make_problem(scenario, make_limits(scenario)).search
    path = STRAIGHT + np.array([0.0, 0.0, 50.0 - SEARCH_BUFFER + more])
    assert airspace_counts(data, np.stack([STRAIGHT, path])).tolist() == [0, pieces]


@pytest.mark.parametrize("algorithm", ["umda", "umda-polar-45", "umda-bearing", "umda-graded"])
def test_the_papers_algorithms_keep_out_of_a_zone(
    algorithm: str, small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    """The zone lies across the straight line, and everything else leaves that free."""
    scenario = small(**GROUND, zones=mast(3000.0, 100.0, 400.0), planner={"waypoints": 8, "generations": 60})
    plan = plan_path(scenario, make_limits(scenario), seed=1, algorithm=algorithm)
    assert plan.safe
    # By plain sums, on places a metre apart.
    places = np.concatenate([np.linspace(a, b, 2000) for a, b in zip(plan.waypoints, plan.waypoints[1:], strict=False)])
    assert np.hypot(places[:, 0] - 3000.0, places[:, 1] - 100.0).min() > 400.0
