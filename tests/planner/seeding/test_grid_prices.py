"""What a m of way costs in a cell: 1 in the open, more inside kill spheres, inf near the ground and off the map."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from aircraft.path_limits import Limits
from planner.evaluation.clearance_buffer import required_clearance
from planner.evaluation.encoding import RotatedFrame, rotated_frame
from planner.evaluation.problem import make_problem
from planner.evaluation.problem_arrays import ProblemArrays
from planner.seeding.grid_prices import (
    COARSE,
    COARSE_GROWTH,
    KILL_COST,
    OBSTACLE,
    Grid,
    find_obstacles,
    position_of,
    set_prices,
)
from world.scenario import Scenario

Floats = NDArray[np.float64]


@pytest.fixture
def data(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> ProblemArrays:
    """Level ground at 0 m; one missile of 700 m at east 4200, north -200, on the ground, and a radar."""
    radar = {"east_m": 1000, "north_m": 0, "detection_radius_m": 900, "detection_scale_m": 90}
    missile = {"east_m": 4200, "north_m": -200, "kill_radius_m": 700, "kill_scale_m": 70}
    scenario = small(terrain={"kind": "flat", "amsl_m": 0}, threats=[radar, missile])
    return make_problem(scenario, make_limits(scenario)).search


def prices(data: ProblemArrays, grid: Grid, stage: int, *, without_threats: bool = False, extra: float = 0.0) -> Floats:
    """Cost per m of a stage's cells (layers, across)."""
    frame = rotated_frame(data.start, data.destination)
    obstacles = find_obstacles(data, frame, frame.length / grid.stages)
    if without_threats:
        obstacles = np.zeros(0, dtype=OBSTACLE)
    out = np.full((grid.layers.size, grid.across.size), -1.0)
    more = np.full((grid.stages + 1, grid.across.size), extra)
    set_prices(data, required_clearance(data), frame, stage, obstacles, grid, more, 0, grid.across.size - 1, out)
    return out


def test_places_in_the_rotated_frame_come_back_to_the_map() -> None:
    # Towards north-west: along is (-1, 1) / sqrt(2), across, to the left of it, (-1, -1) / sqrt(2).
    h = math.sqrt(0.5)
    frame = rotated_frame(np.array([100.0, 200.0, 0.0]), np.array([-900.0, 1200.0, 0.0]))
    assert position_of(frame, 0.0, 0.0) == (100.0, 200.0)
    assert position_of(frame, 10.0, 0.0) == pytest.approx((100.0 - 10.0 * h, 200.0 + 10.0 * h))
    assert position_of(frame, 0.0, 10.0) == pytest.approx((100.0 - 10.0 * h, 200.0 - 10.0 * h))
    east, north = position_of(frame, 300.0, -70.0)
    assert frame.rotate(np.array([[east, north, 5.0]]))[0] == pytest.approx([300.0, -70.0, 5.0])


@pytest.mark.parametrize("step", [COARSE, COARSE + 1.0])
def test_obstacles_are_the_missiles_with_their_margin(data: ProblemArrays, step: float) -> None:
    frame = RotatedFrame(4000.0, 0.0, 0.0, 1.0, 6000.0)  # along to the north, across to the west
    obstacles = find_obstacles(data, frame, step)
    assert len(obstacles) == 1
    growth = 0.0 if step <= COARSE else COARSE_GROWTH * step
    assert obstacles[0].tolist() == pytest.approx((-200.0, -200.0, 0.0, 700.0 + data.kill_margin + growth))


def test_cells_in_the_open_cost_their_length_and_what_is_added(data: ProblemArrays) -> None:
    grid = Grid(30, np.array([-2500.0, 0.0, 2500.0]), np.array([200.0, 300.0]))
    assert (prices(data, grid, 5, without_threats=True) == 1.0).all()
    assert (prices(data, grid, 5, without_threats=True, extra=0.75) == 1.75).all()


def test_cells_near_the_ground_are_closed(data: ProblemArrays) -> None:
    lowest = data.clearance + data.buffer
    grid = Grid(30, np.array([0.0]), np.array([lowest - 0.01, lowest + 0.01]))
    assert prices(data, grid, 5, without_threats=True).ravel().tolist() == [math.inf, 1.0]


def test_cells_off_the_map_are_closed(data: ProblemArrays) -> None:
    # Across is to the left of the way to the east: north.
    across = np.array([data.south - 1.0, data.south + 1.0, data.north - 1.0, data.north + 1.0])
    grid = Grid(30, across, np.array([300.0]))
    assert prices(data, grid, 5, without_threats=True).ravel().tolist() == [math.inf, 1.0, 1.0, math.inf]


def test_the_destination_itself_is_open_whatever_its_clearance(data: ProblemArrays) -> None:
    grid = Grid(30, np.array([-200.0, 0.0, 200.0]), np.array([1.0, 300.0]))
    assert prices(data, grid, 30, without_threats=True).tolist() == [[math.inf, 1.0, math.inf], [1.0, 1.0, 1.0]]


def test_inside_a_kill_sphere_a_metre_costs_more_towards_its_middle(data: ProblemArrays) -> None:
    # 30 stages of 200 m: stage 21 is at the missile's east, and cells are no coarser than they may be.
    radius = 700.0 + data.kill_margin
    grid = Grid(30, np.linspace(-1000.0, 1000.0, 11), np.array([100.0, 400.0]))
    got = prices(data, grid, 21)
    for z, up in enumerate(grid.layers):
        for y, place in enumerate(grid.across):
            away = math.hypot(place + 200.0, up)
            wanted = 1.0 + (KILL_COST * (3.0 - 2.0 * away / radius) if away < radius else 0.0)
            assert got[z, y] == pytest.approx(wanted), (place, up)
    assert got.max() > 100.0
    assert (got == 1.0).any()


def test_a_sphere_ends_where_its_radius_does(data: ProblemArrays) -> None:
    radius, layer = 700.0 + data.kill_margin, 300.0
    half = math.sqrt(radius**2 - layer**2)
    grid = Grid(30, -200.0 + half + np.array([-2.0, 0.0, 2.0]) - 1.0, np.array([layer]))
    inner, outer = prices(data, grid, 21).ravel()[[0, 2]]
    assert inner == pytest.approx(1.0 + KILL_COST, rel=0.01)
    assert outer == 1.0
