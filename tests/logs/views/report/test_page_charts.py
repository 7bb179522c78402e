"""The profile's chart has ground, clearance, spheres, zones and heights in the plane of the path."""

import json
from dataclasses import replace

import numpy as np
import pytest

from logs.views.failures import Failures
from logs.views.report.charts import Chart, Layer
from logs.views.report.page_charts import profile_chart, report_charts, report_flight
from tests.logs.views.report.report_data import EVIL, VERDICT, make_setup, make_track

NOTHING = Failures({}, {})


def layers(chart: Chart) -> dict[str, Layer]:
    return {layer.name: layer for layer in chart.panels[0].layers}


def test_heights_ground_and_clearance_are_those_of_plan_flight_and_terrain() -> None:
    setup = make_setup()
    chart = profile_chart(setup, make_track(), NOTHING)
    found = layers(chart)
    # 1000, 800 and 600 m along; 300, 340, 380, 360 m high; level ground at 200 m.
    assert found["waypoints"].x == pytest.approx([0.0, 1.0, 1.8, 2.4])
    assert np.interp([0.5, 2.1], found["flown"].x, found["flown"].y) == pytest.approx([320.0, 370.0], abs=0.5)
    assert found["terrain"].y == pytest.approx(200.0)
    required = setup.scenario.limits.min_clearance_m
    (clearance,) = (layer for name, layer in found.items() if name.startswith("required clearance"))
    assert clearance.low == pytest.approx(200.0)
    assert clearance.y == pytest.approx(200.0 + required)
    assert [mark for _, mark in chart.marks] == ["leg 0", "leg 1", "leg 2"]


def test_a_sphere_is_cut_where_the_path_runs_through_its_column_of_air() -> None:
    found = layers(profile_chart(make_setup(), None, NOTHING))
    sphere = found[f"{EVIL[:40]} (missile)"]
    over = np.isfinite(sphere.y)
    # 250 m about (300, 0) on the ground at 200 m; the second leg goes north at 100 m east, 200 m beside it.
    assert sphere.x[over].min() == pytest.approx(1.4 - 0.15, abs=0.01)
    assert sphere.x[over].max() == pytest.approx(1.4 + 0.15, abs=0.01)
    assert np.nanmax(sphere.y) == pytest.approx(200.0 + 150.0, abs=1.0)
    assert sphere.legend == "missile's sphere over the path"


def test_what_fails_and_zones_are_marked() -> None:
    zone = {"name": "town", "kind": "exclusion", "east_m": 100, "north_m": 0, "radius_m": 200, "ceiling_amsl_m": 400}
    found = layers(profile_chart(make_setup(zones=[zone]), None, Failures({2: ("slope",)}, {})))
    assert found["leg that fails"].x == pytest.approx([1.8, 2.4])
    (town,) = (layer for name, layer in found.items() if name.startswith("town"))
    inside = town.x[np.isfinite(town.y)]
    assert (inside.min(), inside.max()) == pytest.approx((1.2, 1.6), abs=0.01)
    assert np.nanmax(town.y) == pytest.approx(400.0)


# ----------------------------------------------------------------------
# A page has a chart for each picture but the 3-D view, and a flight only where one was flown.

SETUP, TRACK = make_setup(), make_track()


def test_there_is_a_chart_for_every_picture_with_data() -> None:
    charts = report_charts(SETUP, TRACK, VERDICT, Failures({}, {}))
    # The flight is exposed to nothing.
    assert set(charts) == {"map", "profile", "turns", "envelope", "time", "controls", "energy"}
    json.dumps(charts, allow_nan=False)
    assert set(report_charts(SETUP, None, VERDICT, Failures({}, {}))) == {"map", "profile", "turns", "envelope"}


def test_a_flight_without_a_known_place_is_none_to_show() -> None:
    assert len(report_flight(SETUP, TRACK)["flights"]) == 1
    assert report_flight(SETUP, None)["flights"] == []
    lost = replace(TRACK, position=np.full_like(TRACK.position, np.nan))
    assert report_flight(SETUP, lost)["flights"] == []
