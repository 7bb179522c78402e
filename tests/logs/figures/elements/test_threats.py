"""Sphere cuts lie on the sphere."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from logs.figures.elements.threats import sphere_cuts


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
