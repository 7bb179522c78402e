"""How near to a sphere's centre a path's segments are still taken one by one."""

import math

import numpy as np
import pytest

from logs.verdict.measures.path_sweeps import path_spheres, sphere_stays


@pytest.mark.parametrize("away", [400.0, 8000.0])
def test_exposure_on_circles_is_the_circles_own_to_a_thousandth(away: float) -> None:
    """Four circles of 60 m, 64 segments each, inside one sphere; sixteen segments as one would be squares.

    Of the circle itself (scale / d)^4 is averaged over 10,000 points.
    """
    angle = 2.0 * math.pi * np.arange(257) / 64.0
    points = np.stack([away + 60.0 * np.cos(angle), 60.0 * np.sin(angle), 0.0 * angle], axis=1)
    visits = path_spheres(points, np.arange(257.0), np.zeros((1, 3)), np.array([2.0 * away]), np.array([away]))
    around = 2.0 * math.pi * np.arange(10_000) / 10_000
    squared = (away + 60.0 * np.cos(around)) ** 2 + (60.0 * np.sin(around)) ** 2
    assert visits.time_inside[0] == pytest.approx(256.0)
    assert visits.exposure[0] == pytest.approx(256.0 * float((away**4 / squared**2).mean()), rel=1e-3)


# ----------------------------------------------------------------------
# Two stays in a sphere that touch are one.


@pytest.mark.parametrize(("gap", "stays"), [(3e-7, 1), (3e-5, 2)])
def test_stays_a_microsecond_apart_are_one(gap: float, stays: int) -> None:
    """Out of a sphere of 100 m at 100 m/s, and back in after so many seconds."""
    beyond = 100.0 * gap / 2.0
    time = np.array([0.0, 1.0 + gap / 2.0, 2.0 + gap])
    position = np.array([[0.0, 0.0, 0.0], [100.0 + beyond, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert len(sphere_stays(time, position, np.zeros(3), 100.0)) == stays
