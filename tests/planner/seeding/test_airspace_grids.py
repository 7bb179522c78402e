"""Routes over a grid among zones and in a band of heights: which gaps they take, and that they are the shortest."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.encoding import rotated_frame
from planner.evaluation.problem import SEARCH_BUFFER, SEARCH_ZONE_MARGIN, make_problem
from planner.evaluation.problem_arrays import ProblemArrays
from planner.seeding.airspace_grids import AirspaceGrid, cheapest_airspace_route
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
    gap = 2.0 * SEARCH_ZONE_MARGIN
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
    over = wall(-2950.0, 2950.0, floor_amsl_m=150.0 + SEARCH_BUFFER + more)
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
    assert beside[:, 1].min() >= 600.0 + SEARCH_ZONE_MARGIN


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
