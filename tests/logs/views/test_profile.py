"""The profile's lines are the ground's, the plan's and the flight's heights."""

import math

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.judge_geometry import judge_geometry
from logs.verdict.places import Place
from logs.verdict.verdict import Verdict
from logs.views.charts import Chart, Layer
from logs.views.figures import figure_views, make_subject
from logs.views.profile import profile_chart
from tests.flight.autopilots.arduplane.flown_grounds import circuit
from tests.logs.views.figure_data import ALL, ROUTE, drawn_profile, make_scenario, make_track, make_verdict
from tests.logs.views.report.report_data import EVIL
from tests.logs.views.report.report_data import make_setup as report_setup
from tests.logs.views.report.report_data import make_track as report_track
from world.airfield import LandingStrip, Launch


def test_profile_shows_ground_and_heights_along_the_route() -> None:
    scenario = make_scenario()
    track = make_track()
    axes = drawn_profile(scenario, **ALL, track=track, verdict=None).axes[0]
    plan, flown = (next(line for line in axes.lines if line.get_label() == label) for label in ("planned", "flown"))
    np.testing.assert_allclose(np.interp([0.0, 1.0, 1.8, 2.4], *plan.get_xydata().T), ROUTE[:, 2])
    # The track lies on the route, so both heights agree everywhere.
    np.testing.assert_allclose(
        flown.get_ydata(), np.interp(flown.get_xdata(), [0.0, 1.0, 1.8, 2.4], ROUTE[:, 2]), atol=1e-6
    )
    (terrain,) = [
        layer
        for layer in profile_chart(scenario, **ALL, track=None, verdict=None).panels[0].layers
        if layer.name == "terrain"
    ]
    # At (100, 0).
    assert np.interp(1.4, terrain.x, terrain.y) == pytest.approx(250.0 * np.exp(-(0.25**2) / 2), abs=0.3)


def test_a_leg_above_ground_is_drawn_above_the_ground() -> None:
    """The last leg begins wherever the route is, and comes to 90 m above ground evenly; the others are straight."""
    above = np.array([math.nan, math.nan, math.nan, 90.0])
    chart = profile_chart(make_scenario(), **ALL, track=None, verdict=None, above_ground=above)
    planned, terrain = (
        next(layer for layer in chart.panels[0].layers if layer.name == name) for name in ("planned", "terrain")
    )
    np.testing.assert_allclose(np.interp([0.0, 0.5, 1.0, 1.8], planned.x, planned.y)[[0, 2, 3]], ROUTE[:3, 2])
    over = planned.y - terrain.y
    begin = float(np.interp(1.8, planned.x, over))
    for share in (0.25, 0.5, 1.0):
        assert np.interp(1.8 + share * 0.6, planned.x, over) == pytest.approx(begin + share * (90.0 - begin), abs=0.5)


def test_the_flown_ends_of_a_flight_stand_on_the_ground() -> None:
    """Take-off to 60 m over level ground at 0 m; the landing's leg itself is level at 54 m."""
    setup = circuit(Launch("catapult", math.radians(90.0), 20.0), LandingStrip(500.0, 600.0))
    chart = figure_views(make_subject(setup, None, judge_geometry(setup)))["profile"]
    assert isinstance(chart, Chart)
    planned = next(layer for layer in chart.panels[0].layers if layer.name == "planned")
    # 1500 m ahead, 600 m aside, 400 m back, and 600 m to the landing point.
    heights = np.interp([0.0, 1.5, 2.1, 2.5, 2.8, 3.1], planned.x, planned.y)
    np.testing.assert_allclose(heights, [0.0, 80.0, 70.0, 54.0, 27.0, 0.0], atol=0.1)


def test_the_greatest_height_follows_the_ground_and_a_zone_takes_its_band() -> None:
    square = [[-300, -900], [300, -900], [300, 900], [-300, 900]]
    zone = {"name": "town", "kind": "exclusion", "polygon_m": square, "floor_agl_m": 400}
    limits = {"min_clearance_m": 10, "max_height_m": 350}
    scenario = make_scenario(zones=[zone], limits=limits)
    figure = drawn_profile(scenario, **ALL, track=None, verdict=None)
    axes = figure.axes[0]
    most = next(line for line in axes.lines if line.get_label() == "maximum height, 350 m above ground")
    (terrain,) = [
        layer
        for layer in profile_chart(scenario, **ALL, track=None, verdict=None).panels[0].layers
        if layer.name == "terrain"
    ]
    np.testing.assert_allclose(most.get_ydata() - terrain.y, 350.0)
    assert "zone to keep out of" in {text.get_text() for text in figure.legends[0].get_texts()}
    assert axes.get_ylim()[1] >= most.get_ydata().max()


# Over level ground, along a path that passes beside a missile.


def of(setup: FlightSetup, track: Track | None, verdict: Verdict | None = None) -> Chart:
    paths = {"plan_waypoints": None, "route_waypoints": setup.route.positions}
    return profile_chart(setup.scenario, **paths, track=track, verdict=verdict)


def layers(chart: Chart) -> dict[str, Layer]:
    return {layer.name: layer for layer in chart.panels[0].layers}


def test_heights_ground_and_clearance_are_those_of_plan_flight_and_terrain() -> None:
    setup = report_setup()
    chart = of(setup, report_track())
    found = layers(chart)
    # 1000, 800 and 600 m along; 300, 340, 380, 360 m high; level ground at 200 m.
    assert found["waypoint, numbered"].x == pytest.approx([0.0, 1.0, 1.8, 2.4])
    assert np.interp([0.5, 2.1], found["flown"].x, found["flown"].y) == pytest.approx([320.0, 370.0], abs=0.5)
    assert found["terrain"].y == pytest.approx(200.0)
    required = setup.scenario.limits.min_clearance_m
    (clearance,) = (layer for name, layer in found.items() if name.startswith("required clearance"))
    assert clearance.lower_edge == pytest.approx(200.0)
    assert clearance.y == pytest.approx(200.0 + required)
    assert [mark for _, mark in chart.marks] == ["leg 0", "leg 1", "leg 2"]


def test_a_sphere_is_cut_where_the_path_runs_through_its_column_of_air() -> None:
    found = layers(of(report_setup(), None))
    sphere = found[f"{EVIL[:40]} (missile)"]
    over = np.isfinite(sphere.y)
    # 250 m about (300, 0) on the ground at 200 m; the second leg goes north at 100 m east, 200 m beside it.
    assert sphere.x[over].min() == pytest.approx(1.4 - 0.15, abs=0.01)
    assert sphere.x[over].max() == pytest.approx(1.4 + 0.15, abs=0.01)
    assert np.nanmax(sphere.y) == pytest.approx(200.0 + 150.0, abs=1.0)
    assert sphere.legend == "missile's sphere over the path"


def test_what_fails_and_zones_are_marked() -> None:
    zone = {"name": "town", "kind": "exclusion", "east_m": 100, "north_m": 0, "radius_m": 200, "ceiling_amsl_m": 400}
    found = layers(of(report_setup(zones=[zone]), None, make_verdict(("slope", Place("leg", 2)))))
    assert found["leg that fails a rule"].x == pytest.approx([1.8, 2.4])
    (town,) = (layer for name, layer in found.items() if name.startswith("town"))
    inside = town.x[np.isfinite(town.y)]
    assert (inside.min(), inside.max()) == pytest.approx((1.2, 1.6), abs=0.01)
    assert np.nanmax(town.y) == pytest.approx(400.0)
