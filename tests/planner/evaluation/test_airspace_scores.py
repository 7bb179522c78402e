"""What zones and a greatest height add to the graded scores, and that a scenario without them is scored as ever."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.airspace_scores import airspace_counts, airspace_excess
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.problem import SEARCH_BUFFER, SEARCH_ZONE_MARGIN, make_problem
from planner.evaluation.problem_arrays import ProblemArrays
from planner.plan import Violation
from planner.search.plan_path import plan_path
from tests.planner.straying import straying
from world.scenario import Scenario

Made = Callable[..., ProblemArrays]
STRAIGHT = np.array([[0.0, 0.0, 150.0], [3000.0, 0.0, 150.0], [6000.0, 0.0, 150.0]])


@pytest.fixture
def made(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> Made:
    """Arrays of the search over level ground, for an autopilot that strays by these numbers if there are any."""

    def arrays(numbers: dict[str, float] | None = None, **tables: Any) -> ProblemArrays:
        ground = {"terrain": {"kind": "flat", "amsl_m": 0}, "threats": []}
        scenario = small(**(ground | tables))
        limits = make_limits(scenario)
        return make_problem(scenario, limits if numbers is None else straying(limits, **numbers)).search

    return arrays


def found(data: ProblemArrays, path: np.ndarray, violation: Violation) -> float:
    return float(graded_scores(data, path[None])[0][0, violation])


def tower(off: float, radius: float = 200.0, **levels: float) -> list[dict[str, Any]]:
    """A cylinder whose edge is this far (m) north of the straight way."""
    return [{"name": "it", "kind": "exclusion", "east_m": 1500, "north_m": radius + off, "radius_m": radius, **levels}]


@pytest.mark.parametrize(("more", "violated"), [(0.1, False), (-0.1, True)])
def test_a_zone_beside_the_way(made: Made, more: float, violated: bool) -> None:
    data = made(zones=tower(SEARCH_ZONE_MARGIN + more))
    assert (found(data, STRAIGHT, Violation.BOUNDS) > 0.0) == violated
    data = made({"across": 12.0}, zones=tower(SEARCH_ZONE_MARGIN + 12.0 + more))
    assert (found(data, STRAIGHT, Violation.BOUNDS) > 0.0) == violated


@pytest.mark.parametrize(("more", "violated"), [(0.1, False), (-0.1, True)])
def test_a_zone_outside_a_corner_is_kept_by_what_is_strayed_there(made: Made, more: float, violated: bool) -> None:
    """The turn of 36.87 degrees strays 40 m x 36.87 / 90; the zone lies 300 m before it, by the leg."""
    path = np.array([[0.0, 0.0, 150.0], [3000.0, 0.0, 150.0], [5400.0, 1800.0, 150.0]])
    ends = {"destination": {"east_m": 5400, "north_m": 1800, "amsl_m": 150}}
    strayed = 40.0 * 36.8699 / 90.0
    zone = {"name": "it", "kind": "exclusion", "east_m": 2990.0, "radius_m": 50.0}
    zone["north_m"] = -(50.0 + SEARCH_ZONE_MARGIN + strayed + more)
    numbers = {"excursion": 40.0, "before": 200.0, "after": 200.0}
    data = made(numbers, zones=[zone], **ends)
    assert (found(data, path, Violation.BOUNDS) > 0.0) == violated
    # Away from the corner the leg's own margin is enough.
    data = made(numbers, zones=[zone | {"east_m": 1000.0}], **ends)
    assert found(data, path, Violation.BOUNDS) == 0.0


@pytest.mark.parametrize(("more", "violated"), [(0.1, False), (-0.1, True)])
def test_a_floor_over_the_way(made: Made, more: float, violated: bool) -> None:
    data = made(zones=tower(-200.0, floor_amsl_m=150.0 + SEARCH_BUFFER + more))
    assert (found(data, STRAIGHT, Violation.BOUNDS) > 0.0) == violated


@pytest.mark.parametrize(("more", "violated"), [(0.1, False), (-0.1, True)])
def test_a_greatest_height_above_ground(made: Made, more: float, violated: bool) -> None:
    data = made(limits={"max_height_m": 158.0 + SEARCH_BUFFER + more, "min_clearance_m": 30})
    path = STRAIGHT + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 8.0], [0.0, 0.0, 0.0]])
    assert (found(data, path, Violation.TERRAIN) > 0.0) == violated
    # Where the autopilot is 5 m off in height.
    data = made({"up": 5.0}, limits={"max_height_m": 163.0 + SEARCH_BUFFER + more, "min_clearance_m": 30})
    assert (found(data, path, Violation.TERRAIN) > 0.0) == violated


def test_the_ground_beside_the_way_counts_too(made: Made) -> None:
    """A hill of 200 m falls away beside the leg: 325 - 167 m above it, and 325 - 148 m above it 60 m aside."""
    hill = {"kind": "peaks", "peak": [{"east_m": 1500, "north_m": 300, "height_m": 200, "sigma_m": 300}]}
    most = {"max_height_m": 175.0, "min_clearance_m": 1}
    data = made({"across": 0.0}, terrain=hill, limits=most, threats=[])
    wide = made({"across": 60.0}, terrain=hill, limits=most, threats=[])
    for arrays, worse in ((data, False), (wide, True)):
        a, b = np.array([1400.0, 150.0, 325.0]), np.array([1600.0, 150.0, 325.0])
        assert (float(airspace_excess(arrays, a, b, 0.0, 0.0)) > 0.0) == worse


def test_an_inclusion_near_the_start_leaves_room_to_leave(made: Made) -> None:
    """The start is 6 m within the fence: the way straight away from its edge is charged nothing."""
    fence = {"name": "it", "kind": "inclusion", "polygon_m": [[-6, -900], [6900, -900], [6900, 900], [-6, 900]]}
    data = made({"across": 12.0}, zones=[fence])
    assert found(data, STRAIGHT, Violation.BOUNDS) == 0.0
    beside = np.array([[0.0, 0.0, 150.0], [0.0, 800.0, 150.0], [6000.0, 0.0, 150.0]])
    assert found(data, beside, Violation.BOUNDS) > 0.0


# One leg of 6 km, whose pieces are 1 km.
ONE_LEG = np.array([[0.0, 0.0, 150.0], [6000.0, 0.0, 150.0]])
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
    assert airspace_counts(data, ONE_LEG[None]).tolist() == [inside * pieces]


@pytest.mark.parametrize(("more", "pieces"), [(-1.0, 0), (1.0, 6)])
def test_pieces_above_the_greatest_height_are_counted(
    more: float, pieces: int, small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    scenario = small(**GROUND, limits={"max_height_m": 200.0})
    data = make_problem(scenario, make_limits(scenario)).search
    path = ONE_LEG + np.array([0.0, 0.0, 50.0 - SEARCH_BUFFER + more])
    assert airspace_counts(data, np.stack([ONE_LEG, path])).tolist() == [0, pieces]


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
