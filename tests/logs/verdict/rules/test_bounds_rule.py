"""The least distance inside the area's box, planned and flown."""

from dataclasses import replace

import numpy as np
import pytest

from flight.simulation.flight_setup import FlightSetup
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


@pytest.mark.parametrize(("beyond", "ok"), [(0.015, True), (0.025, False), (0.1, False)])
@pytest.mark.parametrize(
    "side", [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)]
)
def test_each_side_counts_to_the_centimetre_of_a_mission_file(
    setup: FlightSetup, track: Track, side: tuple[float, float, float], beyond: float, ok: bool
) -> None:
    """The track's farthest row put this far beyond the edge."""
    (west, east), (south, north) = setup.scenario.bounds
    room = {
        (1.0, 0.0, 0.0): east - track.position[:, 0].max(),
        (-1.0, 0.0, 0.0): track.position[:, 0].min() - west,
        (0.0, 1.0, 0.0): north - track.position[:, 1].max(),
        (0.0, -1.0, 0.0): track.position[:, 1].min() - south,
        (0.0, 0.0, 1.0): setup.scenario.ceiling - track.position[:, 2].max(),
    }[side]
    moved = track.position + (float(room) + beyond) * np.array(side)
    item = of(judge(setup, edited(track, position=moved)), "bounds")
    assert (item.ok, item.margin) == (ok, pytest.approx(-beyond, abs=1e-6))
