"""Lattices cover the map, have steps that turns leave room in, and give routes from end to end."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.certify_kernels import turn_and_roll_lengths
from planner.evaluation.encoding import rotated_frame
from planner.evaluation.problem import Problem, make_problem
from planner.seeding import lattice_routes
from planner.seeding.lattice_kernels import Lattice
from planner.seeding.lattice_routes import (
    LEAST_STEP,
    MOST_LATTICE,
    cheapest_lattice_route,
    lattice_route,
    make_lattice,
    turning_step,
)
from world.scenario import Scenario


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
    heights = lattice.low + lattice.pitch * np.arange(lattice.layers)
    assert heights[lattice.start_layer] == pytest.approx(data.start[2])
    assert abs(heights[lattice.goal_layer] - data.destination[2]) <= 0.5 * lattice.pitch
    assert heights[-1] <= data.ceiling


def test_a_lattice_that_would_be_too_large_has_longer_steps(pocket: Problem) -> None:
    data = pocket.search
    lattice = make_lattice(data, rotated_frame(data.start, data.destination), 20.0)
    assert lattice.along * lattice.across * lattice.layers * 8 <= MOST_LATTICE
    assert lattice.step > 20.0


def test_a_step_holds_two_right_angles(pocket: Problem) -> None:
    data = pocket.search
    step = turning_step(data)
    if not data.legs_hold_turns:
        assert step == LEAST_STEP
        return
    square = np.array([[0.0, 0.0, 0.0], [step, 0.0, 0.0], [step, step, 0.0], [0.0, step, 0.0]]) + data.start
    turns, rolls = turn_and_roll_lengths(data, square)
    assert turns[1] + rolls[1] < step
    assert step < 1.5 * (turns[1] + rolls[1]) + 50.0


def test_a_route_leaves_a_pocket_and_passes_no_missile(pocket: Problem) -> None:
    data = pocket.search
    route = lattice_route(data, rotated_frame(data.start, data.destination), 400.0)
    np.testing.assert_array_equal(route[[0, -1]], [data.start, data.destination])
    # Not through the missiles ahead: the way is much longer than the straight line.
    assert np.linalg.norm(np.diff(route, axis=0), axis=1).sum() > 1.08 * math.dist(data.start, data.destination)
    threats = pocket.scenario.threats
    for a, b in pairwise(route):
        for share in np.linspace(0.0, 1.0, 200):
            point = a + share * (b - a)
            assert min(math.dist(point, place) for place in threats.position) > 480.0


def test_a_search_in_slices_finds_the_same_route(pocket: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    data = pocket.search
    frame = rotated_frame(data.start, data.destination)
    made = make_lattice(data, frame, 500.0)
    whole = cheapest_lattice_route(data, frame, made, 2, 1_000_000)
    asked: list[int] = []
    monkeypatch.setattr(lattice_routes, "STATES_AT_ONCE", 7)
    sliced = cheapest_lattice_route(data, frame, made, 2, 1_000_000, lambda: asked.append(0))
    assert len(whole) > 0
    assert len(asked) > 10
    np.testing.assert_array_equal(whole, sliced)
    # Not one state more than is allowed: the slices that find it are as many as are needed.
    needed = 7 * (len(asked) - 1)
    assert len(cheapest_lattice_route(data, frame, made, 2, needed)) == 0
    assert len(cheapest_lattice_route(data, frame, made, 2, needed + 7)) == len(whole)


def test_what_a_pause_raises_ends_the_search(pocket: Problem) -> None:
    def end() -> None:
        raise KeyboardInterrupt

    data = pocket.search
    with pytest.raises(KeyboardInterrupt):
        lattice_route(data, rotated_frame(data.start, data.destination), 500.0, end)
