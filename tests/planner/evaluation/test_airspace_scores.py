"""What the certificate finds of zones and of a greatest height, just inside and just outside."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.airspace_scores import airspace_excess, airspace_pieces, count_airspace_violations
from planner.evaluation.certify import certify
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.problem import (
    CERTIFIED_BUFFER_M,
    CERTIFIED_ZONE_MARGIN_M,
    SEARCH_BUFFER_M,
    SEARCH_ZONE_MARGIN_M,
    Problem,
    ProblemArrays,
    make_problem,
)
from planner.plan import Certificate, Violation
from planner.search.plan_path import plan_path
from tests.planner.tracking_limits import with_tracking_error
from world.scenario import Scenario

Made = Callable[..., Problem]
STRAIGHT = np.array([[0.0, 0.0, 150.0], [3000.0, 0.0, 150.0], [6000.0, 0.0, 150.0]])
TURNED = np.array([[0.0, 0.0, 150.0], [3000.0, 0.0, 150.0], [3000.0, 2900.0, 150.0]])


@pytest.fixture
def made(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> Made:
    def problem(numbers: dict[str, float] | None = None, **tables: Any) -> Problem:
        scenario = small(**({"terrain": {"kind": "flat", "amsl_m": 0}, "threats": []} | tables))
        limits = make_limits(scenario)
        return make_problem(scenario, limits if numbers is None else with_tracking_error(limits, **numbers))

    return problem


def tower(off: float, east: float = 1500.0, **levels: float) -> list[dict[str, Any]]:
    """A cylinder whose edge is this far (m) south of the straight way."""
    return [{"name": "mast", "kind": "exclusion", "east_m": east, "north_m": -200.0 - off, "radius_m": 200.0, **levels}]


def certificate(problem: Problem, path: np.ndarray) -> Certificate:
    return certify(problem, path)


@pytest.mark.parametrize(("more", "ok"), [(0.1, True), (-0.1, False), (-40.0, False)])
def test_a_zone_beside_the_way(made: Made, more: float, ok: bool) -> None:
    result = certificate(made(zones=tower(CERTIFIED_ZONE_MARGIN_M + more)), STRAIGHT)
    assert result.ok == ok
    assert result.zone_distance == pytest.approx(more, abs=1e-6)
    result = certificate(made({"across": 12.0}, zones=tower(CERTIFIED_ZONE_MARGIN_M + 12.0 + more)), STRAIGHT)
    assert result.ok == ok
    assert result.zone_distance == pytest.approx(more, abs=1e-6)


def test_what_fails_names_the_zone_and_the_leg(made: Made) -> None:
    assert certificate(made(zones=tower(4.0)), STRAIGHT).problems == (
        "leg 0: 4.0 m from mast; 10 m horizontally or 5 m vertically are required",
    )
    assert certificate(made(zones=tower(-9.0)), STRAIGHT).problems == ("leg 0: 9.0 m inside mast",)


def test_what_fails_at_several_places_is_one_line_the_worst_first(made: Made) -> None:
    """A leg climbs above what is allowed, the corner before it too near: one line.  A mast by each leg: a line each."""
    path = np.array([[0.0, 0.0, 150.0], [1500.0, 0.0, 150.0], [3000.0, 0.0, 156.0]])
    low = {"max_height_m": 153.0, "min_clearance_m": 30}
    assert certificate(made(limits=low), path).problems == (
        "leg 1: 156.0 m above ground at its highest point; at most 153 m minus a margin of 5.0 m are allowed"
        " (also turn at waypoint 1)",
    )
    near, far = tower(1.0, 2250.0)[0] | {"name": "near"}, tower(4.0, 750.0)[0] | {"name": "far"}
    assert certificate(made(zones=[near, far]), path).problems == (
        "leg 0: 4.0 m from far; 10 m horizontally or 5 m vertically are required",
        "leg 1: 1.0 m from near; 10 m horizontally or 5 m vertically are required",
    )


def test_a_zone_inside_a_turn_is_what_the_arc_comes_near(made: Made) -> None:
    """An arc of 121 m radius or more passes 50 m within the corner of 90 degrees: there stands a mast."""
    ends = {"destination": {"east_m": 3000, "north_m": 2900, "amsl_m": 150}}
    zone = {"name": "mast", "kind": "exclusion", "east_m": 2960.0, "north_m": 40.0, "radius_m": 5.0}
    problem = made(zones=[zone], **ends)
    result = certificate(problem, TURNED)
    assert result.problems[0].startswith("turn at waypoint 1")
    legs = [piece for piece in airspace_pieces(problem.certified, TURNED) if not piece["of_corner"]]
    assert all(piece["zones"]["excess"] >= 0.0 for piece in legs)


@pytest.mark.parametrize(("more", "ok"), [(0.1, True), (-0.1, False)])
def test_a_floor_over_the_way(made: Made, more: float, ok: bool) -> None:
    result = certificate(made(zones=tower(-200.0, floor_amsl_m=150.0 + CERTIFIED_BUFFER_M + more)), STRAIGHT)
    assert result.ok == ok
    assert result.zone_distance == pytest.approx(more)


@pytest.mark.parametrize(("more", "ok"), [(0.1, True), (-0.1, False)])
def test_a_greatest_height(made: Made, more: float, ok: bool) -> None:
    path = STRAIGHT + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 30.0], [0.0, 0.0, 0.0]])
    limits = {"max_height_m": 180.0 + CERTIFIED_BUFFER_M + more, "min_clearance_m": 30}
    result = certificate(made(limits=limits), path)
    assert result.ok == ok
    assert result.headroom == pytest.approx(more, abs=1e-3)
    assert ok or "m above ground at its highest" in result.problems[0]


def test_a_flight_that_follows_late_is_high_on_the_way_down(made: Made) -> None:
    """3 s late at 25 m/s down a slope of 1 in 50 is 1.5 m high; at the top, 210 m, 300 m less 5 m are allowed."""
    path = np.array([[0.0, 0.0, 150.0], [3000.0, 0.0, 210.0], [6000.0, 0.0, 150.0]])
    limits = {"max_height_m": 300.0, "min_clearance_m": 30}
    problem = made({"lag": 3.0}, limits=limits)
    assert certificate(problem, path).headroom == pytest.approx(85.0, abs=0.2)
    pieces = airspace_pieces(problem.certified, path)
    last = [piece for piece in pieces if piece["number"] == 1 and not piece["of_corner"]][-2]
    # It ends 100 m before the destination, where the leg is at 152 m.
    begins = 152.0 + (6000.0 - 100.0 - 3000.0 - 4.0 * 75.0) / 50.0
    assert float(last["height"]) == pytest.approx(begins + 1.5, abs=0.3)


def test_the_ground_beside_the_way_is_what_a_flight_is_high_over(made: Made) -> None:
    """Midway the ground is 140 exp(-2.5^2 / 4.5) = 34.9 m high, 50 m south of it 140 exp(-2.55^2 / 4.5) = 33.0.

    A plan keeps 5 m below the greatest height.
    """
    hill = {"kind": "peaks", "peak": [{"east_m": 3000, "north_m": 2500, "height_m": 140, "sigma_m": 1500}]}
    limits = {"max_height_m": 400.0, "min_clearance_m": 1}
    tables = {"terrain": hill, "limits": limits}
    exact, wide = made(**tables), made({"across": 50.0}, **tables)
    path = np.array([[0.0, 0.0, 150.0], [3000.0, 0.0, 250.0], [6000.0, 0.0, 150.0]])
    assert certificate(exact, path).headroom == pytest.approx(400.0 - 5.0 - 250.0 + 34.9, abs=0.1)
    assert certificate(wide, path).headroom == pytest.approx(400.0 - 5.0 - 250.0 + 33.0, abs=0.1)


def test_without_zones_and_greatest_height_there_is_nothing_to_tell(made: Made) -> None:
    result = certificate(made(), STRAIGHT)
    assert (result.zone_distance, result.headroom) == (np.inf, np.inf)


# ----------------------------------------------------------------------
# What zones and a greatest height add to the graded scores, and that a scenario without them is scored as ever.

MakeArrays = Callable[..., ProblemArrays]


@pytest.fixture
def make_arrays(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> MakeArrays:
    """Arrays of the search over level ground, for an autopilot that strays by these numbers if there are any."""

    def arrays(numbers: dict[str, float] | None = None, **tables: Any) -> ProblemArrays:
        ground = {"terrain": {"kind": "flat", "amsl_m": 0}, "threats": []}
        scenario = small(**(ground | tables))
        limits = make_limits(scenario)
        return make_problem(scenario, limits if numbers is None else with_tracking_error(limits, **numbers)).search

    return arrays


def found(data: ProblemArrays, path: np.ndarray, violation: Violation) -> float:
    return float(graded_scores(data, path[None])[0][0, violation])


def north_tower(off: float, radius: float = 200.0, **levels: float) -> list[dict[str, Any]]:
    """A cylinder whose edge is this far (m) north of the straight way."""
    return [{"name": "it", "kind": "exclusion", "east_m": 1500, "north_m": radius + off, "radius_m": radius, **levels}]


@pytest.mark.parametrize(("more", "violated"), [(0.1, False), (-0.1, True)])
def test_a_zone_beside_the_way_is_scored(make_arrays: MakeArrays, more: float, violated: bool) -> None:
    data = make_arrays(zones=north_tower(SEARCH_ZONE_MARGIN_M + more))
    assert (found(data, STRAIGHT, Violation.BOUNDS) > 0.0) == violated
    data = make_arrays({"across": 12.0}, zones=north_tower(SEARCH_ZONE_MARGIN_M + 12.0 + more))
    assert (found(data, STRAIGHT, Violation.BOUNDS) > 0.0) == violated


@pytest.mark.parametrize(("more", "violated"), [(0.1, False), (-0.1, True)])
def test_a_zone_outside_a_corner_is_kept_by_what_is_strayed_there(
    make_arrays: MakeArrays, more: float, violated: bool
) -> None:
    """The turn of 36.87 degrees strays 40 m x 36.87 / 90; the zone lies 300 m before it, by the leg."""
    path = np.array([[0.0, 0.0, 150.0], [3000.0, 0.0, 150.0], [5400.0, 1800.0, 150.0]])
    ends = {"destination": {"east_m": 5400, "north_m": 1800, "amsl_m": 150}}
    strayed = 40.0 * 36.8699 / 90.0
    zone = {"name": "it", "kind": "exclusion", "east_m": 2990.0, "radius_m": 50.0}
    zone["north_m"] = -(50.0 + SEARCH_ZONE_MARGIN_M + strayed + more)
    numbers = {"excursion": 40.0, "before": 200.0, "after": 200.0}
    data = make_arrays(numbers, zones=[zone], **ends)
    assert (found(data, path, Violation.BOUNDS) > 0.0) == violated
    # Away from the corner the leg's own margin is enough.
    data = make_arrays(numbers, zones=[zone | {"east_m": 1000.0}], **ends)
    assert found(data, path, Violation.BOUNDS) == 0.0


@pytest.mark.parametrize(("more", "violated"), [(0.1, False), (-0.1, True)])
def test_a_floor_over_the_way_is_scored(make_arrays: MakeArrays, more: float, violated: bool) -> None:
    data = make_arrays(zones=north_tower(-200.0, floor_amsl_m=150.0 + SEARCH_BUFFER_M + more))
    assert (found(data, STRAIGHT, Violation.BOUNDS) > 0.0) == violated


@pytest.mark.parametrize(("more", "violated"), [(0.1, False), (-0.1, True)])
def test_a_greatest_height_above_ground(make_arrays: MakeArrays, more: float, violated: bool) -> None:
    data = make_arrays(limits={"max_height_m": 158.0 + SEARCH_BUFFER_M + more, "min_clearance_m": 30})
    path = STRAIGHT + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 8.0], [0.0, 0.0, 0.0]])
    assert (found(data, path, Violation.TERRAIN) > 0.0) == violated
    # Where the autopilot is 5 m off in height.
    data = make_arrays({"up": 5.0}, limits={"max_height_m": 163.0 + SEARCH_BUFFER_M + more, "min_clearance_m": 30})
    assert (found(data, path, Violation.TERRAIN) > 0.0) == violated


def test_the_ground_beside_the_way_counts_too(make_arrays: MakeArrays) -> None:
    """A hill of 200 m falls away beside the leg: 325 - 167 m above it, and 325 - 148 m above it 60 m aside."""
    hill = {"kind": "peaks", "peak": [{"east_m": 1500, "north_m": 300, "height_m": 200, "sigma_m": 300}]}
    most = {"max_height_m": 175.0, "min_clearance_m": 1}
    data = make_arrays({"across": 0.0}, terrain=hill, limits=most, threats=[])
    wide = make_arrays({"across": 60.0}, terrain=hill, limits=most, threats=[])
    for arrays, worse in ((data, False), (wide, True)):
        a, b = np.array([1400.0, 150.0, 325.0]), np.array([1600.0, 150.0, 325.0])
        assert (float(airspace_excess(arrays, a, b, 0.0, 0.0, math.inf)) > 0.0) == worse


def test_an_inclusion_near_the_start_leaves_room_to_leave(make_arrays: MakeArrays) -> None:
    """The start is 6 m within the fence: the way straight away from its edge is charged nothing."""
    fence = {"name": "it", "kind": "inclusion", "polygon_m": [[-6, -900], [6900, -900], [6900, 900], [-6, 900]]}
    data = make_arrays({"across": 12.0}, zones=[fence])
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
    scenario = small(**GROUND, zones=mast(east, 300.0 + SEARCH_ZONE_MARGIN_M + more))
    data = make_problem(scenario, make_limits(scenario)).search
    assert count_airspace_violations(data, ONE_LEG[None]).tolist() == [inside * pieces]


@pytest.mark.parametrize(("more", "pieces"), [(-1.0, 0), (1.0, 6)])
def test_pieces_above_the_greatest_height_are_counted(
    more: float, pieces: int, small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    scenario = small(**GROUND, limits={"max_height_m": 200.0})
    data = make_problem(scenario, make_limits(scenario)).search
    path = ONE_LEG + np.array([0.0, 0.0, 50.0 - SEARCH_BUFFER_M + more])
    assert count_airspace_violations(data, np.stack([ONE_LEG, path])).tolist() == [0, pieces]


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
