"""Projection on the path, its curvature over a window, and its height profile."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight.guidance.fly_by_path import arc_point
from flight.guidance.path_kernels import NODE, PIECE, Records, mean_curvature, profile, project


def _pieces(course: float, *curvatures: float) -> Records:
    """Pieces of 300 m, one after the other; all of them begin at one point, which curvature does not ask for."""
    rows = [(300.0 * k, 300.0, 120.0, -80.0, course, curvature, 0, math.inf) for k, curvature in enumerate(curvatures)]
    return np.array(rows, PIECE)


@given(
    st.floats(-7.0, 7.0),
    st.floats(-2.0, 4.5),
    st.floats(-90.0, 90.0),
    st.floats(100.0, 5000.0),
    st.sampled_from([-1, 0, 1]),
)
def test_projection_undoes_the_construction(
    course: float, share: float, aside: float, radius: float, side: int
) -> None:
    # A point `aside` to the right of that `along` on the piece; arcs up to 258 degrees, and a little before.
    piece = _pieces(course, side / radius)[0]
    along = share * radius if share > 0.0 else share * 0.5 * radius
    east, north = arc_point(piece, along)
    here = course + piece.curvature * along
    got = project(piece, east + aside * math.cos(here), north - aside * math.sin(here))
    assert got[0] == pytest.approx(along, abs=1e-6 * radius)
    assert got[1] == pytest.approx(aside, abs=1e-6)
    assert math.remainder(got[2] - here, math.tau) == pytest.approx(0.0, abs=1e-6)


def test_mean_curvature_of_a_window() -> None:
    pieces = _pieces(0.0, 0.0, 0.01, 0.0)
    for start, end, wanted in ((0.0, 100.0, 0.0), (250.0, 350.0, 0.005), (400.0, 500.0, 0.01), (550.0, 950.0, 0.00125)):
        assert mean_curvature(pieces, 0, start, end) == pytest.approx(wanted)
    assert mean_curvature(pieces, 2, 5000.0, 5100.0) == 0.0  # beyond the end


def test_profile_by_hand() -> None:
    # Level at 500 m, from 1000 m on with a slope of 0.1, its parabola 100 m to either side.
    nodes = np.array([(0.0, 500.0, 0.0, 0.0), (1000.0, 500.0, 0.1, 100.0), (2000.0, 600.0, 0.1, 0.0)], NODE)
    for s, wanted in (
        (-50.0, (500.0, 0.0, 0.0)),
        (899.0, (500.0, 0.0, 0.0)),
        (1000.0, (500.0 + 0.5 * 5e-4 * 100**2, 0.05, 5e-4)),
        (1101.0, (510.1, 0.1, 0.0)),
        (2500.0, (650.0, 0.1, 0.0)),
    ):
        assert profile(nodes, s) == pytest.approx(wanted, abs=1e-9)
