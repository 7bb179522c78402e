"""Angles, slopes, spheres and exposure against definitions computed another way."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from world.geometry import (
    MIN_RANGE_M,
    leg_courses,
    leg_runs,
    leg_slopes,
    path_length,
    segment_exposure,
    signed_turns,
    sphere_window,
    turning_angle,
    turning_angles,
    wrap,
)

METRES = st.floats(-20_000.0, 20_000.0).map(lambda x: round(x, 3))
POINT = st.tuples(METRES, METRES, METRES)


def _rotated(points: np.ndarray, angle: float) -> np.ndarray:
    cos, sin = math.cos(angle), math.sin(angle)
    return np.column_stack(
        [points[:, 0] * cos - points[:, 1] * sin, points[:, 0] * sin + points[:, 1] * cos, points[:, 2]]
    )


@pytest.mark.parametrize("course", np.linspace(0.0, math.tau, 17))
@pytest.mark.parametrize("turn_deg", [-179.0, -90.0, -45.0, 0.0, 1e-3, 30.0, 120.0, 180.0])
def test_turns_by_construction(course: float, turn_deg: float) -> None:
    after = course + math.radians(turn_deg)
    way = np.array([[0.0, 0.0, 5.0], [700 * math.sin(course), 700 * math.cos(course), 90.0], [0.0, 0.0, -40.0]])
    way[2, :2] = way[1, :2] + 300 * np.array([math.sin(after), math.cos(after)])
    assert turning_angles(way) == pytest.approx([abs(math.radians(turn_deg))], abs=1e-9)
    assert turning_angle(*way[0, :2], *way[1, :2], *way[2, :2]) == pytest.approx(abs(math.radians(turn_deg)), abs=1e-9)
    if abs(turn_deg) < 180.0:
        assert signed_turns(way) == pytest.approx([math.radians(turn_deg)], abs=1e-9)  # right is positive


@given(st.lists(POINT, min_size=2, max_size=2))
def test_an_exact_u_turn_is_pi_never_nan(ends: list[tuple[float, float, float]]) -> None:
    a, b = np.array(ends[0]), np.array(ends[1])
    way = np.array([a, b, a])
    wanted = math.pi if np.hypot(*(b - a)[:2]) > 0.0 else 0.0
    assert turning_angles(way)[0] == wanted
    assert signed_turns(way)[0] == wanted
    assert turning_angle(a[0], a[1], b[0], b[1], a[0], a[1]) == wanted


@given(st.lists(POINT, min_size=2, max_size=2), st.booleans())
def test_a_leg_without_length_counts_as_straight(ends: list[tuple[float, float, float]], first: bool) -> None:
    a, b = np.array(ends[0]), np.array(ends[1])
    above = a + np.array([0.0, 0.0, 7.0])
    way = np.array([a, above, b] if first else [b, a, above])
    assert turning_angles(way)[0] == 0.0
    assert signed_turns(way)[0] == 0.0
    assert turning_angle(*way[0, :2], *way[1, :2], *way[2, :2]) == 0.0


@given(st.lists(POINT, min_size=3, max_size=6), st.floats(-10.0, 10.0))
def test_angles_slopes_and_lengths_survive_rotation(points: list[tuple[float, float, float]], angle: float) -> None:
    way = np.array(points)
    if leg_runs(way).min() < 1.0:
        return
    turned = _rotated(way, angle)
    assert turning_angles(turned) == pytest.approx(turning_angles(way), abs=1e-7)
    assert leg_slopes(turned) == pytest.approx(leg_slopes(way), abs=1e-9)
    assert path_length(turned) == pytest.approx(path_length(way), rel=1e-12)
    # A turn to the left of the map's axes is a turn of all courses; its mirror image turns the other way.
    shift = [math.remainder(x + angle, math.tau) for x in leg_courses(turned) - leg_courses(way)]
    assert shift == pytest.approx([0.0] * len(shift), abs=1e-7)
    straight = np.abs(turning_angles(way)) > math.pi - 1e-6
    assert signed_turns(way * [-1, 1, 1])[~straight] == pytest.approx(-signed_turns(way)[~straight], abs=1e-9)


def test_many_paths_at_once_equal_one_by_one() -> None:
    ways = np.random.default_rng(3).normal(size=(4, 5, 7, 3)) * 1000
    for function in (turning_angles, signed_turns, leg_courses, leg_runs, leg_slopes, path_length):
        together = function(ways)
        assert together[2, 3] == pytest.approx(function(ways[2, 3]), abs=0.0)


def test_slopes_and_lengths_by_hand() -> None:
    way = np.array([[0.0, 0.0, 0.0], [300.0, 400.0, 500.0], [300.0, 400.0, 100.0]])
    assert leg_slopes(way) == pytest.approx([math.pi / 4, -math.pi / 2])
    assert float(path_length(way)) == pytest.approx(500 * math.sqrt(2) + 400)
    assert leg_courses(way)[0] == pytest.approx(math.atan2(3, 4))


@given(st.floats(-1000.0, 1000.0))
def test_wrap(angle: float) -> None:
    assert -math.pi - 1e-12 <= wrap(angle) <= math.pi + 1e-12
    assert math.cos(wrap(angle)) == pytest.approx(math.cos(angle), abs=1e-12)
    assert math.sin(wrap(angle)) == pytest.approx(math.sin(angle), abs=1e-12)


@given(POINT, POINT, POINT, st.floats(1.0, 20_000.0))
def test_sphere_window_against_dense_sampling(
    a: tuple[float, float, float], b: tuple[float, float, float], centre: tuple[float, float, float], radius: float
) -> None:
    start, end, mid = np.array(a), np.array(b), np.array(centre)
    near, enter, leave = sphere_window(start, end, mid, radius)
    fraction = np.linspace(0.0, 1.0, 4001)
    away = np.linalg.norm(start + fraction[:, None] * (end - start) - mid, axis=1)
    step = np.linalg.norm(end - start) / 4000
    assert near <= away.min() + 1e-6
    assert near >= away.min() - step
    inside = away <= radius
    assert 0.0 <= enter <= leave <= 1.0
    if step > 0.0:
        assert leave - enter == pytest.approx(inside.mean(), abs=2.5 / 4000)
        for share in (enter, leave):
            if 1e-3 < share < 1.0 - 1e-3:
                assert np.linalg.norm(start + share * (end - start) - mid) == pytest.approx(radius, rel=1e-5, abs=1e-3)


def test_sphere_window_edges() -> None:
    a, b, centre = np.array([-100.0, 50.0, 0.0]), np.array([100.0, 50.0, 0.0]), np.zeros(3)
    assert sphere_window(a, b, centre, 50.0) == (50.0, 0.5, 0.5)  # touching counts as inside, for no length
    assert sphere_window(a, b, centre, 49.999)[1:] == (0.0, 0.0)
    assert sphere_window(a, b, centre, 1e4)[1:] == (0.0, 1.0)
    assert sphere_window(a, a, centre, 200.0) == (pytest.approx(math.hypot(100, 50)), 0.0, 1.0)
    assert sphere_window(a, a, centre, 20.0)[1:] == (0.0, 0.0)


def _brute(a: np.ndarray, b: np.ndarray, centre: np.ndarray, radius: float, scale: float) -> tuple[float, float]:
    """Share inside and mean (scale/d)^4, by the midpoint rule on 200,000 pieces."""
    fraction = (np.arange(200_000) + 0.5) / 200_000
    away = np.linalg.norm(a + fraction[:, None] * (b - a) - centre, axis=1)
    inside = away <= radius
    return float(inside.mean()), float(np.where(inside, (scale / np.maximum(away, MIN_RANGE_M)) ** 4, 0.0).mean())


@pytest.mark.parametrize("seed", range(12))
def test_exposure_against_brute_force(seed: int) -> None:
    random = np.random.default_rng(seed)
    centre = random.normal(size=3) * 1000
    a, b = centre + random.normal(size=3) * 1500, centre + random.normal(size=3) * 1500
    share, mean = segment_exposure(a, b, centre, 2000.0, 400.0)
    wanted = _brute(a, b, centre, 2000.0, 400.0)
    assert share == pytest.approx(wanted[0], abs=2e-5)
    assert mean == pytest.approx(wanted[1], rel=2e-4, abs=1e-9)


@pytest.mark.parametrize("away", [2_000.0, 20_000.0, 100_000.0])
@pytest.mark.parametrize("length", [0.4, 25.0, 1000.0])
@pytest.mark.parametrize("aside", [0.0, 0.5, 3.0, 500.0])
def test_short_segments_far_away_keep_their_digits(away: float, length: float, aside: float) -> None:
    # A flown track is made of segments of 0.4 m: Gauss-Legendre quadrature knows no cancellation.
    unit = np.array([0.6, -0.64, 0.48])
    square = np.cross(unit, [0.0, 0.0, 1.0])
    a = away * unit + aside * square / np.linalg.norm(square)
    b = a + length * unit
    node, weight = np.polynomial.legendre.leggauss(24)
    place = a + 0.5 * (node[:, None] + 1.0) * (b - a)
    wanted = float((0.5 * weight / (place**2).sum(axis=1) ** 2).sum())
    got = segment_exposure(a, b, np.zeros(3), 3 * away, 1.0)
    assert got[0] == 1.0
    assert got[1] == pytest.approx(wanted, rel=2e-6)


def test_exposure_does_not_depend_on_the_sampling() -> None:
    # A flown turn past a missile: 3 m sampling against 0.4 m changes dose and time inside by far less than 1 %.
    angle = np.linspace(0.0, 4.0, 4001)
    track = np.column_stack([600 * np.sin(angle), 600 * np.cos(angle), 100 + 20 * angle])
    centre = np.array([250.0, 300.0, 60.0])

    def dose(points: np.ndarray) -> np.ndarray:
        rows = [segment_exposure(p, q, centre, 500.0, 200.0) for p, q in itertools.pairwise(points)]
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        return (np.array(rows) * lengths[:, None]).sum(axis=0)

    full = dose(track)
    for every in (2, 4, 8):
        assert dose(track[::every]) == pytest.approx(full, rel=0.001 * every / 2)
    # Cutting a straight segment changes nothing at all.
    ends = np.array([[-900.0, 40.0, 0.0], [1100.0, 90.0, 30.0]])
    pieces = ends[0] + np.linspace(0.0, 1.0, 978)[:, None] * (ends[1] - ends[0])
    assert dose(pieces) == pytest.approx(dose(ends), rel=1e-9)


def test_exposure_nearer_than_a_metre_stays_finite() -> None:
    a, b = np.array([-50.0, 0.0, 0.0]), np.array([50.0, 0.0, 0.0])
    share, mean = segment_exposure(a, b, np.zeros(3), 100.0, 1.0)
    assert share == 1.0
    assert 0.0 < mean <= 1.0 / MIN_RANGE_M**4
    assert segment_exposure(a, a, a, 100.0, 2.0) == (1.0, pytest.approx(16.0))
    assert segment_exposure(a, b, np.zeros(3) + 500.0, 100.0, 2.0) == (0.0, 0.0)
