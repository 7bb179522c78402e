"""Exposure along a track is the closed-form integral of the paper's law."""

import math

import numpy as np
import pytest

from logs.figures.exposure import draw_exposure, exposure_rates
from tests.logs.report.report_data import make_setup, make_track


def test_exposure_is_that_of_the_segments() -> None:
    # Past a unit at 100 m with scale 100: (100/d)^4 inside 300 m, integrated over s in closed form.
    position = np.column_stack([np.linspace(-500.0, 500.0, 401), np.full(401, 100.0), np.zeros(401)])
    rate = exposure_rates(position, np.zeros((1, 3)), np.array([300.0]), np.array([100.0]))
    far = math.sqrt(300.0**2 - 100.0**2)
    exact = 100.0**4 * (far / (1e4 * 300.0**2) + math.atan(far / 100.0) / 1e6)
    assert float(rate.sum() * 2.5) == pytest.approx(exact, rel=1e-9)
    assert float(rate.max()) == pytest.approx(1.0, rel=1e-3)


def test_only_what_the_flight_was_exposed_to_has_panels() -> None:
    """A radar 100 m from the start reaches the flight; the missile beside it ends 50 m short of it."""
    near = {"east_m": -900, "north_m": -500, "amsl_m": 300}
    radar = {**near, "name": "R", "detection_radius_m": 400, "detection_scale_m": 90}
    missile = {**near, "name": "M", "kill_radius_m": 50, "kill_scale_m": 20}
    figure = draw_exposure(make_setup(threats=[radar, missile]), make_track())
    assert figure is not None
    assert [axes.get_ylabel().split("\n")[0] for axes in figure.axes] == ["detection", "detection"]
    assert draw_exposure(make_setup(threats=[missile]), make_track()) is None
    assert draw_exposure(make_setup(threats=[]), make_track()) is None
