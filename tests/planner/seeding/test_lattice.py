"""The cheapest way over a lattice: back out of a trap, round to climb, from and to courses, and none where none is."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.certify_kernels import turn_and_roll_lengths
from planner.evaluation.encoding import rotated_frame
from planner.evaluation.problem import Problem, ProblemArrays, make_problem
from planner.seeding import lattice as lattice_module
from planner.seeding.lattice import (
    GUIDED_WEIGHT,
    MAX_LATTICE_STATES,
    MIN_STEP_M,
    Lattice,
    ceiling_route,
    cheapest_lattice_route,
    lattice_route,
    make_lattice,
    simplify_route,
    turning_step,
)
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


def lattice(layers: int = 1, goal_layer: int = 0, layer_spacing: float = 100.0) -> Lattice:
    """Steps of 500 m: two places behind the start, two to either side, and two beyond the destination 3 km on."""
    return Lattice(500.0, 2, 2, 11, 5, 8, 150.0, layer_spacing, layers, 0, goal_layer)


def route_of(data: ProblemArrays, made: Lattice, courses: int = 2) -> Records:
    return cheapest_lattice_route(data, rotated_frame(data.start, data.destination), made, courses, 100_000)[0]


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
    cells = route_of(data, lattice(layers=13, goal_layer=12, layer_spacing=170.0))
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


def test_a_guided_climb_meets_the_same_limits_with_few_states(make_data: MakeData) -> None:
    """Of the many routes that climb 2 km in 12 steps, one is enough; without an estimate all are expanded."""
    data = make_data([], ceiling=5000.0)
    made = lattice(layers=13, goal_layer=12, layer_spacing=170.0)
    frame = rotated_frame(data.start, data.destination)
    expanded = []
    for is_guided in (False, True):
        cells, count = cheapest_lattice_route(data, frame, made, 2, 100_000, is_guided=is_guided)
        assert cells["layer"][-1] == 12
        assert (np.diff(cells["layer"]) <= 1).all()
        courses = np.unwrap(np.arctan2(np.diff(cells["across"]), np.diff(cells["along"])))
        assert np.abs(np.diff(courses)).max() <= math.pi / 2.0 + 1e-9
        expanded.append(count)
    assert expanded[1] < 0.2 * expanded[0]


def test_where_all_is_closed_there_is_no_way(make_data: MakeData) -> None:
    wall = [
        {"east_m": 1500, "north_m": north, "amsl_m": 150, "kill_radius_m": 600, "kill_scale_m": 50}
        for north in range(-2000, 2001, 500)
    ]
    assert len(route_of(make_data(wall), lattice())) == 0


def test_a_route_is_simplified_as_far_as_it_stays_free(make_data: MakeData) -> None:
    missile = {"east_m": 1500, "north_m": 0, "amsl_m": 150, "kill_radius_m": 400, "kill_scale_m": 50}
    corners = np.array([[0.0, 0.0], [500.0, 500.0], [1000.0, 500.0], [1500.0, 500.0], [2000.0, 500.0], [3000.0, 0.0]])
    points = np.column_stack([corners, np.full(6, 150.0)])
    assert len(simplify_route(make_data([]), points)) == 2
    taut = simplify_route(make_data([missile]), points)
    assert 2 < len(taut) < 6
    np.testing.assert_array_equal(taut[[0, -1]], points[[0, -1]])
    # 15 m are kept from the sphere.
    for a, b in pairwise(taut):
        near = min(math.dist(a + share * (b - a), (1500.0, 0.0, 150.0)) for share in np.linspace(0.0, 1.0, 400))
        assert near >= 415.0 - 1e-6


# ----------------------------------------------------------------------
# Lattices cover the map, have steps that turns leave room in, and give routes from end to end.


@pytest.fixture
def pocket(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> Problem:
    """A pocket of missiles about the start, open away from the destination."""
    places = [(1300, north) for north in range(-1200, 1201, 400)]
    places += [(east, north) for east in (500, 900) for north in (-1200, 1200)]
    missiles = [
        {"east_m": east, "north_m": north, "amsl_m": 300, "kill_radius_m": 480, "kill_scale_m": 70}
        for east, north in places
    ]
    area = {"east_m": [-4000, 8000], "north_m": [-4000, 4000], "ceiling_amsl_m": 500}
    scenario = small(terrain={"kind": "flat", "amsl_m": 0}, threats=missiles, area=area)
    return make_problem(scenario, make_limits(scenario))


def places_of(lattice: Lattice) -> tuple[float, float, float, float]:
    """West, east, south and north of a lattice along the axes, from the start, m."""
    step = lattice.step
    return (
        -lattice.behind * step,
        (lattice.along - lattice.behind - 1) * step,
        -lattice.right * step,
        (lattice.across - lattice.right - 1) * step,
    )


@pytest.mark.parametrize("step", [400.0, 250.0])
def test_a_lattice_covers_the_map_and_stands_on_both_ends(pocket: Problem, step: float) -> None:
    data = pocket.search
    frame = rotated_frame(data.start, data.destination)
    lattice = make_lattice(data, frame, step)
    assert lattice.step <= step
    assert (lattice.goal - lattice.behind) * lattice.step == pytest.approx(frame.length)
    west, east, south, north = places_of(lattice)
    for covered, edge in ((west, data.west), (-east, -data.east), (south, data.south), (-north, -data.north)):
        away = covered - (edge - (data.start[0] if edge in (data.west, -data.east) else 0.0))
        assert 0.0 <= away + 1e-6 < lattice.step + 4000.0
    heights = lattice.low + lattice.layer_spacing * np.arange(lattice.layers)
    assert heights[lattice.start_layer] == pytest.approx(data.start[2])
    assert abs(heights[lattice.goal_layer] - data.destination[2]) <= 0.5 * lattice.layer_spacing
    assert heights[-1] <= data.ceiling


def test_a_lattice_that_would_be_too_large_has_longer_steps(pocket: Problem) -> None:
    data = pocket.search
    lattice = make_lattice(data, rotated_frame(data.start, data.destination), 20.0)
    assert lattice.along * lattice.across * lattice.layers * 8 <= MAX_LATTICE_STATES
    assert lattice.step > 20.0


@pytest.mark.parametrize("distance", [1.0, 60.0, 399.0])
def test_ends_closer_than_a_step_are_a_step_apart_on_the_lattice(pocket: Problem, distance: float) -> None:
    data = pocket.search._replace(destination=pocket.search.start + np.array([distance, 0.0, 0.0]))
    lattice = make_lattice(data, rotated_frame(data.start, data.destination), 400.0)
    assert lattice.step == 400.0
    assert lattice.goal == lattice.behind + 1
    assert lattice.along * lattice.across * lattice.layers * 8 <= MAX_LATTICE_STATES


def test_a_lattice_between_close_ends_has_longer_steps_if_it_would_be_too_large(
    pocket: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lattice_module, "MAX_LATTICE_STATES", 20_000)
    data = pocket.search._replace(destination=pocket.search.start + np.array([60.0, 0.0, 0.0]))
    lattice = make_lattice(data, rotated_frame(data.start, data.destination), 100.0)
    assert lattice.along * lattice.across * lattice.layers * 8 <= 20_000
    assert lattice.step > 100.0


def test_a_step_holds_two_right_angles(pocket: Problem) -> None:
    data = pocket.search
    step = turning_step(data)
    if not data.legs_hold_turns:
        assert step == MIN_STEP_M
        return
    square = np.array([[0.0, 0.0, 0.0], [step, 0.0, 0.0], [step, step, 0.0], [0.0, step, 0.0]]) + data.start
    turns, rolls = turn_and_roll_lengths(data, square)
    assert turns[1] + rolls[1] < step
    assert step < 1.5 * (turns[1] + rolls[1]) + 50.0


def test_a_route_leaves_a_pocket_and_passes_no_missile(pocket: Problem) -> None:
    data = pocket.search
    route, _ = lattice_route(data, rotated_frame(data.start, data.destination), 400.0)
    np.testing.assert_array_equal(route[[0, -1]], [data.start, data.destination])
    # Not through the missiles ahead: the way is much longer than the straight line.
    assert np.linalg.norm(np.diff(route, axis=0), axis=1).sum() > 1.08 * math.dist(data.start, data.destination)
    threats = pocket.scenario.threats
    for a, b in pairwise(route):
        for share in np.linspace(0.0, 1.0, 200):
            point = a + share * (b - a)
            assert min(math.dist(point, place) for place in threats.position) > 480.0


def test_a_guided_search_leaves_a_pocket_with_few_states(pocket: Problem) -> None:
    data = pocket.search
    frame = rotated_frame(data.start, data.destination)
    cheapest, all_expanded = lattice_route(data, frame, 400.0)
    route, expanded = lattice_route(data, frame, 400.0, is_guided=True)
    assert expanded < 0.1 * all_expanded
    lengths = [np.linalg.norm(np.diff(points, axis=0), axis=1).sum() for points in (cheapest, route)]
    assert lengths[1] <= GUIDED_WEIGHT * lengths[0]


def test_a_search_in_slices_finds_the_same_route(pocket: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    data = pocket.search
    frame = rotated_frame(data.start, data.destination)
    made = make_lattice(data, frame, 500.0)
    whole, seen = cheapest_lattice_route(data, frame, made, 2, 1_000_000)
    asked: list[int] = []
    monkeypatch.setattr(lattice_module, "STATES_PER_CHECK", 7)
    sliced, same = cheapest_lattice_route(data, frame, made, 2, 1_000_000, lambda: asked.append(0))
    assert len(whole) > 0
    assert len(asked) > 10
    np.testing.assert_array_equal(whole, sliced)
    # Not one state more than is allowed.
    assert seen == same
    assert math.ceil(seen / 7) == len(asked)
    none, all_allowed = cheapest_lattice_route(data, frame, made, 2, seen - 1)
    assert (len(none), all_allowed) == (0, seen - 1)
    assert len(cheapest_lattice_route(data, frame, made, 2, seen)[0]) == len(whole)


def test_what_a_pause_raises_ends_the_search(pocket: Problem) -> None:
    def end() -> None:
        raise KeyboardInterrupt

    data = pocket.search
    with pytest.raises(KeyboardInterrupt):
        lattice_route(data, rotated_frame(data.start, data.destination), 500.0, end)
    with pytest.raises(KeyboardInterrupt):
        ceiling_route(data, rotated_frame(data.start, data.destination), 500.0, 15.0, end)


def test_a_route_at_the_ceiling_passes_a_gap_that_spheres_close_by_less_than_they_may_be_entered(
    make_data: MakeData,
) -> None:
    """A row of spheres across the map, 500 m apart, with radii of 580 m on the ground and of 300 m at the ceiling."""
    row = [{"east_m": 3000, "north_m": north, "kill_radius_m": 580} for north in range(-3000, 3001, 500)]
    data = make_data([{**threat, "kill_scale_m": 300} for threat in row])
    frame = rotated_frame(data.start, data.destination)
    # Half the width of a gap at the ceiling: negative where neighbours overlap.
    gap = 250.0 - math.sqrt(580.0**2 - data.ceiling**2)
    assert -60.0 < gap < -40.0
    assert not len(ceiling_route(data, frame, 250.0, 0.0))
    route = ceiling_route(data, frame, 250.0, 80.0)
    assert len(route) > 0
    assert np.all(route[:, 2] == data.ceiling)
    np.testing.assert_array_equal(route[[0, -1], :2], [data.start[:2], data.destination[:2]])
