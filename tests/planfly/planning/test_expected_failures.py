"""Causes of failures that are known from a safe plan alone: loose limits, and a strip that is too short."""

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from planfly.planning.expected_failures import expected_failures
from planfly.workflow.make_plan import make_plan
from planfly.workflow.uav import load_uav
from planner.plan import Plan
from planner.procedures import DepartureAndApproach, Descent
from planner.search.plan_path import certify_waypoints
from tests.setups import small_scenario
from world.scenario import Scenario, load_scenario, scenario_from_spec

GLIDE = 0.1


@cache
def plan_of(name: str) -> Plan:
    scenario = load_scenario(name)
    return make_plan(scenario, load_uav(scenario), 1)


def said_of(plan: Plan) -> tuple[str, ...]:
    return expected_failures(plan, load_uav(plan.scenario))


def landing_plan(turbulence: str = "none", **strip: Any) -> Plan:
    """The plan of the demo in the air, with a strip and a glide of 1 in 10."""
    plan = plan_of("jacksboro-air")
    spec = plan.scenario.to_json()
    spec |= {"landing": {"east_m": -10160.0, "north_m": 2670.0, **strip}, "home": {"place": "start"}}
    spec["wind"] = {"speed_mps": 5.0, "from_deg": 250.0, "turbulence": turbulence}
    scenario: Scenario = scenario_from_spec(spec, "landing")
    descent = Descent(np.zeros((0, 3)), np.zeros((2, 3)), np.zeros(3), 0.0, GLIDE, 70.0)
    return replace(plan, scenario=scenario, procedures=DepartureAndApproach(None, descent))


@pytest.mark.parametrize(("name", "part"), [("steep", "leg 4: climbs at 18.3°"), ("tight", "leg 9: 30 m long")])
def test_limits_that_are_looser_than_the_aircraft_are_said(name: str, part: str) -> None:
    (text,) = said_of(plan_of(name))
    assert text.startswith("flights are expected to fail")
    assert part in text
    assert '"aircraft" instead of the numbers in [limits]' in text


def test_limits_that_the_aircraft_keeps_are_not_said() -> None:
    """The plan of `hard-07` turns by up to 45 degrees, and its flight is flyable."""
    plan = plan_of("hard-07")
    assert plan.scenario.limits.max_turn_deg == 45.0
    assert said_of(plan) == ()


@pytest.mark.parametrize(
    ("autopilot", "slope_deg", "part"),
    [
        # In light turbulence a plan uses 0.7 of FW_T_SINK_R_SP (2 m/s) and of FW_T_CLMB_R_SP (3 m/s), and keeps 0.5°.
        # At 25 m/s these are asin(1.4 / 25) = 3.21° and asin(2.1 / 25) = 4.82°, at 600 m AMSL 0.1° less.
        ("px4", -2.5, ""),
        ("px4", -2.9, "leg 0: sinks at 2.9°"),
        ("px4", 4.1, ""),
        ("px4", 4.5, "leg 0: climbs at 4.5°"),
        # 0.65 of the Aerosonde's TECS_CLMB_MAX (5.6 m/s): asin(3.64 / 25) = 8.37°.
        ("ardupilot", -2.9, ""),
        ("ardupilot", 7.4, ""),
        ("ardupilot", 8.2, "leg 0: climbs at 8.2°"),
    ],
)
def test_numbers_that_are_looser_than_the_rates_of_the_autopilot_are_said(
    autopilot: str, slope_deg: float, part: str
) -> None:
    height = 3000.0 * math.tan(math.radians(abs(slope_deg)))
    low, high = {"east_m": 0.0, "north_m": 0.0, "amsl_m": 200.0}, {"east_m": 3000.0, "north_m": 0.0}
    high["amsl_m"] = 200.0 + height
    if slope_deg < 0.0:
        low["amsl_m"], high["amsl_m"] = high["amsl_m"], low["amsl_m"]
    scenario = small_scenario(
        terrain={"kind": "flat", "amsl_m": 0.0},
        area={"east_m": [-1000.0, 4000.0], "north_m": [-1000.0, 1000.0], "ceiling_amsl_m": 1000.0},
        start=low,
        destination=high,
        limits={"max_climb_deg": 9.0, "max_dive_deg": 9.0, "max_turn_deg": 60.0, "min_clearance_m": 60.0},
        flight={"autopilot": autopilot, "aircraft": "aerosonde", "airspeed_mps": 25.0},
        wind={"speed_mps": 0.0, "from_deg": 0.0, "turbulence": "light"},
    )
    uav, path = load_uav(scenario), np.stack([scenario.start, scenario.destination])
    plan = certify_waypoints(scenario, uav.limits.with_margin(), path, seed=1)
    assert plan.safe, plan.certificate
    said = expected_failures(plan, uav)
    assert len(said) == bool(part)
    for text in said:
        assert text.startswith("flights may fail: the limits of the scenario are looser than the limits of ")
        assert part in text


def test_a_plan_that_is_not_safe_has_its_problems_alone() -> None:
    plan = plan_of("steep")
    unsafe = replace(plan, certificate=replace(plan.certificate, problems=("a problem",)))
    assert said_of(unsafe) == ()


def test_a_strip_whose_height_only_the_map_knows_is_too_short() -> None:
    """5.5 m on a glide of 1 in 10 move the touchdown by 55 m, 8 m more are the flare's; 70 m are 1.26 deviations."""
    (text,) = said_of(landing_plan(length_m=200.0))
    assert math.hypot(55.0, 8.0) == pytest.approx(55.6, abs=0.05)
    assert "only 79 % of the landings" in text
    assert "the standard deviation of the touchdown point along the strip is 56 m." in text
    # 2 x (30 m + 1.96 x 55.6 m) = 278 m; with a survey 2 x (30 m + 1.96 x 8 m) = 91.4 m.
    assert (
        "survey its altitude and state [landing] height_sd_m (then 100 m are enough), or use a strip of 280 m" in text
    )
    assert "less turbulence" not in text


def test_a_strip_that_is_long_enough_is_not_said() -> None:
    assert len(said_of(landing_plan(length_m=270.0))) == 1
    assert said_of(landing_plan(length_m=280.0)) == ()
    assert said_of(landing_plan(length_m=200.0, height_sd_m=0.5)) == ()


def test_a_strip_that_is_shorter_than_the_error_of_the_touchdown_holds_none() -> None:
    (text,) = said_of(landing_plan(length_m=50.0, height_sd_m=0.5))
    assert "only 0 % of the landings" in text


def test_gusts_move_the_touchdown_along_a_surveyed_strip() -> None:
    """66 m in light turbulence, 132 m in moderate: 70 m are 1.06 and 0.53 deviations."""
    (light,) = said_of(landing_plan("light", length_m=200.0, height_sd_m=0.0))
    (moderate,) = said_of(landing_plan("moderate", length_m=200.0, height_sd_m=0.0))
    assert "only 71 % of the landings" in light
    assert "only 40 % of the landings" in moderate
    assert light.endswith("use a strip of 320 m, or fly in less turbulence")


def test_a_plan_without_a_landing_says_nothing_of_strips() -> None:
    assert said_of(plan_of("jacksboro-air")) == ()
