"""Paths side by side: what is done to a block is done to each path of it, and to no other."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.corners import fly_by_radii
from planner.evaluation.leg_constraints import (
    BLOCK_SCRATCH,
    PATHS_PER_BLOCK,
    clear_sums,
    copy_point,
    interpolate_legs,
    load_waypoints,
    subtract_points,
)
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import ANGLE_MARGIN_RAD, Problem, make_problem
from planner.plan import Violation
from tests.planner.evaluation.violations import violations_of
from world.frames import fit_polymap
from world.scenario import Scenario

PLACE = ("east", "north", "up", "column", "row")
SIZE = 5


@pytest.fixture
def block() -> Any:
    """Scratch whose places hold random numbers."""
    scratch: Any = np.zeros(1, BLOCK_SCRATCH)
    rng = np.random.default_rng(4)
    for place in ("begin", "end", "step", "point"):
        for name in PLACE:
            scratch[place][name][0] = rng.uniform(-9.0, 9.0, PATHS_PER_BLOCK)
    for name in BLOCK_SCRATCH["sums"].names or ():
        scratch["sums"][name][0] = rng.uniform(1.0, 9.0, PATHS_PER_BLOCK)
    return scratch.view(np.recarray)[0]


def columns(place: Any) -> np.ndarray:
    """(5, PATHS_PER_BLOCK) copy of a place's numbers."""
    return np.array([place[name] for name in PLACE])


def test_all_sums_begin_with_nothing(block: Any) -> None:
    assert all((block.sums[name] > 0.0).all() for name in block.sums.dtype.names)
    clear_sums(block.sums)
    assert not any(block.sums[name].any() for name in block.sums.dtype.names)


def test_places_are_copied_for_the_paths_that_there_are(block: Any) -> None:
    begin, end = columns(block.begin), columns(block.end)
    copy_point(block.end, block.begin, SIZE)
    np.testing.assert_array_equal(columns(block.begin)[:, :SIZE], end[:, :SIZE])
    np.testing.assert_array_equal(columns(block.begin)[:, SIZE:], begin[:, SIZE:])


def test_a_step_leads_from_begin_to_end(block: Any) -> None:
    wanted, kept = columns(block.end) - columns(block.begin), columns(block.step)
    subtract_points(block.end, block.begin, SIZE, block.step)
    np.testing.assert_array_equal(columns(block.step)[:, :SIZE], wanted[:, :SIZE])
    np.testing.assert_array_equal(columns(block.step)[:, SIZE:], kept[:, SIZE:])


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_a_leg_is_divided_by_its_share(block: Any, share: float) -> None:
    wanted, kept = columns(block.begin) + share * columns(block.step), columns(block.point)
    interpolate_legs(block.begin, block.step, share, SIZE, block.point)
    np.testing.assert_allclose(columns(block.point)[:, :SIZE], wanted[:, :SIZE])
    np.testing.assert_array_equal(columns(block.point)[:, SIZE:], kept[:, SIZE:])


def test_waypoints_come_with_their_pixels(block: Any) -> None:
    # A map with every power up to three, which a polynomial of that degree holds exactly.
    def curved(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return 3.0 + x - 2.0 * y + 0.01 * x * y, 5.0 - y + 0.002 * x**2 * y - 0.001 * y**3

    to_pixel = fit_polymap(curved, [[-20.0, 30.0], [-40.0, 10.0]], 1e-9)
    rng = np.random.default_rng(5)
    paths = np.stack([rng.uniform(-20.0, 30.0, (9, 4)), rng.uniform(-40.0, 10.0, (9, 4)), rng.uniform(0, 9, (9, 4))], 2)
    kept = columns(block.end)
    # Waypoint 2 of paths 3 to 7.
    load_waypoints(to_pixel.record, paths, 3, 2, SIZE, block)
    got = columns(block.end)
    np.testing.assert_array_equal(got[:3, :SIZE], paths[3:8, 2].T)
    np.testing.assert_allclose(got[3:, :SIZE], curved(*paths[3:8, 2, :2].T), atol=1e-9)
    np.testing.assert_array_equal(got[:, SIZE:], kept[:, SIZE:])


# ----------------------------------------------------------------------
# What legs may not violate: slopes along arcs, and the length that fly-over turns take.

Make = Callable[[Scenario], Limits]
Small = Callable[..., Scenario]
# Of the aircraft of these tests: 25 m/s at the default bank limit of 30 degrees.
RADIUS = 25.0**2 / (9.80665 * math.tan(math.radians(30.0)))


def bent(degrees: float, first: float, last: float, rise: float, between: float = 0.0) -> np.ndarray:
    """Two legs (m) with a turn between them, or three with two turns to the same side, climbing evenly."""
    turn = math.radians(degrees)
    lengths = [first, last] if between == 0.0 else [first, between, last]
    path, course = [np.array([0.0, -2500.0, 150.0])], math.radians(20.0)
    for length in lengths:
        step = np.array([math.sin(course), math.cos(course), rise]) * length
        path.append(path[-1] + step)
        course += turn
    return np.array(path)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_an_arc_is_steeper_than_its_legs(scenario: Scenario, limits: Limits, direction: float) -> None:
    """Heights are held at the tangent points, and the arc between them is shorter: by 1.27 at 90 degrees."""
    data = make_problem(scenario, limits).search
    at = 150.0 if direction > 0.0 else 400.0
    turn = math.radians(90.0)
    arc, tangents = RADIUS * turn, 2.0 * RADIUS * math.tan(turn / 2.0)
    for share, steep in ((0.75, False), (0.95, True)):
        # Of what the legs may do; 0.95 of it is 1.21 along the arc.
        level = limits.slopes(0.0, 300.0)[0 if direction > 0.0 else 1] - ANGLE_MARGIN_RAD
        path = bent(90.0, 450.0, 450.0, direction * share * math.tan(level))
        path[:, 2] += at - 150.0
        count, excess = violations_of(data, path, Violation.SLOPE)
        assert count == int(steep)
        allowed = limits.slopes(0.0, path[1, 2])[0 if direction > 0.0 else 1] - ANGLE_MARGIN_RAD
        flown = abs(path[2, 2] - path[1, 2]) / 450.0 * tangents / arc
        assert excess == pytest.approx(max(0.0, flown - math.tan(allowed)), abs=1e-9)
        # A gentle turn has next to no such arc, and a fly-over has none.
        assert violations_of(data, path - (path - path[0]) * [0, 0, 0.3], Violation.SLOPE) == (0, 0.0)
        assert violations_of(data._replace(fly_over=True), path, Violation.SLOPE) == (0, 0.0)


def test_a_fly_over_takes_length_of_the_leg_after_it_alone(make_limits: Make, small: Small) -> None:
    """At 60 degrees: R (sin 60 + 2 sin phi), cos phi = 3/4, of the leg after; 5 % of it and 20 m stay straight."""
    over = small(flight={"fly_over": True})
    data = make_problem(over, make_limits(over)).search
    by = make_problem(small(), make_limits(small())).search
    need = RADIUS * (math.sin(math.radians(60.0)) + 2.0 * math.sqrt(1.0 - 0.75**2))
    fits = (need + 20.0) / 0.95
    for length, count in ((fits - 2.0, 1), (fits + 2.0, 0)):
        short = violations_of(data, bent(60.0, 900.0, 900.0, 0.0, length), Violation.TURN)
        assert short[0] == count
        assert short[1] == pytest.approx(max(0.0, (fits - length) * 0.95) / 100.0, abs=1e-6)
        # The last leg ends at the destination, with the turn before it to settle.
        assert violations_of(data, bent(60.0, 900.0, length, 0.0), Violation.TURN)[0] == count
    # A turn takes nothing from the leg before it; a fly-by takes its tangent, 64 m and what stays straight.
    path = bent(60.0, 70.0, 900.0, 0.0)
    assert violations_of(data, path, Violation.TURN)[0] == 0
    assert violations_of(by, path, Violation.TURN)[0] == 1
    assert not fly_by_radii(data, path).any()
    assert fly_by_radii(by, bent(60.0, 900.0, 900.0, 0.0))[1] == pytest.approx(RADIUS)


def test_short_leg_between_turns_counts_as_a_turn_with_aircraft_limits(problem: Problem) -> None:
    """Two 60 degree turns at R = 25^2 / (g tan 30) = 110 m use 64 m each; 5 % and 20 m are kept on top."""
    for length, count in ((150.0, 1), (170.0, 0)):
        step = length * np.array([math.sin(math.radians(30)), math.cos(math.radians(30))])
        path = np.array(
            [[0, -1500, 200], [2000, -1500, 200], [2000 + step[0], -1500 - step[1], 200], [5000, -1500 - step[1], 200]]
        )
        counts, _ = paper_scores(problem.search, path[None])
        assert counts[0, Violation.TURN] == count
        easy = problem.search._replace(legs_hold_turns=False, max_turn=math.radians(60.5))
        assert paper_scores(easy, path[None])[0][0, Violation.TURN] == 0


def test_first_and_last_turn_count_from_the_given_courses(
    scenario: Scenario, make_limits: Callable[[Scenario], Limits], small: Callable[..., Scenario]
) -> None:
    turned = small(
        start={"east_m": 0, "north_m": 0, "amsl_m": 150, "course_deg": 270},
        destination={"east_m": 6000, "north_m": 0, "amsl_m": 150, "course_deg": 80},
        limits={"max_turn_deg": 90},
    )
    data = make_problem(turned, make_limits(turned)).search
    path = np.array([[0, 0, 150], [3000, -1500, 200], [6000, 0, 150]], dtype=np.float64)
    counts, _ = paper_scores(data, path[None])
    assert counts[0, Violation.TURN] == 1
    assert paper_scores(data._replace(start_course=math.radians(100)), path[None])[0][0, Violation.TURN] == 0
    assert paper_scores(data._replace(destination_course=math.radians(260)), path[None])[0][0, Violation.TURN] == 2
