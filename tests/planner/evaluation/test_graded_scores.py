"""The graded scores see what six points a leg do not, and nothing where there is nothing."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.graded_scores import _score_paths, graded_scores
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import SEARCH_BUFFER_M, SEARCH_KILL_MARGIN_M, Problem, ProblemArrays, make_problem
from planner.plan import Objective, Violation
from tests.planner.tracking_limits import with_tracking_error
from world.frames import polymap
from world.kernels import read_only
from world.scenario import Scenario


def test_a_path_beside_everything_has_no_violation(problem: Problem) -> None:
    path = np.array([[0, 0, 150], [2000, -1500, 200], [4200, -1500, 200], [6000, 0, 150]], dtype=np.float64)
    counts, objectives = paper_scores(problem.search, path[None])
    graded, smooth = graded_scores(problem.search, path[None])
    assert not counts.any()
    assert not graded.any()
    assert objectives[0, Objective.KILL_EXPOSURE] == 0.0
    assert smooth[0, Objective.KILL_EXPOSURE] == 0.0
    assert smooth[0, Objective.LENGTH_RATIO] == objectives[0, Objective.LENGTH_RATIO]


def test_a_path_that_cannot_be_written_is_scored_by_the_same_kernel(problem: Problem) -> None:
    """As a plan's own is; another took eight seconds to compile."""
    paths = np.array([[problem.space.start, problem.space.destination]])
    found = graded_scores(problem.search, paths)
    kernels = len(_score_paths.signatures)
    again = graded_scores(problem.search, read_only(paths))
    assert [scores.tolist() for scores in again] == [scores.tolist() for scores in found]
    assert len(_score_paths.signatures) == kernels


def test_a_sphere_cut_between_points_is_seen_only_by_the_graded_scores(problem: Problem) -> None:
    """Leg points stand 1 km apart; the leg dips 30 m into the sphere between two of them."""
    path = np.array([[0, 0, 150], [0, -870, 150], [6000, -870, 150], [6000, 0, 150]], dtype=np.float64)
    _, paper = paper_scores(problem.search, path[None])
    _, graded = graded_scores(problem.search, path[None])
    distance = math.hypot(670, 150 - problem.search.threats["up"][0])
    assert 600 < distance < 700
    inside = [e for e in range(0, 6001, 1000) if math.dist((e, -870, 150), problem.scenario.threats.position[0]) <= 700]
    assert (paper[0, Objective.KILL_EXPOSURE] > 0) == bool(inside)
    assert graded[0, Objective.KILL_EXPOSURE] > 0


# Ground whose raster can hold a ramp.
FINE = {"kind": "peaks", "peak": [{"east_m": 0, "north_m": 0, "height_m": 1, "sigma_m": 100}]}
# An autopilot that strays from its legs, over level ground at 0 m; 60 m of clearance.
CORNER = np.array([[0.0, 0.0, 200.0], [3000.0, 0.0, 200.0], [3000.0, 2500.0, 200.0], [6000.0, 2500.0, 200.0]])


@pytest.fixture
def strayed(small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]) -> Callable[..., ProblemArrays]:
    """Arrays of the search for an autopilot that strays by these numbers, past this missile if there is one."""

    def made(numbers: dict[str, float], *missile: float, **tables: Any) -> ProblemArrays:
        east, north, amsl, radius = missile or (0.0, -2900.0, 200.0, 1.0)
        unit = {"east_m": east, "north_m": north, "amsl_m": amsl, "kill_radius_m": radius, "kill_scale_m": 100}
        ground = {"terrain": {"kind": "flat", "amsl_m": 0}, "threats": [unit], "limits": {"min_clearance_m": 60}}
        ends = {
            "destination": {"east_m": 6000, "north_m": 2500, "amsl_m": 200},
            "start": {"east_m": 0, "north_m": 0, "amsl_m": 200},
        }
        scenario = small(**(ground | ends | tables))
        return make_problem(scenario, with_tracking_error(make_limits(scenario), **numbers)).search

    return made


def kill_of(data: ProblemArrays, path: np.ndarray) -> float:
    return float(graded_scores(data, path[None])[1][0, Objective.KILL_EXPOSURE])


@pytest.mark.parametrize(("excursion", "hit"), [(38.0, False), (42.0, True)])
def test_a_missile_outside_a_corner_is_kept_by_what_is_strayed_there(
    strayed: Callable[..., ProblemArrays], excursion: float, hit: bool
) -> None:
    """South-east of the right angle, 40 m and the margin outside: within the excursion or beyond it."""
    away = (500.0 + SEARCH_KILL_MARGIN_M + 40.0) / math.sqrt(2.0)
    data = strayed({"excursion": excursion}, 3000.0 + away, -away, 200.0, 500.0)
    assert (kill_of(data, CORNER) > 0.0) == hit
    # Beside the middle of a straight leg, as far away, an excursion at the corner does not matter.
    beside = strayed({"excursion": excursion}, 1200.0, -(500.0 + SEARCH_KILL_MARGIN_M + 1.0), 200.0, 500.0)
    assert kill_of(beside, CORNER) == 0.0


@pytest.mark.parametrize(("across", "hit"), [(4.0, False), (6.0, True)])
def test_a_missile_beside_a_leg_is_kept_by_what_is_strayed_everywhere(
    strayed: Callable[..., ProblemArrays], across: float, hit: bool
) -> None:
    data = strayed({"across": across}, 1200.0, -(500.0 + SEARCH_KILL_MARGIN_M + 5.0), 200.0, 500.0)
    assert (kill_of(data, CORNER) > 0.0) == hit


@pytest.mark.parametrize(("lag", "low"), [(2.9, False), (3.6, True)])
def test_ground_under_a_climb_is_kept_by_the_lag(strayed: Callable[..., ProblemArrays], lag: float, low: bool) -> None:
    """A climb at 0.1 that ends 8 m above what is wanted, after 3 s of 25.3 m/s: 7.6 m low at its end, and 9.1 m."""
    top = 60.0 + SEARCH_BUFFER_M + 8.0
    path = np.array(
        [[0.0, 0.0, top + 40.0], [2000.0, 0.0, top + 40.0], [3400.0, 0.0, top + 180.0], [6000.0, 0.0, top + 180.0]]
    )
    # Ground that rises with the climb, 8 m nearer than it may be.
    data = strayed({"lag": lag}, terrain=FINE)
    heights = np.zeros(data.heights.shape, dtype=np.float32)
    columns = np.arange(heights.shape[1])
    east = data_east(data, columns)
    heights += np.clip(0.1 * (east - 2000.0), -40.0, 140.0).astype(np.float32) + np.float32(40.0)
    tiles = np.full_like(data.slope_bounds.tiles, 0.11)
    # As a problem's own are: numba compiles what reads an array that can be written anew.
    heights.setflags(write=False)
    tiles.setflags(write=False)
    slopes = data.slope_bounds._replace(steepest=0.0, tiles=tiles)
    data = data._replace(heights=heights, slope_bounds=slopes)
    depth = float(graded_scores(data, path[None])[0][0, Violation.TERRAIN])
    assert (depth > 0.0) == low


def data_east(data: ProblemArrays, columns: np.ndarray) -> np.ndarray:
    """East of raster columns, m: the map to pixels is even here."""
    low, high = polymap(data.to_pixel, 0.0, 0.0)[0], polymap(data.to_pixel, 1000.0, 0.0)[0]
    return (columns - low) / (high - low) * 1000.0
