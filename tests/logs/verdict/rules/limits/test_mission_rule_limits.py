"""PX4's limits: what its checker takes and refuses, just inside and just outside each."""

import math

import pytest

from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_geometry
from tests.mission_lines import setup_of, wp

TAKEOFF, FIRST, SECOND = wp(0, 500, command=22), wp(0, 1500), wp(1500, 1500)


def of(check: str, *lines: str) -> Finding:
    verdict = judge_geometry(setup_of(*lines))
    (found,) = [item for item in verdict.findings if item.rule == "mission" and item.check == check]
    return found


@pytest.mark.parametrize(("height", "taken"), [(0.1, True), (0.0, False)])
def test_a_takeoff_climbs_above_home(height: float, taken: bool) -> None:
    found = of("checkTakeoff", wp(0, 500, height, command=22), FIRST, SECOND)
    assert found.ok is (True if taken else None)


@pytest.mark.parametrize(("degrees", "taken"), [(5.05, True), (5.15, False)])
def test_a_landing_slopes_five_degrees_and_a_tenth(degrees: float, taken: bool) -> None:
    approach = wp(1500, 0, 1500.0 * math.tan(math.radians(degrees)))
    found = of("checkFixedWindLandApproach", TAKEOFF, FIRST, SECOND, approach, wp(0, 0, 0, command=21))
    assert found.ok is (True if taken else None)


@pytest.mark.parametrize(("away", "taken"), [(9_980.0, True), (10_020.0, False)])
def test_the_first_waypoint_is_within_ten_kilometres_of_home(away: float, taken: bool) -> None:
    found = of("checkDistanceToFirstWaypoint", wp(0, away), wp(0, away + 1000.0))
    assert found.ok is (True if taken else None)


@pytest.mark.parametrize(("run", "remarked"), [(895.0, False), (905.0, True)])
def test_waypoints_further_apart_than_nine_hundred_metres_are_remarked(run: float, remarked: bool) -> None:
    found = of("checkDistancesBetweenWaypoints", wp(0, 500), wp(0, 500 + run))
    assert found.ok is True
    assert ("between waypoints" in found.reason) is remarked


@pytest.mark.parametrize(("units", "taken"), [(5, True), (4, False)])
def test_a_gate_is_five_centimetres_from_a_waypoint(units: int, taken: bool) -> None:
    """1e-7 degrees of latitude are 1.11 cm."""
    place = FIRST.split()
    gate = [*place[:1], "4501", *place[2:6], f"{float(place[6]) + units * 1e-7:.7f}", *place[7:]]
    found = of("checkDistancesBetweenWaypoints", TAKEOFF, FIRST, " ".join(gate), SECOND)
    assert found.ok is (True if taken else None)
