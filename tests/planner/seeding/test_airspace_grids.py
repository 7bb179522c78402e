"""Routes over a grid among zones and in a band of heights: which gaps they take, and that they are the shortest."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.encoding import rotated_frame
from planner.evaluation.problem import SEARCH_BUFFER_M, SEARCH_ZONE_MARGIN_M, ProblemArrays, make_problem
from planner.seeding import airspace_grids
from planner.seeding.airspace_grids import (
    GENTLE_SLOPE_FRACTION,
    MAX_CELLS,
    MIN_LAYERS,
    STAGE_FACTOR,
    AirspaceGrid,
    airspace_grid,
    airspace_routes,
    cheapest_airspace_route,
)
from world.scenario import Scenario

Made = Callable[..., ProblemArrays]
ACROSS = np.arange(-20, 21) * 100.0


@pytest.fixture
def made(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> Made:
    def arrays(**tables: Any) -> ProblemArrays:
        scenario = small(**({"terrain": {"kind": "flat", "amsl_m": 0}, "threats": []} | tables))
        return make_problem(scenario, make_limits(scenario)).search

    return arrays


def wall(low: float, high: float, **levels: float) -> dict[str, Any]:
    """A wall 20 m thick across the way, narrower than a grid's step."""
    corners = [[3040, low], [3060, low], [3060, high], [3040, high]]
    return {"name": "wall", "kind": "exclusion", "polygon_m": corners, **levels}


def route(data: ProblemArrays, grid: AirspaceGrid) -> tuple[np.ndarray, float]:
    frame = rotated_frame(data.start, data.destination)
    points, cost = cheapest_airspace_route(data, frame, grid, np.zeros((grid.stages + 1, grid.across.size)), np.inf)
    return points, float(cost)


def test_a_wall_thinner_than_a_step_is_passed_through_its_gap(made: Made) -> None:
    gap = 2.0 * SEARCH_ZONE_MARGIN_M
    grid = AirspaceGrid(60, ACROSS, 3, 20.0, False, 130.0)
    open_wall = [wall(-2900.0, 700.0 - 0.51 * gap), wall(700.0 + 0.51 * gap, 2900.0)]
    points, cost = route(made(zones=open_wall), grid)
    crossing = np.interp(3050.0, points[:, 0], points[:, 1])
    assert crossing == pytest.approx(700.0, abs=1.0)
    # There and back in steps of one or none aside: seven of each, at 45 degrees.
    assert cost == pytest.approx(2.0 * (7.0 * np.sqrt(2.0) * 100.0 + 2300.0), rel=0.02)
    closed = [wall(-2900.0, 700.0 - 0.49 * gap), wall(700.0 + 0.49 * gap, 2900.0)]
    assert len(route(made(zones=closed), grid)[0]) == 0


@pytest.mark.parametrize(("more", "passes"), [(0.5, True), (-0.5, False)])
def test_a_wall_is_passed_below_its_floor(made: Made, more: float, passes: bool) -> None:
    grid = AirspaceGrid(60, ACROSS, 3, 20.0, False, 130.0)
    over = wall(-2950.0, 2950.0, floor_amsl_m=150.0 + SEARCH_BUFFER_M + more)
    points, _ = route(made(zones=[over]), grid)
    assert (len(points) > 0) == (True if passes else len(points) > 0 and points[30, 2] < 150.0)
    if passes:
        assert points[30, 2] <= 150.0


def test_an_inclusion_is_stayed_within(made: Made) -> None:
    """A bend: the way leads round the notch, and never within the margin of the fence."""
    fence = [[-300, -300], [6300, -300], [6300, 1500], [-300, 1500]]
    notch = [
        [-300, -300],
        [2500, -300],
        [2500, 600],
        [3500, 600],
        [3500, -300],
        [6300, -300],
        [6300, 1500],
        [-300, 1500],
    ]
    grid = AirspaceGrid(60, ACROSS, 1, 20.0, False, 150.0)
    straight, _ = route(made(zones=[{"name": "it", "kind": "inclusion", "polygon_m": fence}]), grid)
    assert np.abs(straight[:, 1]).max() == 0.0
    around, _ = route(made(zones=[{"name": "it", "kind": "inclusion", "polygon_m": notch}]), grid)
    beside = around[(around[:, 0] >= 2500.0) & (around[:, 0] <= 3500.0)]
    assert beside[:, 1].min() >= 600.0 + SEARCH_ZONE_MARGIN_M


def test_layers_that_follow_the_ground_stay_in_the_band(made: Made) -> None:
    hill = {"kind": "peaks", "peak": [{"east_m": 3000, "north_m": 100, "height_m": 120, "sigma_m": 900}]}
    ends = {
        name: {"east_m": east, "north_m": 0, "height_m": 100} for name, east in (("start", 0), ("destination", 6000))
    }
    data = made(terrain=hill, limits={"min_clearance_m": 60, "max_height_m": 140}, **ends)
    band = 140.0 - data.airspace.buffer - 60.0 - data.buffer
    grid = AirspaceGrid(60, ACROSS[15:26], 9, band / 8.0, True, 0.0)
    points, _ = route(data, grid)
    assert len(points) == 61
    east, north = points[:, 0], points[:, 1]
    ground = 120.0 * np.exp(-((east - 3000.0) ** 2 + (north - 100.0) ** 2) / (2.0 * 900.0**2))
    over = (points[:, 2] - ground)[1:-1]
    assert over.min() >= 60.0 + data.buffer - 1.0
    assert over.max() <= 140.0 - data.airspace.buffer + 1.0
    # And in its middle, where nothing asks for another height.
    assert np.median(np.abs(over - over.mean())) < 0.25 * band


def test_no_step_is_steeper_than_the_aircraft_flies(made: Made) -> None:
    ridge = {"kind": "peaks", "peak": [{"east_m": 3000, "north_m": 0, "height_m": 400, "sigma_m": 250}]}
    limits = {"min_clearance_m": 60, "max_height_m": 140, "max_climb_deg": 10, "max_dive_deg": 10}
    data = made(terrain=ridge, limits=limits)
    grid = AirspaceGrid(60, ACROSS, 9, 5.0, True, 0.0)
    points, _ = route(data, grid)
    assert len(points) == 61
    steps = np.diff(points, axis=0)
    assert np.abs(steps[:, 2] / np.hypot(steps[:, 0], steps[:, 1])).max() <= np.tan(np.radians(10.0))
    # Straight on the ridge is steeper than that: the way leads round it.
    assert np.abs(points[:, 1]).max() >= 300.0


def test_a_gentle_grid_turns_less_and_leaves_a_tenth_of_the_slopes(made: Made) -> None:
    """Three towers to be passed: by the shortest way, or with fewer changes of course."""
    zones = [
        {
            "name": f"tower {k}",
            "kind": "exclusion",
            "east_m": 1000 + 1000 * k,
            "north_m": 60 * (-1) ** k,
            "radius_m": 150,
        }
        for k in range(3)
    ]
    ridge = {"kind": "peaks", "peak": [{"east_m": 4800, "north_m": 0, "height_m": 300, "sigma_m": 400}]}
    limits = {"min_clearance_m": 60, "max_height_m": 160, "max_climb_deg": 15, "max_dive_deg": 15}
    data = made(zones=zones, terrain=ridge, limits=limits)
    found = []
    for gentle in (False, True):
        points, _ = route(data, AirspaceGrid(60, ACROSS, 12, 6.0, True, 0.0, gentle))
        assert len(points) == 61
        steps = np.diff(points, axis=0)
        steepest = float(np.abs(steps[:, 2] / np.hypot(steps[:, 0], steps[:, 1])).max())
        found.append((float((np.diff(steps[:, 1] / 100.0) ** 2).sum()), steepest))
    (turns, steepest), (gentle_turns, gentlest) = found
    assert gentle_turns < turns
    assert gentlest <= GENTLE_SLOPE_FRACTION * np.tan(np.radians(15.0)) < steepest


# ----------------------------------------------------------------------
# Grids of airspace problems, and several routes over one.

SPAN = (-3000.0, 3000.0)
FLAT = {"kind": "flat", "amsl_m": 0}


def arrays(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits], **tables: Any) -> ProblemArrays:
    scenario = small(**({"terrain": FLAT, "threats": []} | tables))
    return make_problem(scenario, make_limits(scenario)).search


def test_layers_follow_the_ground_where_there_is_a_greatest_height(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    data = arrays(small, make_limits, limits={"min_clearance_m": 60, "max_height_m": 200})
    grid = airspace_grid(data, rotated_frame(data.start, data.destination), SPAN, 60)
    assert grid.follows
    assert grid.layers >= MIN_LAYERS
    # The layers reach from what is cleared to what is not exceeded, and further where an end leaves more.
    assert (grid.layers - 1) * grid.layer_spacing >= 200.0 - data.airspace.buffer - 60.0 - data.buffer
    assert 0.0 in grid.across


def test_layers_lie_level_without_one_and_the_grid_is_not_too_large(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    zone = {"name": "it", "kind": "exclusion", "east_m": 3000, "north_m": 0, "radius_m": 300}
    data = arrays(small, make_limits, zones=[zone])
    frame = rotated_frame(data.start, data.destination)
    grid = airspace_grid(data, frame, SPAN, 60)
    assert not grid.follows
    assert grid.floor + (grid.layers - 1) * grid.layer_spacing <= data.ceiling
    large = airspace_grid(data, frame, SPAN, 5000)
    assert large.stages < 5000
    assert (large.stages + 1) * large.across.size * large.layers <= MAX_CELLS


def test_routes_of_one_grid_take_both_sides(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    zone = {"name": "it", "kind": "exclusion", "east_m": 3000, "north_m": 100, "radius_m": 900}
    data = arrays(small, make_limits, zones=[zone])
    routes = list(airspace_routes(data, rotated_frame(data.start, data.destination), SPAN, ((20, 2),)))
    # One where the grid is not gentle, and two where it is.
    assert [len(route.points) for route in routes] == [20 * STAGE_FACTOR + 1] * 3
    routes = routes[1:]
    middles = [float(np.interp(3000.0, route.points[:, 0], route.points[:, 1])) for route in routes]
    assert middles[0] < -800.0
    assert middles[1] > 1000.0
    assert routes[0].cost < routes[1].cost


def test_a_search_in_slices_finds_the_same_route_and_asks_after_each(
    made: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = made(zones=[wall(-2900.0, 700.0), wall(900.0, 2900.0)])
    frame = rotated_frame(data.start, data.destination)
    grid = AirspaceGrid(60, ACROSS, 3, 20.0, False, 130.0, gentle=True)
    extra, asked = np.zeros((61, ACROSS.size)), list[int]()
    whole, cost = cheapest_airspace_route(data, frame, grid, extra, np.inf, lambda: asked.append(0))
    assert len(whole) == 61
    assert len(asked) == 1
    # Two stages of 41 x 3 cells at once: each of thirty slices.
    monkeypatch.setattr(airspace_grids, "CELLS_PER_CHECK", 2 * 41 * 3)
    sliced, same = cheapest_airspace_route(data, frame, grid, extra, np.inf, lambda: asked.append(0))
    assert len(asked) == 1 + 30
    np.testing.assert_array_equal(whole, sliced)
    assert cost == same


def test_a_bound_on_the_cost_changes_no_route_below_it(made: Made) -> None:
    data = made(zones=[wall(-2900.0, 700.0), wall(900.0, 2900.0)])
    frame = rotated_frame(data.start, data.destination)
    grid = AirspaceGrid(60, ACROSS, 3, 20.0, False, 130.0, gentle=True)
    extra = np.zeros((61, ACROSS.size))
    whole, cost = cheapest_airspace_route(data, frame, grid, extra, np.inf)
    for more in (1.0, 30.0, 3000.0):
        bounded, same = cheapest_airspace_route(data, frame, grid, extra, cost + more)
        np.testing.assert_array_equal(whole, bounded)
        assert cost == same
    assert len(cheapest_airspace_route(data, frame, grid, extra, cost - 1.0)[0]) == 0


def test_a_search_that_comes_no_further_ends(made: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    data = made(zones=[wall(-2900.0, 2900.0)])
    frame = rotated_frame(data.start, data.destination)
    grid, asked = AirspaceGrid(60, ACROSS, 3, 20.0, False, 130.0), list[int]()
    monkeypatch.setattr(airspace_grids, "CELLS_PER_CHECK", 1)
    points, cost = cheapest_airspace_route(
        data, frame, grid, np.zeros((61, ACROSS.size)), np.inf, lambda: asked.append(0)
    )
    assert len(points) == 0
    assert cost == math.inf
    # The wall is half way, at stage 30 of 60.
    assert 25 <= len(asked) <= 32


def test_what_a_pause_raises_ends_the_routes(made: Made) -> None:
    def end() -> None:
        raise KeyboardInterrupt

    data = made(zones=[wall(-2900.0, 700.0)])
    with pytest.raises(KeyboardInterrupt):
        next(airspace_routes(data, rotated_frame(data.start, data.destination), (-2000.0, 2000.0), ((20, 1),), end))
