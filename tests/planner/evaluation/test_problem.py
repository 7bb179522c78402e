"""Threats as records and as spheres: each number under its name, powers as they are compared with."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from aircraft.path_limits import Limits
from aircraft.tracking import TrackingError
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.problem import (
    ANGLE_MARGIN_RAD,
    CERTIFIED_BUFFER_M,
    OBJECTIVES,
    SEARCH_BUFFER_M,
    SLOPE_FRACTION_BY_TURBULENCE,
    SPHERE,
    VIOLATIONS,
    as_columns,
    make_problem,
    sphere_records,
    threat_records,
)
from planner.plan import Objective, Violation
from tests.planner.evaluation.violations import violations_of
from world.scenario import Scenario
from world.threats import Threats


def test_a_search_takes_unknown_ground_for_ground_up_to_the_ceiling(scenario: Scenario, limits: Limits) -> None:
    """So that it leads around, while the certificate knows nothing of the ground there."""
    ground = scenario.terrain
    assert ground is not None
    heights = ground.heights.copy()
    row, col = heights.shape[0] // 2, heights.shape[1] // 2
    heights[row, col] = np.nan
    problem = make_problem(replace(scenario, terrain=replace(ground, heights=heights)), limits)
    assert np.isnan(problem.certified.heights[row, col])
    # Each height is interpolated from four pixels, so all next to it are unknown, too.
    assert (problem.search.heights[row - 1 : row + 2, col - 1 : col + 2] == np.float32(scenario.ceiling)).all()
    assert int((problem.search.heights != ground.heights).sum()) == 9


THREATS = Threats(
    names=("missile", "radar"),
    position=np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
    kill_radius=np.array([700.0, 0.0]),
    detection_radius=np.array([0.0, 900.0]),
    kill_scale=np.array([70.0, 0.0]),
    detection_scale=np.array([0.0, 90.0]),
)


def test_units_stand_under_their_names() -> None:
    missile, radar = threat_records(THREATS)
    assert [missile[name] for name in ("east", "north", "up")] == [1.0, 2.0, 3.0]
    assert [radar[name] for name in ("east", "north", "up")] == [4.0, 5.0, 6.0]
    names = ("kill_radius", "kill_scale", "detection_radius", "detection_scale")
    assert [missile[name] for name in names] == [700.0, 70.0, 0.0, 0.0]
    assert [radar[name] for name in names] == [0.0, 0.0, 900.0, 90.0]


def test_spheres_hold_squares_and_fourth_powers() -> None:
    missile, radar = sphere_records(threat_records(THREATS))
    assert [radar[name] for name in ("east", "north", "up")] == [4.0, 5.0, 6.0]
    assert (missile["kill_radius2"], missile["kill_scale4"]) == (490_000.0, 24_010_000.0)
    assert (radar["detection_radius2"], radar["detection_scale4"]) == (810_000.0, 65_610_000.0)


def test_no_distance_is_within_a_weapon_that_is_not_there() -> None:
    missile, radar = sphere_records(threat_records(THREATS))
    # Not even that of a point at the unit itself.
    assert missile["detection_radius2"] < 0.0
    assert radar["kill_radius2"] < 0.0


def test_a_sphere_fills_a_line_of_the_cache() -> None:
    assert SPHERE.itemsize == 64


@pytest.mark.parametrize("make", [threat_records, lambda threats: sphere_records(threat_records(threats))])
def test_records_are_locked_and_none_are_made_of_none(make: object) -> None:
    assert callable(make)
    assert len(make(Threats((), np.zeros((0, 3)), *(4 * [np.zeros(0)])))) == 0
    assert not make(THREATS).flags.writeable


def test_columns_stand_in_the_order_of_violations_and_objectives() -> None:
    found = np.zeros(2, VIOLATIONS)
    for item in Violation:
        found[item.name.lower()] = 10.0 + item
    assert as_columns(found).tolist() == [[10.0, 11.0, 12.0, 13.0]] * 2
    scored = np.zeros(1, OBJECTIVES)
    scored["kill_exposure"] = 3.0
    assert as_columns(scored)[0, Objective.KILL_EXPOSURE] == 3.0
    # A view: what is written to the one stands in the other.
    as_columns(scored)[0, Objective.HEIGHT_SUM] = 8.0
    assert scored["height_sum"][0] == 8.0


# ----------------------------------------------------------------------
# The clearance buffer grows from what a fixed end leaves of it.


def test_buffer_grows_from_a_low_start(
    make_limits: Callable[[Scenario], Limits], small: Callable[..., Scenario]
) -> None:
    low = small(start={"east_m": 0, "north_m": 0, "height_m": 31})
    data = make_problem(low, make_limits(low)).search
    assert 0.9 < data.start_buffer < 1.0
    path = np.array([[0, 0, low.start[2]], [1500, -1500, 200], [4200, -1500, 200], [6000, 0, 150]])
    assert not graded_scores(data, path[None])[0][0, Violation.TERRAIN]
    path[1, 2] = 30.0
    assert graded_scores(data, path[None])[0][0, Violation.TERRAIN] > 0


# ----------------------------------------------------------------------
# The share of climb and descent that turbulence leaves to a plan.

Make = Callable[[Scenario], Limits]
Small = Callable[..., Scenario]


@pytest.mark.parametrize(("turbulence", "count"), [("none", 0), ("light", 0), ("moderate", 1)])
def test_turbulence_leaves_a_share_of_climb_and_descent(
    make_limits: Make, small: Small, turbulence: str, count: int
) -> None:
    scenario = small(wind={"speed_mps": 0, "from_deg": 0, "turbulence": turbulence})
    limits = make_limits(scenario)
    data = make_problem(scenario, limits).search
    assert SLOPE_FRACTION_BY_TURBULENCE == {"none": 1.0, "light": 0.9, "moderate": 0.8}
    for way in (0, 1):
        # 0.87 of the aircraft's own angle, and half a degree in reserve: within 0.9 of it, and not within 0.8.
        steepest = limits.slopes(0.0, 200.0)[way]
        rise = math.tan(0.87 * steepest - ANGLE_MARGIN_RAD) * (1.0 if way == 0 else -1.0)
        path = np.array([[0.0, -2500.0, 200.0], [300.0, -2500.0, 200.0 + 300.0 * rise]])
        assert violations_of(data, path, Violation.SLOPE)[0] == count
        # Just within the share, and just beyond it.
        for beyond, more in ((-1e-4, 0), (1e-4, 1)):
            angle = SLOPE_FRACTION_BY_TURBULENCE[turbulence] * steepest - ANGLE_MARGIN_RAD + beyond
            path = np.array([[0.0, -2500.0, 200.0], [1.0, -2500.0, 200.0 + math.copysign(math.tan(angle), rise)]])
            assert violations_of(data, path, Violation.SLOPE)[0] == more


@pytest.mark.parametrize(
    ("turbulence", "asked", "shares"),
    [("none", (0.7, 0.6), (0.7, 0.6)), ("light", (0.95, 0.8), (0.9, 0.8)), ("light", (0.7, 1.0), (0.7, 0.9))],
)
def test_an_autopilot_leaves_a_share_of_climb_and_descent(
    make_limits: Make, small: Small, turbulence: str, asked: tuple[float, float], shares: tuple[float, float]
) -> None:
    """The smaller of its own and that of the turbulence, not their product."""
    scenario = small(wind={"speed_mps": 0, "from_deg": 0, "turbulence": turbulence})
    limits = make_limits(scenario)
    tables = {name: np.zeros((11, 4)) for name in ("acceptance", "excursion", "before", "after")}
    own = {"own_climb_share": asked[0], "own_sink_share": asked[1]}
    tracking = TrackingError(airspeed=25.0, **tables, across=0.0, up=0.0, lag=0.0, step=0.0, **own)
    made = make_problem(scenario, replace(limits, tracking=tracking)).certified.aircraft
    # At sea level true and equivalent airspeed are the same.
    assert (made.climb[0], made.descent[0]) == pytest.approx(
        tuple(share * angle for share, angle in zip(shares, limits.envelope.air_angles(25.0, 0.0), strict=True))
    )


@pytest.mark.parametrize(("most", "kept"), [(200.0, SEARCH_BUFFER_M), (60.0 + 2.0 * CERTIFIED_BUFFER_M + 8.0, 7.0)])
def test_a_search_leaves_half_of_a_narrow_band_to_the_path(
    make_limits: Make, small: Small, most: float, kept: float
) -> None:
    """Between the certificate's 5 m on either side are 8 m: a search keeps 2 m more on either."""
    flat = {"kind": "flat", "amsl_m": 0}
    ends = {
        name: {"east_m": east, "north_m": 0, "height_m": 69} for name, east in (("start", 0), ("destination", 6000))
    }
    scenario = small(terrain=flat, threats=[], limits={"min_clearance_m": 60, "max_height_m": most}, **ends)
    problem = make_problem(scenario, make_limits(scenario))
    assert problem.certified.airspace.buffer == problem.certified.buffer == CERTIFIED_BUFFER_M
    assert (problem.search.buffer, problem.search.airspace.buffer) == pytest.approx((kept, kept))


def test_what_is_kept_for_updrafts(make_limits: Make, small: Small) -> None:
    """30 m more below the maximum height and 1 m/s less sink; nothing else."""
    flat = {"kind": "flat", "amsl_m": 0}
    scenario = small(terrain=flat, limits={"min_clearance_m": 60, "max_height_m": 400})
    limits = make_limits(scenario)
    usual, kept = (
        make_problem(scenario, one) for one in (limits, replace(limits, reserve_above=30.0, reserve_sink=1.0))
    )
    assert kept.certified.airspace.buffer - usual.certified.airspace.buffer == pytest.approx(30.0)
    assert kept.search.airspace.buffer - usual.search.airspace.buffer == pytest.approx(30.0)
    assert (kept.certified.buffer, kept.search.buffer) == (usual.certified.buffer, usual.search.buffer)
    tables = usual.certified.aircraft, kept.certified.aircraft
    sinks = [float(table.airspeed * np.sin(table.descent[0])) for table in tables]
    assert sinks[0] - sinks[1] == pytest.approx(1.0)
    assert tables[0].climb.tolist() == tables[1].climb.tolist()


def test_what_is_kept_for_downdrafts(make_limits: Make, small: Small) -> None:
    """30 m more from the ground, 20 m from missiles, 1 m/s less climb; from a low end no faster than half the climb."""
    flat = {"kind": "flat", "amsl_m": 0}
    ends = {
        name: {"east_m": east, "north_m": 0, "height_m": 64} for name, east in (("start", 0), ("destination", 6000))
    }
    scenario = small(terrain=flat, limits={"min_clearance_m": 60, "max_height_m": 400}, **ends)
    limits = make_limits(scenario)
    usual, kept = (
        make_problem(scenario, one).certified
        for one in (limits, replace(limits, reserve_height=30.0, reserve_threats=20.0, reserve_climb=1.0))
    )
    assert (kept.buffer - usual.buffer, kept.kill_margin - usual.kill_margin) == pytest.approx((30.0, 20.0))
    assert kept.airspace.buffer == usual.airspace.buffer
    climbs = [float(table.airspeed * np.sin(table.climb[0])) for table in (usual.aircraft, kept.aircraft)]
    assert climbs[0] - climbs[1] == pytest.approx(1.0)
    assert kept.aircraft.descent.tolist() == usual.aircraft.descent.tolist()
    slow = make_problem(scenario, replace(limits, reserve_height=30.0, reserve_climb=climbs[0] - 0.5)).certified
    climb = float(np.interp(64.0, slow.aircraft.amsl, slow.aircraft.climb))
    assert slow.buffer_growth == pytest.approx(0.5 * math.tan(climb))
    assert usual.buffer_growth == kept.buffer_growth == 0.05
