"""The cheapest way over a lattice: back out of a trap, round to climb, from and to courses, and none where none is."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.encoding import rotated_frame
from planner.evaluation.problem import make_problem
from planner.evaluation.problem_arrays import ProblemArrays
from planner.seeding.lattice_kernels import Lattice, pulled_taut
from planner.seeding.lattice_routes import cheapest_lattice_route
from world.kernels import Records
from world.scenario import Scenario

MakeData = Callable[..., ProblemArrays]


@pytest.fixture
def make_data(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> MakeData:
    """Level ground, slopes of 20 degrees; 6 km from 150 m to 150 m."""

    def make(threats: list[dict[str, float]], **ends: object) -> ProblemArrays:
        limits = {"max_climb_deg": 20, "max_dive_deg": 20}
        area = {"east_m": [-2000, 8000], "north_m": [-3000, 3000], "ceiling_amsl_m": 500}
        scenario = small(terrain={"kind": "flat", "amsl_m": 0}, threats=threats, limits=limits, area=area)
        return make_problem(scenario, make_limits(scenario)).search._replace(**ends)

    return make


def lattice(layers: int = 1, goal_layer: int = 0, pitch: float = 100.0) -> Lattice:
    """Steps of 500 m: two places behind the start, two to either side, and two beyond the destination 3 km on."""
    return Lattice(500.0, 2, 2, 11, 5, 8, 150.0, pitch, layers, 0, goal_layer)


def route_of(data: ProblemArrays, made: Lattice, courses: int = 2) -> Records:
    return cheapest_lattice_route(data, rotated_frame(data.start, data.destination), made, courses, 100_000)


def test_in_the_open_the_way_is_straight(make_data: MakeData) -> None:
    cells = route_of(make_data([]), lattice())
    assert cells["along"].tolist() == list(range(7))
    assert not cells["across"].any()


def test_the_way_out_of_a_trap_leads_back(make_data: MakeData) -> None:
    # Spheres ahead, and ahead on both sides, about the start: the free places are behind it.
    trap = [
        {"east_m": east, "north_m": north, "amsl_m": 150, "kill_radius_m": 240, "kill_scale_m": 50}
        for east, north in ((500, 0), (500, 500), (500, -500), (0, 500), (0, -500))
    ]
    cells = route_of(make_data(trap), lattice())
    assert len(cells) > 0
    assert cells["along"].min() < 0
    free = {(0, 0)} | {(int(a), int(b)) for a, b in zip(cells["along"], cells["across"], strict=True)}
    assert not free & {(1, 0), (1, 1), (1, -1), (0, 1), (0, -1)}


def test_a_climb_without_enough_way_goes_round(make_data: MakeData) -> None:
    # A step of 500 m climbs 176 m at 19.5 degrees: one layer of 170 m, and 12 of them take 12 steps, not 6.
    data = make_data([], ceiling=5000.0)
    cells = route_of(data, lattice(layers=13, goal_layer=12, pitch=170.0))
    assert cells["layer"].tolist()[-1] == 12
    assert (np.diff(cells["layer"]) <= 1).all()
    assert len(cells) >= 13
    courses = np.unwrap(np.arctan2(np.diff(cells["across"]), np.diff(cells["along"])))
    assert np.abs(np.diff(courses)).max() <= math.pi / 2.0 + 1e-9


@pytest.mark.parametrize("course", [0.0, 0.5 * math.pi, 1.5 * math.pi])
def test_the_first_step_turns_no_further_from_the_start_course_than_it_may(make_data: MakeData, course: float) -> None:
    cells = route_of(make_data([], start_course=course), lattice())
    first = math.atan2(cells["along"][1], cells["across"][1])
    away = abs((first - course + math.pi) % (2.0 * math.pi) - math.pi)
    assert away <= math.pi / 2.0 + 1e-9


def test_the_last_step_arrives_on_the_course_that_is_asked_for(make_data: MakeData) -> None:
    cells = route_of(make_data([], destination_course=1.5 * math.pi), lattice())
    last = math.atan2(np.diff(cells["along"])[-1], np.diff(cells["across"])[-1])
    assert abs((last - 1.5 * math.pi + math.pi) % (2.0 * math.pi) - math.pi) <= math.pi / 2.0 + 1e-9


def test_where_all_is_closed_there_is_no_way(make_data: MakeData) -> None:
    wall = [
        {"east_m": 1500, "north_m": north, "amsl_m": 150, "kill_radius_m": 600, "kill_scale_m": 50}
        for north in range(-2000, 2001, 500)
    ]
    assert len(route_of(make_data(wall), lattice())) == 0


def test_a_route_is_pulled_taut_as_far_as_it_stays_free(make_data: MakeData) -> None:
    missile = {"east_m": 1500, "north_m": 0, "amsl_m": 150, "kill_radius_m": 400, "kill_scale_m": 50}
    corners = np.array([[0.0, 0.0], [500.0, 500.0], [1000.0, 500.0], [1500.0, 500.0], [2000.0, 500.0], [3000.0, 0.0]])
    points = np.column_stack([corners, np.full(6, 150.0)])
    assert len(pulled_taut(make_data([]), points)) == 2
    taut = pulled_taut(make_data([missile]), points)
    assert 2 < len(taut) < 6
    np.testing.assert_array_equal(taut[[0, -1]], points[[0, -1]])
    # 15 m are kept from the sphere.
    for a, b in pairwise(taut):
        near = min(math.dist(a + share * (b - a), (1500.0, 0.0, 150.0)) for share in np.linspace(0.0, 1.0, 400))
        assert near >= 415.0 - 1e-6
