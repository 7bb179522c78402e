"""The least distance inside the area's box, planned and flown."""

from dataclasses import replace

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import judge, of
from tests.synthetic import edited, make_setup


def test_the_nearest_side_is_named(setup: FlightSetup, track: Track) -> None:
    # The floor lies 500 m below the ground, the area's edges 1500 m beyond the route.
    planned = of(judge_geometry(setup), "bounds")
    assert (planned.ok, planned.margin) == (True, 800.0)
    assert "inside the floor at " in planned.reason
    flown = of(judge(setup, edited(track, position=track.position + np.array([1600.0, 0.0, 0.0]))), "bounds")
    assert (flown.ok, flown.planned) == (False, 800.0)
    assert flown.margin == pytest.approx(-100.0, abs=1.0)
    assert "beyond the eastern edge at " in flown.reason


def test_the_ceiling_counts_at_the_waypoint_above_it() -> None:
    item = of(judge_geometry(make_setup([[0, 0, 4900], [0, 3000, 5040], [0, 6000, 4900]])), "bounds")
    assert (item.ok, item.margin) == (False, -40.0)
    assert item.reason == "40 m beyond the ceiling at waypoint 1 (item 1)"


def test_a_mission_without_a_scenario_has_no_area(setup: FlightSetup, track: Track) -> None:
    blind = replace(setup, scenario=replace(setup.scenario, external=True))
    assert of(judge(blind, track), "bounds").ok is None
