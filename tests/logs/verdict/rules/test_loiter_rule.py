"""A loiter's corners are one finding, its legs the worst of each rule."""

import math
from dataclasses import replace

import pytest

from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.simulation.setup import FlightSetup
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.rules.loiter_rule import loiter_circles
from logs.verdict.suggestions import suggest_larger_loiter
from tests.logs.verdict.judging import judge, of, suggested
from tests.mission_lines import setup_of, wp
from tests.synthetic import fly_path


def loiter(radius: float, wind: float = 0.0) -> FlightSetup:
    setup = setup_of(wp(0, 500), wp(0, 2500, command=18, p=f"2 0 {radius:g} 0"), wp(2500, 2500))
    scenario = replace(setup.scenario, wind=replace(setup.scenario.wind, speed=wind))
    return replace(setup, scenario=scenario, limits=replace(setup.limits, wind=scenario.wind))


def test_a_circle_has_its_item_radius_and_turns() -> None:
    setup = loiter(200.0)
    (circle,) = loiter_circles(route_requirements(setup))
    assert set(setup.route.items[circle.first : circle.last + 1].tolist()) == {2}
    assert circle.radius == 200.0
    assert circle.laps == pytest.approx(2.0, abs=0.5)


def test_one_finding_a_loiter_and_none_of_its_corners() -> None:
    verdict = judge_geometry(loiter(200.0))
    item = of(verdict, "loiter")
    assert (item.ok, item.planned, item.limit_source) == (True, 200.0, "aircraft")
    corners = [one for one in verdict.findings if one.rule in ("turn", "waypoint") and one.place.item == 2]
    assert corners == []


def test_a_circle_too_small_for_the_bank_limit_fails_and_says_what_it_needs() -> None:
    item = of(judge_geometry(loiter(70.0, wind=8.0)), "loiter")
    assert item.ok is False
    assert item.margin is not None
    assert item.margin < 0.0
    assert item.brief == item.reason.partition(". Details")[0]
    assert f"the aircraft needs {item.limit:.0f} m in this wind" in item.reason


def test_a_circle_too_small_for_the_bank_limit_is_offered_the_radius_that_its_item_must_state() -> None:
    """planfly's guidance flies the stated radius."""
    setup = loiter(70.0, wind=8.0)
    item = of(judge_geometry(setup), "loiter")
    assert item.limit is not None
    change = suggested(item, "radius")
    assert (change.current, change.wanted, change.place.item) == (70.0, math.ceil(item.limit), 2)
    assert of(judge_geometry(loiter(change.wanted, wind=8.0)), "loiter").ok
    assert of(judge_geometry(loiter(change.wanted - 2.0, wind=8.0)), "loiter").ok is False
    # A circle that is flown 1.25 times as large as stated.
    wider = replace(item, planned=1.25 * 70.0, limit=100.0)
    [(change,)] = suggest_larger_loiter(route_requirements(setup), None, wider)
    assert change.wanted == 80.0
    # One that is large enough fails for another reason.
    assert suggest_larger_loiter(route_requirements(setup), None, replace(item, planned=101.0, limit=100.0)) == ()


def test_legs_of_a_circle_give_the_worst_of_each_rule() -> None:
    setup = loiter(200.0)
    verdict = judge_geometry(setup)
    (circle,) = loiter_circles(route_requirements(setup))
    for rule in ("slope", "speed"):
        # One finding of the leg to the loiter and of all legs around it: people count them as one.
        there = [one for one in verdict.findings if one.rule == rule and one.place.number == circle.first - 1]
        assert len(there) == 1
        numbers = [one.place.number for one in verdict.findings if one.rule == rule]
        assert numbers == list(range(len(set(setup.route.stops.tolist())) - 1))


@pytest.mark.parametrize(("wind", "fails"), [(20.0, False), (26.0, True)])
def test_px4_drifts_from_the_circle_after_the_last_waypoint_in_a_wind_above_its_airspeed(
    wind: float, fails: bool
) -> None:
    """25 m/s of airspeed; the flight itself, downwind over both legs, passes all other rules."""
    setup = replace(setup_of(wp(0, 500), wp(0, 2500), wp(0, 4500)), autopilot=Px4(Px4Parameters.defaults()))
    scenario = replace(setup.scenario, wind=replace(setup.scenario.wind, speed=wind, from_course=3.14159))
    setup = replace(setup, scenario=scenario, limits=replace(setup.limits, wind=scenario.wind))
    for verdict in (judge(setup, fly_path(setup)), judge_geometry(setup)):
        failed = [one for one in verdict.findings if one.rule == "loiter" and one.ok is False]
        assert bool(failed) is fails
        assert all("the wind is too strong to fly a circle" in one.reason for one in failed)
