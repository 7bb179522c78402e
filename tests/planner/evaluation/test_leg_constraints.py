"""What keeps a plan flyable, term by term: slopes along arcs, what turbulence leaves, room after fly-overs."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from aircraft.path_limits import Limits, fly_over_run
from planner.evaluation.fly_by_corners import corner_radii
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import SPARE, TURBULENCE_SHARE, make_problem
from planner.evaluation.problem_arrays import Rules
from planner.plan import Violation
from world.scenario import Scenario

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


def missed(rules: Rules, path: np.ndarray, kind: Violation) -> tuple[int, float]:
    """Count of the paper's judge, and what the graded one says."""
    counts, graded = paper_scores(rules, path[None])[0], graded_scores(rules, path[None])[0]
    return int(counts[0, kind]), float(graded[0, kind])


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_an_arc_is_steeper_than_its_legs(scenario: Scenario, limits: Limits, direction: float) -> None:
    """Heights are held at the tangent points, and the arc between them is shorter: by 1.27 at 90 degrees."""
    rules = make_problem(scenario, limits).search
    at = 150.0 if direction > 0.0 else 400.0
    turn = math.radians(90.0)
    arc, tangents = RADIUS * turn, 2.0 * RADIUS * math.tan(turn / 2.0)
    for share, steep in ((0.75, False), (0.95, True)):
        # Of what the legs may do; 0.95 of it is 1.21 along the arc.
        level = limits.slopes(0.0, 300.0)[0 if direction > 0.0 else 1] - SPARE
        path = bent(90.0, 450.0, 450.0, direction * share * math.tan(level))
        path[:, 2] += at - 150.0
        count, excess = missed(rules, path, Violation.SLOPE)
        assert count == int(steep)
        allowed = limits.slopes(0.0, path[1, 2])[0 if direction > 0.0 else 1] - SPARE
        flown = abs(path[2, 2] - path[1, 2]) / 450.0 * tangents / arc
        assert excess == pytest.approx(max(0.0, flown - math.tan(allowed)), abs=1e-9)
        # A gentle turn has next to no such arc, and a fly-over has none.
        assert missed(rules, path - (path - path[0]) * [0, 0, 0.3], Violation.SLOPE) == (0, 0.0)
        assert missed(rules._replace(fly_over=True), path, Violation.SLOPE) == (0, 0.0)


@pytest.mark.parametrize(("turbulence", "count"), [("none", 0), ("light", 0), ("moderate", 1)])
def test_turbulence_leaves_a_share_of_climb_and_descent(
    make_limits: Make, small: Small, turbulence: str, count: int
) -> None:
    scenario = small(wind={"speed_mps": 0, "from_deg": 0, "turbulence": turbulence})
    limits = make_limits(scenario)
    rules = make_problem(scenario, limits).search
    assert TURBULENCE_SHARE == {"none": 1.0, "light": 0.9, "moderate": 0.8}
    for way in (0, 1):
        # 0.87 of the aircraft's own angle, and half a degree in reserve: within 0.9 of it, and not within 0.8.
        steepest = limits.slopes(0.0, 200.0)[way]
        rise = math.tan(0.87 * steepest - SPARE) * (1.0 if way == 0 else -1.0)
        path = np.array([[0.0, -2500.0, 200.0], [300.0, -2500.0, 200.0 + 300.0 * rise]])
        assert missed(rules, path, Violation.SLOPE)[0] == count
        # Just within the share, and just beyond it.
        for beyond, more in ((-1e-4, 0), (1e-4, 1)):
            angle = TURBULENCE_SHARE[turbulence] * steepest - SPARE + beyond
            path = np.array([[0.0, -2500.0, 200.0], [1.0, -2500.0, 200.0 + math.copysign(math.tan(angle), rise)]])
            assert missed(rules, path, Violation.SLOPE)[0] == more


def overshoot(turn: float) -> float:
    """Run after a fly-over turn, in radii, by flying it: past the course and back until the track is on the leg."""

    def beside(extra: float) -> tuple[float, float]:
        """Along and beside the leg, after the turn and `extra` past it, and back by as much."""
        course, along, aside, steps = -turn, 0.0, 0.0, 4000
        for side, angle in ((1.0, turn + extra), (-1.0, extra)):
            for _ in range(steps):
                middle = course + side * angle / (2 * steps)
                along += math.cos(middle) * angle / steps
                aside += math.sin(middle) * angle / steps
                course += side * angle / steps
        return along, aside

    low, high = 0.0, math.pi / 2
    for _ in range(50):
        extra = 0.5 * (low + high)
        low, high = (extra, high) if beside(extra)[1] < 0.0 else (low, extra)
    return beside(low)[0]


@pytest.mark.parametrize("degrees", [10.0, 45.0, 90.0, 105.0])
def test_run_after_a_fly_over(degrees: float) -> None:
    assert fly_over_run(math.radians(degrees)) == pytest.approx(overshoot(math.radians(degrees)), rel=1e-5)


def test_run_after_a_fly_over_never_falls_with_the_angle() -> None:
    runs = [fly_over_run(angle) for angle in np.linspace(0.0, math.pi, 200)]
    assert np.diff(runs).min() >= 0.0
    assert runs[-1] == pytest.approx(2.0 * math.sqrt(2.0))


def test_a_fly_over_needs_room_on_the_leg_after_it_alone(make_limits: Make, small: Small) -> None:
    """At 60 degrees: R (sin 60 + 2 sin phi), cos phi = 3/4, of the leg after; 5 % of it and 20 m stay straight."""
    over = small(flight={"fly_over": True})
    rules = make_problem(over, make_limits(over)).search
    by = make_problem(small(), make_limits(small())).search
    need = RADIUS * (math.sin(math.radians(60.0)) + 2.0 * math.sqrt(1.0 - 0.75**2))
    fits = (need + 20.0) / 0.95
    for length, count in ((fits - 2.0, 1), (fits + 2.0, 0)):
        short = missed(rules, bent(60.0, 900.0, 900.0, 0.0, length), Violation.TURN)
        assert short[0] == count
        assert short[1] == pytest.approx(max(0.0, (fits - length) * 0.95) / 100.0, abs=1e-6)
        # The last leg ends at the destination, with the turn before it to settle.
        assert missed(rules, bent(60.0, 900.0, length, 0.0), Violation.TURN)[0] == count
    # A turn takes nothing from the leg before it; a fly-by takes its tangent, 64 m and what stays straight.
    path = bent(60.0, 70.0, 900.0, 0.0)
    assert missed(rules, path, Violation.TURN)[0] == 0
    assert missed(by, path, Violation.TURN)[0] == 1
    assert not corner_radii(rules, path).any()
    assert corner_radii(by, bent(60.0, 900.0, 900.0, 0.0))[1] == pytest.approx(RADIUS)
