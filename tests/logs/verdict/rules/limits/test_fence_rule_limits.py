"""A zone's edge: a path may be beyond it by what a waypoint is rounded by, and no more."""

from dataclasses import replace

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import judge, of
from tests.synthetic import edited, fly_path, make_setup
from world.airspace.zones import Cylinder, Zone, ZoneLevel, make_polygon

LINE = [[0.0, 0.0, 300.0], [0.0, 4000.0, 300.0]]


def with_zone(zone: Zone) -> FlightSetup:
    setup = make_setup(LINE)
    return replace(setup, scenario=replace(setup.scenario, zones=(zone,)))


# Rounded by up to 20 mm; depths are worked out to 10 mm.
@pytest.mark.parametrize(("deep", "ok"), [(0.009, True), (0.031, False)])
def test_how_far_a_path_may_be_inside(deep: float, ok: bool) -> None:
    beside = make_polygon([[(-deep, 500.0), (400.0, 500.0), (400.0, 1500.0), (-deep, 1500.0)]])
    above = ZoneLevel(300.0 + deep, "amsl")
    low = Zone("low", "exclusion", Cylinder(0.0, 2000.0, 500.0), None, above)
    for zone in (Zone("side", "exclusion", beside), low):
        assert of(judge_geometry(with_zone(zone)), "fence").ok is ok


@pytest.mark.parametrize(("aside", "ok"), [(0.009, True), (0.031, False)])
def test_how_far_a_flight_may_be_outside(aside: float, ok: bool) -> None:
    held = make_polygon([[(-900.0, -900.0), (5.0, -900.0), (5.0, 4900.0), (-900.0, 4900.0)]])
    setup = with_zone(Zone("held", "inclusion", held))
    track = fly_path(setup, rate=10.0)
    moved = edited(track, position=track.position + np.array([5.0 + aside, 0.0, 0.0]))
    assert of(judge(setup, moved), "fence").ok is ok
