"""Landings as flown: on the strip, off it, never down, and what is stated of the sink."""

import math
from dataclasses import replace

import numpy as np
import pytest

from logs.verdict.judge_flight import judge_flight
from tests.flight.autopilots.arduplane.flown_grounds import circuit, fly, fly_kept
from tests.logs.verdict.rules.flown_circuits import RAIL, STRIP, flown_circuit, found, with_hole
from world.airfield import LandingStrip


def facts(flight: str) -> dict[str, float]:
    flown = fly_kept(flight)
    return {fact.what: fact.value for fact in found(flown.setup, flown.track, "touchdown").facts}


def test_where_it_touches_down_is_measured_along_and_across_the_landing() -> None:
    flown = flown_circuit()
    one = found(flown.setup, flown.track, "touchdown")
    assert (one.place.kind, one.place.item) == ("waypoint", flown.setup.mission.items[-1].seq)
    known = {fact.what: fact.value for fact in one.facts}
    track, terrain = flown.track, flown.setup.scenario.terrain
    assert terrain is not None
    # The track's own clearance is rounded to 1 mm, which is a row more or less where it sinks 4 mm in a row.
    heights = track.position[:, 2] - terrain.height(track.position[:, 0], track.position[:, 1])
    down = int(np.argmax((track.time > 60.0) & (heights < heights[-1] + 0.02)))
    assert heights[down] == pytest.approx(track.clearance[down], abs=0.002)
    # It lands to the west: the point is at 500 m east, 600 m north.
    assert known["along"] == pytest.approx(500.0 - track.position[down, 0], abs=0.1)
    assert known["aside"] == pytest.approx(track.position[down, 1] - 600.0, abs=0.1)
    assert known["strip left"] == pytest.approx(300.0 - (500.0 - track.position[-1, 0]), abs=0.1)
    assert one.ok is True
    assert "4.3 m/s of tailwind" in one.reason
    assert "the flare itself is not judged" in one.reason


def test_the_sink_towards_rising_ground_counts_its_slope() -> None:
    """The field of flight a rises by 5 to 8 % along its landing."""
    known = facts("a")
    heights_over_ground = 19.0
    assert 0.05 < (known["sink towards the ground"] - known["sink"]) / heights_over_ground < 0.08


def test_a_flight_that_ends_before_it_is_down_did_not_touch_down() -> None:
    flown = flown_circuit()
    cut = flown.track.rows(0, int(np.argmax(flown.track.time > flown.track.time[-1] - 20.0)))
    one = found(flown.setup, cut, "touchdown", "ground contact")
    assert one.ok is False
    assert one.brief == "the aircraft did not touch down"
    # The landing point is at 500 m east, 600 m north.
    distance = math.hypot(cut.position[-1, 0] - 500.0, cut.position[-1, 1] - 600.0)
    assert one.reason.endswith(f": the flight ended {distance:.0f} m from it")


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
    assert "the final approach enters town" in one.reason


@pytest.mark.parametrize(("course", "ok"), [(270.0, True), (90.0, True), (0.0, False), (180.0, False)])
def test_a_strip_lies_along_its_stated_course_and_may_be_landed_on_either_way(course: float, ok: bool) -> None:
    """The circuit lands to the west, and slides tens of metres: across a strip of 40 m that is beside it."""
    flown = flown_circuit()
    strip = LandingStrip(500.0, 600.0, course=math.radians(course), length=600.0)
    one = found(flown.setup.in_scenario(replace(flown.setup.scenario, landing=strip)), flown.track, "touchdown")
    assert one.ok is ok, one.reason
    if course == 90.0:
        known = {fact.what: fact.value for fact in one.facts}
        assert known["strip left"] == pytest.approx(300.0 - (500.0 - flown.track.position[-1, 0]), abs=0.1)


@pytest.mark.parametrize(
    ("east", "north", "fault"),
    [(-500.0, 600.0, "before the strip's"), (500.0, 560.0, "touches down 39 m to the side of the strip's center line")],
)
def test_a_mission_that_lands_beside_the_strip_fails(east: float, north: float, fault: str) -> None:
    """What the scenario says can be landed on is where it says, wherever the landing item is."""
    flown = flown_circuit()
    strip = LandingStrip(east, north, length=600.0)
    one = found(flown.setup.in_scenario(replace(flown.setup.scenario, landing=strip)), flown.track, "touchdown")
    assert one.ok is False
    assert fault in one.brief


def test_an_overrun_states_its_length_and_the_other_end_against_the_wind() -> None:
    """The strip of 600 m is shortened to end 20 m before the stop, as seen from its center at 500 m east."""
    flown = flown_circuit()
    overrun = 500.0 - float(flown.track.position[-1, 0])
    strip = LandingStrip(500.0, 600.0, length=2.0 * (overrun - 20.0))
    one = found(flown.setup.in_scenario(replace(flown.setup.scenario, landing=strip)), flown.track, "touchdown")
    assert "; overruns the strip by 20 m; " in one.reason
    assert "of the strip left" not in one.reason
    # The wind of the circuit comes from 60 degrees: a landing to the west has a tailwind.
    assert one.suggestion == "land from the other end, on a course of 90° instead of 270°, against the wind"


def test_a_final_over_unknown_ground_is_not_judged() -> None:
    flown = flown_circuit()
    setup = with_hole(flown.setup, 900.0, 600.0)
    one = found(setup, flown.track, "touchdown")
    assert one.ok is None
    assert "the terrain below the final approach is unknown" in one.reason
    assert judge_flight(setup, flown.track, "completed").headline == (
        "not judged in full: the terrain below the final approach is unknown"
    )
