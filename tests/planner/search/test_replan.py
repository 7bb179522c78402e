"""Planning again in flight: what is flown stays, and a threat that pops up is avoided."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.plan import Plan, parse_plan, plan_json
from planner.search.plan_path import plan_path
from planner.search.replan import replan
from planner.search.seeds import halve_longest_legs
from world.airspace.zones import Cylinder, Zone
from world.errors import MissionError, ScenarioError
from world.geometry import turning_angles
from world.scenario import Scenario, with_threats


@pytest.fixture(scope="module")
def old(scenario: Scenario, limits: Limits) -> Plan:
    return plan_path(scenario, limits, seed=1)


def in_the_way(plan: Plan, leg: int) -> dict[str, float]:
    middle = 0.5 * (plan.waypoints[leg] + plan.waypoints[leg + 1])
    return {
        "east_m": float(middle[0]),
        "north_m": float(middle[1]),
        "kill_radius_m": 400.0,
        "detection_radius_m": 700.0,
    }


def test_pop_up_threat_is_avoided_and_what_is_flown_stays(old: Plan, limits: Limits) -> None:
    now = with_threats(old.scenario, [in_the_way(old, 4)], "test")
    plan = replan(now, limits, old, 2, seed=1)
    np.testing.assert_array_equal(plan.waypoints[:3], old.waypoints[:3])
    assert plan.flown_legs == 2
    assert plan.safe
    centre, radius = now.threats.position[-1], now.threats.kill_radius[-1]
    legs = [np.linspace(*plan.waypoints[i : i + 2], 2000) for i in range(2, len(plan.waypoints) - 1)]
    assert np.linalg.norm(np.concatenate(legs) - centre, axis=1).min() > radius
    assert len(now.threats) == len(old.scenario.threats) + 1
    again = parse_plan(plan_json(plan), "replan.json")
    assert again.flown_legs == 2
    assert len(again.scenario.threats) == len(now.threats)


def test_turn_counts_from_the_present_course(
    small: Callable[..., Scenario], make_limits: Callable[[Scenario], Limits]
) -> None:
    """With 45 degrees at most, the first new leg may not leave the course of the leg flown last by more."""
    scenario = small(limits={"max_turn_deg": 45})
    limits = make_limits(scenario)
    first = plan_path(scenario, limits, seed=1)
    now = with_threats(scenario, [in_the_way(first, 4)], "test")
    plan = replan(now, limits, first, 3, seed=1)
    assert plan.feasible
    assert turning_angles(plan.waypoints[2:5])[0] <= math.radians(45.0)


def test_a_leg_that_begins_in_reach_is_refused_by_its_own_name(old: Plan, limits: Limits) -> None:
    east, north = old.waypoints[3, :2]
    threat = {"east_m": float(east), "north_m": float(north), "kill_radius_m": 2000.0, "detection_radius_m": 2500.0}
    now = with_threats(old.scenario, [threat], "test")
    with pytest.raises(MissionError, match=r"leg 3: it starts at waypoint 3, \d+ m inside .* pop-up 1") as caught:
        replan(now, limits, old, 3, seed=1)
    assert "\n" not in str(caught.value)


def test_same_seed_same_replan(old: Plan, limits: Limits) -> None:
    now = with_threats(old.scenario, [in_the_way(old, 4)], "test")
    one, two = (plan_json(replan(now, limits, old, 2, seed=3)) for _ in range(2))
    assert one == two


def test_legs_that_are_not_there_and_other_missions_are_refused(
    old: Plan, limits: Limits, small: Callable[..., Scenario]
) -> None:
    with pytest.raises(MissionError, match=r"leg 7: the plan has legs 0\.\.6"):
        replan(old.scenario, limits, old, 7, seed=1)
    other = small(destination={"east_m": 5000, "north_m": 0, "amsl_m": 150})
    with pytest.raises(MissionError, match="destination: 1000 m"):
        replan(other, limits, old, 1, seed=1)
    with pytest.raises(ScenarioError, match="kill_radius_m: -5"):
        with_threats(old.scenario, [{"east_m": 0.0, "north_m": 0.0, "kill_radius_m": -5.0}], "--add-threat")


def test_longest_legs_are_split() -> None:
    path = np.array([[0.0, 0, 0], [1000, 0, 100], [1100, 0, 100]])
    np.testing.assert_allclose(halve_longest_legs(path, 5)[:, 0], [0, 250, 500, 1000, 1100])


def test_a_zone_that_comes_up_is_kept_out_of_and_a_leg_that_begins_in_it_is_refused(old: Plan, limits: Limits) -> None:
    middle = 0.5 * (old.waypoints[4] + old.waypoints[5])
    now = dataclasses.replace(old.scenario, zones=(Zone("fire", "exclusion", Cylinder(*middle[:2].tolist(), 400.0)),))
    plan = replan(now, limits, old, 2, seed=1)
    assert plan.safe
    legs = [np.linspace(*plan.waypoints[i : i + 2], 2000) for i in range(2, len(plan.waypoints) - 1)]
    assert np.linalg.norm(np.concatenate(legs)[:, :2] - middle[:2], axis=1).min() > 400.0
    here = dataclasses.replace(old.scenario, zones=(Zone("fire", "exclusion", Cylinder(*old.waypoints[3, :2], 50.0)),))
    with pytest.raises(MissionError, match="leg 3: it starts at waypoint 3, which violates fire"):
        replan(here, limits, old, 3, seed=1)
