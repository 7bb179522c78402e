"""How many circles a flight may expect at a plan's waypoints in gusts, and what a plan does about them."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flight.autopilots.px4.autopilot import Px4
from planfly.planning.gust_altitude_margin import find_shortfalls
from planfly.planning.gust_orbits import MAX_EXPECTED_ORBITS, expected_orbits, limit_waypoint_orbits
from planfly.workflow.make_plan import make_plan
from planfly.workflow.uav import Uav, load_uav
from planner.plan import Plan
from planner.search.plan_path import plan_path
from planner.search.seeds import halve_longest_legs
from tests.setups import spec_around, with_path
from world.scenario import Scenario, scenario_from_spec

SEED = 3


def scenario_of(turbulence: str, autopilot: str = "px4", **tables: Any) -> Scenario:
    """8 km over level ground for the X8, past a zone in the middle."""
    made: dict[str, Any] = {
        "flight": {"aircraft": "x8", "autopilot": autopilot},
        "wind": {"speed_mps": 4.0, "from_deg": 200.0, "turbulence": turbulence},
        "zones": [{"name": "mast", "kind": "exclusion", "east_m": 4000.0, "north_m": 60.0, "radius_m": 300.0}],
    }
    ends = [[0.0, 0.0, 150.0], [8000.0, 0.0, 150.0]]
    return scenario_from_spec(spec_around(ends, buffer=3000.0, ceiling=800.0) | made | tables, "gusts")


def searching(uav: Uav, asked: list[int]) -> Callable[[Scenario], Plan]:
    """A search that notes how many waypoints it was asked for."""

    def search(scenario: Scenario) -> Plan:
        asked.append(scenario.planner.waypoints)
        return plan_path(scenario, uav.limits.with_margin(), seed=SEED)

    return search


@pytest.mark.parametrize(("turbulence", "autopilot"), [("none", "px4"), ("light", "px4"), ("moderate", "ardupilot")])
def test_plans_of_calmer_air_and_of_who_flies_on_are_as_they_were(turbulence: str, autopilot: str) -> None:
    scenario = scenario_of(turbulence, autopilot)
    uav, asked = load_uav(scenario), list[int]()
    plan = plan_path(scenario, uav.limits.with_margin(), seed=SEED)
    assert plan.safe
    assert limit_waypoint_orbits(plan, uav, searching(uav, asked)) is plan
    assert not asked


def test_a_straight_way_in_gusts_has_no_waypoints_to_circle_at() -> None:
    scenario = scenario_of("moderate", zones=[])
    plan = make_plan(scenario, load_uav(scenario), SEED)
    assert plan.safe
    assert plan.waypoints.tolist() == [scenario.start.tolist(), scenario.destination.tolist()]


def test_a_way_round_has_as_many_waypoints_as_gusts_allow() -> None:
    scenario = scenario_of("moderate")
    uav, asked = load_uav(scenario), list[int]()
    search = searching(uav, asked)
    plan = limit_waypoint_orbits(search(scenario), uav, search)
    assert plan.safe
    assert 0.0 < expected_orbits(plan, uav.autopilot, uav.limits) <= MAX_EXPECTED_ORBITS
    assert asked[0] == 12
    assert plan.scenario is scenario


def test_circles_are_those_of_all_waypoints_by_what_is_in_hand(airframe_of_x8: Uav) -> None:
    """A climb takes its rate from what the aircraft can climb, and leaves what it can sink.

    The slope is one over the ground, and the wind carries the aircraft along: 4 m/s from 200 degrees, and eastwards.
    """
    limits, slope = airframe_of_x8.limits, 0.05
    way = np.array([[0.0, 0.0, 150.0], [2000.0, 0.0, 150.0 + 2000.0 * slope], [6000.0, 0.0, 250.0]])
    plan = plan_of(airframe_of_x8, way)
    climb, sink = limits.max_climb_and_sink_rates(250.0)
    # Speeds are equivalent ones for PX4; the standard atmosphere at 250 m.
    true_airspeed = limits.airspeed / math.sqrt((1.0 - 2.25577e-5 * 250.0) ** 4.2559)
    aside, along = 4.0 * math.cos(math.radians(20.0)), 4.0 * math.sin(math.radians(20.0))
    rate = slope * (math.sqrt(true_airspeed**2 - aside**2) + along)
    climbing = airframe_of_x8.autopilot.deviations.altitude_miss_probability(climb - rate, sink, "moderate")
    assert expected_orbits(plan, airframe_of_x8.autopilot, limits) == pytest.approx(climbing, rel=1e-3)
    down = plan_of(airframe_of_x8, way * [1.0, 1.0, -1.0] + [0.0, 0.0, 500.0])
    sinking = airframe_of_x8.autopilot.deviations.altitude_miss_probability(climb, sink - rate, "moderate")
    assert expected_orbits(down, airframe_of_x8.autopilot, limits) == pytest.approx(sinking, rel=1e-3)
    both = plan_of(airframe_of_x8, np.concatenate([way, [[8000.0, 0.0, 250.0]]]))
    level = airframe_of_x8.autopilot.deviations.altitude_miss_probability(climb, sink, "moderate")
    assert expected_orbits(both, airframe_of_x8.autopilot, limits) == pytest.approx(climbing + level, rel=1e-3)
    # As a share of all, the wind is much more than that.
    calm = airframe_of_x8.autopilot.deviations.altitude_miss_probability(
        climb - slope * true_airspeed, sink, "moderate"
    )
    assert abs(climbing / calm - 1.0) > 3e-3


def test_a_plan_that_is_made_anew_for_updrafts_has_few_waypoints_too() -> None:
    """22 m below the maximum height a level way has too little against updrafts; what is found then is settled too."""
    scenario = scenario_of("moderate", limits={"min_clearance_m": 50.0, "max_height_m": 172.0})
    uav = load_uav(scenario)
    limits = uav.limits.with_margin()
    first = limit_waypoint_orbits(plan_path(scenario, limits, seed=SEED), uav, searching(uav, []))
    assert first.safe
    assert find_shortfalls(first, uav)
    plan = make_plan(scenario, uav, SEED)
    assert expected_orbits(plan, uav.autopilot, limits) <= MAX_EXPECTED_ORBITS
    assert plan.safe or "updrafts may move the aircraft" in plan.certificate.problems[0]


def test_a_plan_that_needs_more_says_what_would_help(airframe_of_x8: Uav) -> None:
    """With a NAV_FW_ALT_RAD of 5 m nothing leads past a zone; 5 m less than the value that it names do not help."""
    scenario = scenario_of("moderate")
    found = plan_path(scenario, airframe_of_x8.limits.with_margin(), seed=SEED)
    tight = Px4(airframe_of_x8.autopilot.with_parameters(NAV_FW_ALT_RAD=5.0).parameters)  # type: ignore[arg-type]
    uav = replace(airframe_of_x8, autopilot=tight)
    plan = limit_waypoint_orbits(found, uav)
    assert not plan.feasible
    (problem,) = plan.certificate.problems
    assert "in moderate turbulence, PX4 circles at a waypoint if gusts push it off the waypoint's altitude" in problem
    value = float(problem.split("NAV_FW_ALT_RAD of ")[1].split(" m ")[0])
    enough, less = (tight.with_parameters(NAV_FW_ALT_RAD=asked) for asked in (value, value - 5.0))
    assert expected_orbits(plan, enough, uav.limits) <= MAX_EXPECTED_ORBITS
    assert expected_orbits(plan, less, uav.limits) > MAX_EXPECTED_ORBITS


@pytest.mark.parametrize(("waypoints", "asked_counts"), [(12, [3]), (24, [])])
def test_no_path_with_few_waypoints_is_sought_if_the_usual_number_was_too_small(
    waypoints: int, asked_counts: list[int], airframe_of_x8: Uav
) -> None:
    """A plan has more waypoints than the scenario states (12) only if a search with 12 has found no safe path.

    With a NAV_FW_ALT_RAD of 5 m the expected orbits allow one inner waypoint, so that three are asked for.
    """
    found = plan_path(scenario_of("moderate"), airframe_of_x8.limits.with_margin(), seed=SEED)
    tight = Px4(airframe_of_x8.autopilot.with_parameters(NAV_FW_ALT_RAD=5.0).parameters)  # type: ignore[arg-type]
    uav, asked = replace(airframe_of_x8, autopilot=tight), list[int]()
    plan = with_path(found, halve_longest_legs(found.waypoints, waypoints))
    assert not limit_waypoint_orbits(plan, uav, searching(uav, asked)).safe
    assert asked == asked_counts


@pytest.mark.parametrize(("aside", "taken"), [(300.0, True), (2000.0, False)])
def test_fewer_and_sharper_corners_stay_in_the_corridor(aside: float, taken: bool, airframe_of_x8: Uav) -> None:
    """Of 30 m, less 8 m for gusts: atan(300 / 4000) twice turns by 9 degrees, atan(2000 / 4000) twice by 53."""
    wide = {"name": "city", "kind": "exclusion", "east_m": 4000.0, "north_m": 0.0, "radius_m": 1600.0}
    scenario = scenario_of("moderate", zones=[wide])
    found = plan_path(scenario, airframe_of_x8.limits.with_margin(), seed=SEED)
    assert found.safe
    corner = with_path(found, [scenario.start, [4000.0, aside, 150.0], scenario.destination])
    assert expected_orbits(corner, airframe_of_x8.autopilot, airframe_of_x8.limits) <= MAX_EXPECTED_ORBITS
    assert limit_waypoint_orbits(found, airframe_of_x8, lambda _: corner).feasible is taken
    # One that was found with so few waypoints, too.
    settled = limit_waypoint_orbits(corner, airframe_of_x8)
    assert (settled is corner) is taken
    assert settled.feasible is taken
    wide = [
        problem for problem in settled.certificate.problems if "m from the legs at the corner of waypoint 1" in problem
    ]
    assert (len(wide), taken) in ((0, True), (1, False))


def plan_of(uav: Uav, waypoints: np.ndarray) -> Plan:
    scenario = scenario_of("moderate")
    found = plan_path(scenario, uav.limits.with_margin(), seed=SEED)
    return with_path(found, waypoints)


@pytest.fixture(scope="module")
def airframe_of_x8() -> Uav:
    return load_uav(scenario_of("moderate"))
