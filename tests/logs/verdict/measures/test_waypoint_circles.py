"""Waypoints at which PX4 circled because of its altitude, and the findings that name them."""

import re
from dataclasses import replace

import pytest

from aircraft.catalog import load_aircraft
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, fly_to_end
from flight.simulation.track import Track
from logs.verdict.judge_flight import judge_flight
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import align_track
from logs.verdict.measures.waypoint_circles import waypoint_circles
from tests.mission_lines import setup_of, wp


def flown(**values: float) -> tuple[FlightSetup, Track]:
    """250 m down on the first of two legs of 1 km and 2 km, by PX4's law."""
    aircraft = load_aircraft("aerosonde")
    law = Px4(Px4Parameters.load(aircraft).changed(**values))
    setup = replace(setup_of(wp(0, 0, 350), wp(0, 1000, 100), wp(0, 3000, 100)), autopilot=law)
    return setup, fly_to_end(Flight(setup, aircraft)).track


def test_a_circle_at_a_waypoint_is_named_with_its_height_error_and_its_parameter() -> None:
    """250 m down at 2 m/s: at 25 m/s some 75 m are done where the circle begins, 56 m before the waypoint."""
    setup, track = flown()
    findings = judge_flight(setup, track, "completed").findings
    (item,) = [one for one in findings if one.rule == "slope" and one.ok is False]
    found = re.search(
        r"; PX4 circled at waypoint 1 \(item 2\) \(height error \+(\d+) m\): NAV_FW_ALT_RAD allows 10 m", item.reason
    )
    assert found is not None
    assert int(found[1]) == pytest.approx(175.0, abs=12.0)
    # What passes needs no explanation.
    assert {one.ok for one in findings if "circled at" in one.reason} == {False}


@pytest.mark.parametrize(("tolerance", "count"), [(10.0, 1), (200.0, 0)])
def test_within_the_tolerance_it_flies_on(tolerance: float, count: int) -> None:
    setup, track = flown(NAV_FW_ALT_RAD=tolerance)
    requirements = route_requirements(setup)
    aligned = align_track(requirements, track)
    assert aligned is not None
    assert len(waypoint_circles(requirements, aligned)) == count
