"""The profile's lines are the ground's, the plan's and the flight's heights."""

import numpy as np
import pytest

from logs.figures.draw_all import draw_profile
from tests.logs.figures.figure_data import ALL, ROUTE, make_scenario, make_track


def test_profile_shows_ground_and_heights_along_the_route() -> None:
    scenario = make_scenario()
    track = make_track()
    axes = draw_profile(scenario, **ALL, track=track, verdict=None).axes[0]
    plan, flown = (
        next(line for line in axes.lines if line.get_label() == label) for label in ("planned heights", "flown heights")
    )
    np.testing.assert_allclose(plan.get_xydata(), np.column_stack([[0.0, 1.0, 1.8, 2.4], ROUTE[:, 2]]))
    # The track lies on the route, so both heights agree everywhere.
    np.testing.assert_allclose(
        flown.get_ydata(), np.interp(flown.get_xdata(), [0.0, 1.0, 1.8, 2.4], ROUTE[:, 2]), atol=1e-6
    )
    ground = next(line for line in axes.lines if line.get_color() == "#6b5a3a")
    middle = np.argmin(np.abs(ground.get_xdata() - 1.4))  # at (100, 0): 250 exp(-100^2 / (2 400^2)) m
    assert ground.get_ydata()[middle] == pytest.approx(250.0 * np.exp(-(0.25**2) / 2), abs=0.3)
