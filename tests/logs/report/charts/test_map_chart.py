"""The map's own data: reach at the path's height, what is shown, and what the plan was where the route differs."""

from dataclasses import replace

import numpy as np
import pytest

from logs.figures.elements.failures import Failures
from logs.report.charts.map_chart import map_chart
from logs.verdict.places import Place
from tests.logs.made_flight import make_setup as made_setup
from tests.logs.report.report_data import make_setup, make_track

SETUP, TRACK = make_setup(), make_track()


def test_the_map_reaches_as_far_as_area_and_flights_with_a_rim() -> None:
    position = TRACK.position.copy()
    position[5, 0] = 2000.0
    found = map_chart(SETUP, [TRACK, replace(TRACK, position=position)], Failures({}, {}))
    rim = 0.015 * 3200.0
    assert found["shown"] == [[-1200.0 - rim, 2000.0 + rim], [-800.0 - rim, 800.0 + rim]]
    assert found["area"] == [[-1200.0, 1200.0], [-800.0, 800.0]]
    assert (found["start"], found["destination"]) == ([-900.0, -400.0], [700.0, 400.0])


def test_a_missiles_reach_is_its_spheres_cut_at_the_height_of_the_path() -> None:
    (reach,) = map_chart(SETUP, [], Failures({}, {}))["reach"]
    # 250 m about the ground at 200 m; the path passes 160 m above it, at about 360 m.
    assert reach == pytest.approx(np.sqrt(250.0**2 - 160.0**2), abs=3.0)


def test_entered_threats_and_a_route_without_a_plan_are_told() -> None:
    entered = Failures({}, {}, threats=(Place("missile", 0, name="x"),))
    found = map_chart(SETUP, [TRACK], entered)
    assert found["entered"] == [0]
    assert (found["searched"], found["routeName"]) == (None, "route of the mission")


def test_a_plan_is_told_from_a_route_that_differs_by_over_a_metre() -> None:
    setup = made_setup()
    assert setup.plan is not None
    same = replace(setup, route=replace(setup.route, waypoints=setup.plan.waypoints))
    assert map_chart(same, [], Failures({}, {}))["routeName"] == "planned path"
    moved = replace(setup.plan, waypoints=setup.route.waypoints + np.array([0.0, 2.0, 0.0]))
    found = map_chart(replace(setup, plan=moved), [], Failures({}, {}))
    assert found["routeName"] == "route of the mission"
    assert found["searched"] == np.round(moved.waypoints[:, :2], 1).tolist()
