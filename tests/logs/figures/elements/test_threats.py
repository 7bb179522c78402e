"""Sphere cuts lie on the sphere."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from logs.figures.elements.threats import outline_anchor, sphere_cuts


@given(
    st.lists(st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4)), min_size=1, max_size=20),
    st.floats(1.0, 5e3),
    st.floats(-100.0, 900.0),
)
def test_cuts_lie_on_the_sphere(points_below: list[tuple[float, float]], radius: float, up: float) -> None:
    centre = np.array([120.0, -40.0, up])
    points = np.array([[east, north, 0.0] for east, north in points_below])
    lower, upper = sphere_cuts(centre, radius, points)
    for (east, north), low, high in zip(points_below, lower, upper, strict=True):
        beside = np.hypot(east - 120.0, north + 40.0)
        assert np.isnan(low) == np.isnan(high) == (beside**2 > radius**2) or beside == pytest.approx(radius)
        if not np.isnan(high):
            assert np.hypot(beside, high - up) == pytest.approx(radius, rel=1e-9)
            assert low + high == pytest.approx(2 * up, abs=1e-6)


def test_a_name_touches_the_top_the_foot_or_the_left_edge_that_is_in_the_picture() -> None:
    """A sphere of 300 m at 500 m, cut through its middle from 1 km to 1.6 km."""
    kilometres = np.linspace(0.0, 3.0, 3001)
    points = np.column_stack([1000.0 * kilometres, np.zeros(3001), np.zeros(3001)])
    cut = kilometres, *sphere_cuts(np.array([1300.0, 0.0, 500.0]), 300.0, points)

    def anchor(low: float, high: float) -> tuple[float, float, tuple[int, int]] | None:
        return outline_anchor(*cut, np.full(3001, low), high)

    assert anchor(0.0, 1000.0) == (pytest.approx(1.3), pytest.approx(800.0), (0, 1))
    assert anchor(0.0, 700.0) == (pytest.approx(1.3), pytest.approx(200.0), (0, -1))
    # 4 % below the upper rim, on the left flank: of the upper half at 596 m, of the lower one at 396 m.
    for low, high, up in ((300.0, 600.0, 588.0), (300.0, 400.0, 396.0)):
        (east, amsl, side) = anchor(low, high) or (0.0, 0.0, (0, 0))
        assert (amsl, side) == (pytest.approx(up, abs=6.0), (1, 0))
        assert np.hypot(1000.0 * east - 1300.0, amsl - 500.0) == pytest.approx(300.0)
        assert east < 1.3
    assert anchor(900.0, 1000.0) is None
    assert anchor(450.0, 460.0) is not None


def test_no_name_stands_under_the_ground() -> None:
    """The sphere reaches out of the picture above, and its foot, at 200 m, is under a hill of 250 m."""
    kilometres = np.linspace(0.0, 3.0, 3001)
    points = np.column_stack([1000.0 * kilometres, np.zeros(3001), np.zeros(3001)])
    cut = kilometres, *sphere_cuts(np.array([1300.0, 0.0, 500.0]), 300.0, points)
    ground = np.where(np.abs(kilometres - 1.3) < 0.2, 250.0, 0.0)
    (_, amsl, side) = outline_anchor(*cut, ground, 700.0) or (0.0, 0.0, (0, 0))
    assert (amsl, side) == (pytest.approx(672.0, abs=6.0), (1, 0))
    assert outline_anchor(*cut, 0.0 * ground, 700.0) == (pytest.approx(1.3), pytest.approx(200.0), (0, -1))
