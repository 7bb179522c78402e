"""Landings as flown: on the strip, off it, never down, and what is stated of the sink."""

import math
from dataclasses import replace

import numpy as np
import pytest

from logs.verdict.judge_flight import judge_flight
from tests.flight.autopilots.arduplane.flown_grounds import circuit, fly, fly_kept
from tests.logs.verdict.rules.flown_circuits import RAIL, STRIP, flown_circuit, found
from world.airfield import LandingStrip


def facts(flight: str) -> dict[str, float]:
    flown = fly_kept(flight)
    return {fact.what: fact.value for fact in found(flown.setup, flown.track, "touchdown").facts}


def test_where_it_touches_down_is_measured_along_and_across_the_landing() -> None:
    flown = flown_circuit()
    one = found(flown.setup, flown.track, "touchdown")
    known = {fact.what: fact.value for fact in one.facts}
    track = flown.track
    down = int(np.argmax((track.time > 60.0) & (track.clearance < track.clearance[-1] + 0.02)))
    # It lands to the west: the point is at 500 m east, 600 m north.
    assert known["along"] == pytest.approx(500.0 - track.position[down, 0], abs=0.1)
    assert known["aside"] == pytest.approx(track.position[down, 1] - 600.0, abs=0.1)
    assert known["strip left"] == pytest.approx(300.0 - (500.0 - track.position[-1, 0]), abs=0.1)
    assert one.ok is True
    assert "4.3 m/s of tail wind" in one.reason
    assert "by a flare that is not judged" in one.reason


def test_the_sink_towards_rising_ground_counts_its_slope() -> None:
    """The field of flight a rises by 5 to 8 % along its landing."""
    known = facts("a")
    over_ground = 19.0
    assert 0.05 < (known["sink towards the ground"] - known["sink"]) / over_ground < 0.08


def test_a_flight_that_ends_before_it_is_down_did_not_touch_down() -> None:
    flown = flown_circuit()
    cut = flown.track.rows(0, int(np.argmax(flown.track.time > flown.track.time[-1] - 20.0)))
    one = found(flown.setup, cut, "touchdown", "ground contact")
    assert one.ok is False
    assert one.brief == "the aircraft did not touch down"


def test_a_strip_without_a_take_off_is_landed_on_from_the_air() -> None:
    flown = fly(circuit(None, STRIP))
    verdict = judge_flight(flown.setup, flown.track, flown.flight.ended)
    rules = {item.rule: item.ok for item in verdict.findings}
    assert rules["touchdown"] is True
    assert "launch" not in rules
    assert flown.track.position[0, 2] == pytest.approx(60.0, abs=0.5)


def test_a_final_through_a_zone_fails() -> None:
    flown = flown_circuit()
    corners = [[700.0, 580.0], [740.0, 580.0], [740.0, 620.0], [700.0, 620.0]]
    zone = {"name": "town", "kind": "exclusion", "polygon_m": corners}
    setup = circuit(RAIL, STRIP, TKOFF_THR_MINACC=15.0, world={"zones": [zone]})
    one = found(setup, flown.track, "touchdown")
    assert one.ok is False
    assert "the final enters town" in one.reason


def test_a_strip_that_points_elsewhere_is_no_matter_the_course_is_the_leg_s() -> None:
    flown = flown_circuit()
    strip = LandingStrip(500.0, 600.0, course=math.radians(10.0), length=600.0)
    setup = flown.setup.in_scenario(replace(flown.setup.scenario, landing=strip))
    assert found(setup, flown.track, "touchdown").ok is True
