"""The profile's lines are the ground's, the plan's and the flight's heights."""

import numpy as np
import pytest

from logs.views.figures import draw_profile
from tests.logs.views.figure_data import ALL, ROUTE, make_scenario, make_track


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


def test_the_greatest_height_follows_the_ground_and_a_zone_takes_its_band() -> None:
    square = [[-300, -900], [300, -900], [300, 900], [-300, 900]]
    zone = {"name": "town", "kind": "exclusion", "polygon_m": square, "floor_agl_m": 400}
    limits = {"min_clearance_m": 10, "max_height_m": 350}
    figure = draw_profile(make_scenario(zones=[zone], limits=limits), **ALL, track=None, verdict=None)
    axes = figure.axes[0]
    most = next(line for line in axes.lines if line.get_label() == "greatest height, 350 m above ground")
    ground = next(line for line in axes.lines if line.get_color() == "#6b5a3a")
    np.testing.assert_allclose(most.get_ydata() - ground.get_ydata(), 350.0)
    assert "zone to keep out of" in {text.get_text() for text in figure.legends[0].get_texts()}
    assert axes.get_ylim()[1] >= most.get_ydata().max()
