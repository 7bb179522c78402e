"""The embedded scenarios are the problems that they are said to be, and their plans show it."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from aircraft.path_limits import Limits
from planner.evaluation.certify import certify
from planner.evaluation.problem import make_problem
from planner.search.plan_path import plan_path
from world.geometry import leg_slopes, sphere_window, turning_angles
from world.scenario import Scenario, load_scenario


@pytest.mark.parametrize("seed", [2, 3, 2**40])
def test_jacksboro_is_safe_for_other_seeds(seed: int, make_limits: Callable[[Scenario], Limits]) -> None:
    scenario = load_scenario("jacksboro-air")
    assert plan_path(scenario, make_limits(scenario), seed=seed).safe


def test_jacksboro_is_a_problem() -> None:
    """At least 12 km and 12 threats of all three kinds; ground and a missile stand in the straight line's way."""
    scenario = load_scenario("jacksboro-air")
    threats = scenario.threats
    assert math.dist(scenario.start[:2], scenario.destination[:2]) >= 12_000
    assert len(threats) >= 12
    kinds = {(bool(kill), bool(seen)) for kill, seen in zip(threats.kill_radius, threats.detection_radius, strict=True)}
    assert kinds == {(True, True), (True, False), (False, True)}
    assert scenario.terrain is not None
    assert scenario.terrain.clearance(scenario.start, scenario.destination)[0] < 0
    # The straight line on the map, at any height the ceiling leaves, meets a sphere.
    for height in np.linspace(scenario.start[2], scenario.ceiling, 12):
        a, b = scenario.start.copy(), scenario.destination.copy()
        a[2] = b[2] = height
        assert any(
            sphere_window(a, b, threats.position[k], threats.kill_radius[k])[0] < threats.kill_radius[k]
            for k in range(len(threats))
            if threats.kill_radius[k] > 0
        )


def test_steep_needs_a_climb_that_the_aircraft_has_not(make_limits: Callable[[Scenario], Limits]) -> None:
    scenario = load_scenario("steep")
    limits = make_limits(scenario)
    plan = plan_path(scenario, limits, seed=3)
    climbs = np.degrees(leg_slopes(plan.waypoints))
    most = max(math.degrees(limits.slopes(math.radians(90), amsl)[0]) for amsl in (0.0, 600.0))
    assert climbs.max() > most + 2.0
    # Only a few legs are beyond it; the others can be flown.
    assert (climbs > most).sum() <= 3
    assert climbs.max() < 24.0


def test_tight_has_corners_that_the_aircraft_cannot_turn(make_limits: Callable[[Scenario], Limits]) -> None:
    scenario = load_scenario("tight")
    limits = make_limits(scenario)
    plan = plan_path(scenario, limits, seed=3)
    turns = np.degrees(turning_angles(plan.waypoints))
    # A corner may be two waypoints close to each other: with 40 m between them an Aerosonde turns by 21 degrees.
    legs = np.linalg.norm(np.diff(plan.waypoints[:, :2], axis=0), axis=1)[1:-1]
    corners = np.append(turns[:-1] + np.where(legs < 40.0, turns[1:], 0.0), turns[-1])
    assert (corners > 80).sum() in (2, 3, 4)
    assert turns.max() <= 134.5
    as_flown = certify(
        make_problem(scenario, Limits(None, None, None, 60, limits.envelope, 25.0, limits.max_bank, limits.wind)),
        plan.waypoints,
    )
    failing = {line.split(":")[0] for line in as_flown.problems}
    assert failing
    assert len(failing) < 12
