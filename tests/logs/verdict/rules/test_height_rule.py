"""The greatest height above ground on each leg, and the ceiling, by plain sums on level and sloping ground."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.places import FLIGHT
from logs.verdict.rules.height_rule import greatest_heights
from tests.logs.verdict.judging import ROUTE, judge, leg, of, suggested
from tests.synthetic import edited, fly_path, make_setup
from world.terrain import Terrain, gridded


def limited(most: float, **how: Any) -> FlightSetup:
    """The route over level ground at the sea: 300 m high, 380 m at waypoint 2."""
    return make_setup(ROUTE, limits={"max_height_m": most}, **how)


def findings(setup: FlightSetup, track: Track | None = None) -> list[Finding]:
    verdict = judge_geometry(setup) if track is None else judge(setup, track)
    return [item for item in verdict.findings if item.rule == "height"]


def test_without_a_limit_there_is_nothing_to_say(setup: FlightSetup, track: Track) -> None:
    assert findings(setup) == findings(setup, track) == []


def test_each_leg_has_its_own_height() -> None:
    items = findings(limited(350.0))
    assert [item.place for item in items] == [leg(k) for k in range(4)]
    assert [item.ok for item in items] == [True, False, False, True]
    # The blends of the climbs beside them reach a little way into the level legs, and stay below the waypoint's top.
    assert [item.planned for item in items[::3]] == pytest.approx([300.0, 300.0], abs=1.5)
    assert items[1].planned == pytest.approx(380.0, abs=2.5)
    assert items[1].margin == pytest.approx(350.0 - (items[1].planned or 0.0))
    assert "350 m are allowed" in items[1].reason
    assert all(item.ok for item in findings(limited(381.0)))


def test_a_flight_is_judged_by_its_track() -> None:
    setup = limited(350.0)
    track = fly_path(setup)
    high = edited(track, position=track.position + np.array([0.0, 0.0, 60.0]))
    items = findings(setup, high)
    assert [item.ok for item in items] == [False] * 4
    assert items[0].flown == pytest.approx(360.0, abs=1.5)
    assert suggested(items[0], "descent", leg(0)).wanted == pytest.approx(12.0, abs=1.0)
    low = edited(track, position=track.position - np.array([0.0, 0.0, 60.0]))
    items = findings(setup, low)
    assert [item.ok for item in items] == [True] * 4
    assert "the planned path comes up to 3" in items[1].reason


def test_the_scenarios_ceiling_counts_on_each_leg() -> None:
    setup = limited(2000.0)
    setup = replace(setup, scenario=replace(setup.scenario, ceiling=340.0))
    items = findings(setup)
    assert [item.ok for item in items] == [True, False, False, True]
    assert "above the scenario's ceiling of 340 m" in items[1].reason


def test_no_terrain_no_height() -> None:
    setup = limited(350.0)
    (item,) = findings(replace(setup, scenario=replace(setup.scenario, terrain=None)))
    assert (item.ok, item.place, item.limit) == (None, FLIGHT, 350.0)


def test_a_leg_that_was_not_flown_is_not_judged() -> None:
    setup = limited(350.0)
    items = findings(setup, fly_path(setup, stop=1000.0))
    assert [item.ok for item in items] == [True, None, None, None]
    assert of(judge(setup, fly_path(setup, stop=1000.0)), "height", leg(3)).reason == "the leg was not flown"


def valley() -> Terrain:
    """Ground at 100 m with a trench of 40 m at north 500, 100 m to its sides."""
    axis = np.arange(-1000.0, 1001.0, 100.0)
    heights = np.full((21, 21), 100.0)
    heights[axis == 500.0] = 60.0
    return gridded(heights, axis, axis, source="", sha256="", datum="")


def test_the_height_over_a_valley_is_found_between_two_points() -> None:
    points = np.array([[0.0, 0.0, 200.0], [0.0, 900.0, 200.0], [0.0, 900.0, 260.0], [0.0, 5000.0, 260.0]])
    most, at = greatest_heights(valley(), points)
    assert most[:2] == pytest.approx([140.0, 160.0])
    assert at[0] == pytest.approx(500.0 / 900.0)
    assert np.isnan(most[2])
