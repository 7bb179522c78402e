"""States on the page: near a limit, if little of what the limit allows is left or a missile is close."""

from dataclasses import replace

import numpy as np
import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.mission.items import Frame, Mission, MissionItem
from logs.verdict.findings import make_finding
from logs.verdict.judge_flight import judge_flight
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.places import Place
from logs.verdict.presentation import FindingRow
from planfly.studio.states import place_states
from tests.planfly.studio.drafts import drawn_session, session_of, world_of
from tests.synthetic import fly_path, make_setup
from world.frames import to_geo


@pytest.mark.parametrize(
    ("rule", "unit", "limit", "value", "state"),
    [
        # A waypoint passed at 3 % of the radius of 5.1 m, and at 96 % of it.
        ("waypoint", "m", 5.1, 0.154, "ok"),
        ("waypoint", "m", 5.1, 4.9, "near"),
        # A tenth of 500 m is more than 10 m, so that 12 m are enough; a tenth of 3.2 degrees is less than 1.
        ("waypoint", "m", 500.0, 488.0, "ok"),
        ("waypoint", "m", 500.0, 491.0, "near"),
        ("slope", "deg", 3.2, 2.5, "ok"),
        ("slope", "deg", 3.2, 3.0, "near"),
        # A course change has no scale.
        ("turn", "deg", 90.0, 80.0, "ok"),
        ("turn", "deg", 90.0, 82.0, "near"),
    ],
)
def test_a_value_is_near_its_limit_within_a_tenth_of_it(
    rule: str, unit: str, limit: float, value: float, state: str
) -> None:
    finding = make_finding(
        rule, Place("leg", 0), ok=True, reason="", planned=value, limit=limit, margin=limit - value, unit=unit
    )
    found = FindingRow(finding).place_state
    assert found is not None
    assert found.state == state


def test_a_limit_of_zero_leaves_the_scale_of_its_rule() -> None:
    for margin, state in ((8.0, "near"), (12.0, "ok")):
        finding = make_finding(
            "bounds", Place("leg", 0), ok=True, reason="", planned=margin, limit=0.0, margin=margin, unit="m"
        )
        found = FindingRow(finding).place_state
        assert found is not None
        assert found.state == state


def test_a_waypoint_that_is_flown_straight_through_is_near_no_limit() -> None:
    """ArduPlane's acceptance radius shrinks with the turn, to 0 without one."""
    straight = [[0, 0, 500], [0, 1000, 500], [0, 2000, 500]]
    setup = replace(make_setup(straight), autopilot=ArduPlane(ArduPilotParameters.defaults()))
    for aside in (0.0, 0.4):
        track = fly_path(setup, across=lambda s, aside=aside: np.full_like(s, aside))
        verdict = judge_flight(setup, track, "completed")
        passed = next(one for one in verdict.findings if one.rule == "waypoint" and one.place.index == 1)
        assert passed.state == "ok"
        assert place_states(route_requirements(setup), verdict.findings).corners[1].state == "ok"


@pytest.mark.parametrize(
    ("rule", "limit", "value", "at_least", "tolerance", "text"),
    [
        # Passed at 1.42 m of a radius of 1.5 m, which is little; with its tolerance the limit is 6.13 m.
        ("waypoint", 1.5, 1.42, False, 4.63, "waypoint 1.42 m (\u2264 1.5 m, plus 4.63 m for navigation and gusts)"),
        ("clearance", 50.0, 51.0, True, 20.0, "clearance 51 m (\u2265 50 m, less a tolerance of 20 m)"),
        # Far from the limit, or close to it with the tolerance, too: the limit with its tolerance is enough.
        ("waypoint", 1.5, 0.3, False, 4.63, "waypoint 0.3 m (\u2264 6.13 m)"),
        ("clearance", 50.0, 51.0, True, 0.1, "clearance 51 m (\u2265 49.9 m)"),
    ],
)
def test_a_place_says_what_its_limit_is_without_the_tolerance_that_leaves_it_room(
    rule: str, limit: float, value: float, at_least: bool, tolerance: float, text: str
) -> None:
    margin = value - limit if at_least else limit - value
    finding = make_finding(
        rule,
        Place("waypoint", 1),
        ok=True,
        reason="",
        planned=value,
        limit=limit,
        margin=margin,
        tolerance=tolerance,
        unit="m",
        at_least=at_least,
    )
    found = FindingRow(finding).place_state
    assert found is not None
    assert found.text == text


@pytest.mark.parametrize(("beside", "near"), [(2.2, True), (9.0, True), (40.0, False)])
def test_a_leg_close_to_a_missile_is_near(beside: float, near: bool) -> None:
    scenario, _ = world_of("jacksboro")
    threats = scenario.threats
    m = int(np.flatnonzero(threats.kill_radius > 0.0)[0])
    centre, east = threats.position[m], float(threats.position[m, 0] + threats.kill_radius[m]) + beside
    items = []
    for seq, along in enumerate((-3000.0, 0.0, 3000.0), 1):
        lat, lon = (round(float(one), 7) for one in to_geo(scenario.origin, east, float(centre[1]) + along))
        items.append(MissionItem(seq, 16, int(Frame.GLOBAL), (0.0,) * 4, lat, lon, round(float(centre[2]), 3)))
    judged = session_of(Mission(drawn_session(5, 12).mission.home, tuple(items), source="chord")).judged
    # Without the findings on the ground, which the chord may enter.
    states = place_states(judged.requirements, [one for one in judged.verdict.findings if one.rule == "threat"])
    closest = [state for state in states.legs.values() if f" {threats.names[m]} " in state.text]
    assert [state.state for state in closest] == ["near"] * (2 * near)
    if near:
        distance = float(closest[0].text.split(" m away")[0].split()[-1])
        assert distance == pytest.approx(beside, abs=0.1)


def test_a_leg_that_leaves_the_terrain_data_is_not_judged() -> None:
    scenario, _ = world_of("jacksboro")
    (west, east), (south, north) = scenario.bounds.tolist()
    items = []
    for seq, across in enumerate((0.4, 0.6, 20.0), 1):
        place = west + across * (east - west), 0.5 * (south + north)
        lat, lon = (round(float(one), 7) for one in to_geo(scenario.origin, *place))
        items.append(MissionItem(seq, 16, int(Frame.GLOBAL), (0.0,) * 4, lat, lon, 1500.0))
    judged = session_of(Mission(drawn_session(5, 12).mission.home, tuple(items), source="far")).judged
    findings = [one for one in judged.verdict.findings if one.rule == "clearance"]
    legs = place_states(judged.requirements, findings).legs
    assert legs[len(judged.setup.route.positions) - 2].state == "open"
    assert legs[len(judged.setup.route.positions) - 2].text.startswith(
        "clearance: leg 1 (to item 3) leaves the data of"
    )
    assert legs[0].state != "open"
