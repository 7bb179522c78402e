"""Exposure along a track is the closed-form integral of the paper's law."""

import math

import numpy as np
import pytest

from logs.figures.exposure import exposure_rates


def test_exposure_is_that_of_the_segments() -> None:
    # Past a unit at 100 m with scale 100: (100/d)^4 inside 300 m, integrated over s in closed form.
    position = np.column_stack([np.linspace(-500.0, 500.0, 401), np.full(401, 100.0), np.zeros(401)])
    rate = exposure_rates(position, np.zeros((1, 3)), np.array([300.0]), np.array([100.0]))
    far = math.sqrt(300.0**2 - 100.0**2)
    exact = 100.0**4 * (far / (1e4 * 300.0**2) + math.atan(far / 100.0) / 1e6)
    assert float(rate.sum() * 2.5) == pytest.approx(exact, rel=1e-9)
    assert float(rate.max()) == pytest.approx(1.0, rel=1e-3)
