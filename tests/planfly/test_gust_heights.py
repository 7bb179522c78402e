"""How much height downdrafts may take, and what a plan does about it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import planfly
from aircraft.path_limits import Limits
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from planfly.airframe import Airframe, load_airframe
from planfly.gust_heights import keep_height, limits_of_others
from planfly.make_plan import make_plan
from planner.evaluation.certify import certify
from planner.evaluation.problem import CERTIFIED_BUFFER, make_problem
from planner.plan import Plan
from planner.search.plan_path import plan_path
from tests.setups import spec_around
from world.scenario import Scenario, from_spec
from world.wind import Turbulence

SEED = 3
# Standard deviation of the vertical gusts in moderate turbulence, MIL-F-8785C: a tenth of 30 knots, m/s.
GUST = 0.1 * 30.0 * 0.514444
# The Zagi climbs about 1.2 m/s here.
GROUND = 3000.0


def scenario_of(turbulence: str, height: float = 60.0, **tables: Any) -> Scenario:
    """8 km for the Zagi with planfly's guidance over level ground at 3,000 m, 50 m of which are to be kept."""
    made: dict[str, Any] = {
        "terrain": {"kind": "flat", "amsl_m": GROUND},
        "flight": {"aircraft": "zagi", "autopilot": "ideal"},
        "limits": {"min_clearance_m": 50.0},
        "wind": {"speed_mps": 0.0, "from_deg": 0.0, "turbulence": turbulence},
    }
    ends = [[0.0, 0.0, GROUND + height], [8000.0, 0.0, GROUND + height]]
    return from_spec(spec_around(ends, buffer=3000.0, ceiling=GROUND + 800.0) | made | tables, "gusts")


def plan_along(airframe: Airframe, scenario: Scenario, way: Any) -> Plan:
    """A plan of given waypoints, with its certificate."""
    found = plan_path(scenario, airframe.limits, seed=SEED)
    waypoints = np.array(way, dtype=np.float64)
    certificate = certify(make_problem(scenario, airframe.limits), waypoints)
    return replace(found, waypoints=waypoints, certificate=certificate)


@pytest.mark.parametrize(
    ("climb", "turbulence", "sink"),
    [
        # One in a hundred exceeds 2.33 standard deviations; what is climbed comes off; it lasts for 12 s.
        (1.0, "moderate", 12.0 * (2.33 * GUST - 1.0)),
        (0.0, "moderate", 12.0 * 2.33 * GUST),
        (4.0, "moderate", 0.0),
        (1.0, "light", 12.0 * (2.33 * 0.5 * GUST - 1.0)),
        (0.0, "none", 0.0),
    ],
)
def test_a_downdraft_takes_what_is_not_climbed(climb: float, turbulence: Turbulence, sink: float) -> None:
    assert PlanflyGuidance().gust_sink(climb, turbulence) == pytest.approx(sink, abs=0.1)


def test_who_keeps_it_otherwise_and_calm_air_are_left_as_they_were() -> None:
    for scenario in (
        scenario_of("none"),
        scenario_of("moderate", flight={"aircraft": "aerosonde", "autopilot": "ardupilot"}),
    ):
        airframe = load_airframe(scenario)
        plan = plan_path(scenario, airframe.limits, seed=SEED)
        assert keep_height(plan, airframe, lambda limits: pytest.fail("searched for another")) is plan
        assert limits_of_others(plan, airframe) == airframe.limits


def needed(airframe: Airframe, climbs: float = 0.0) -> float:
    """Height (m) that downdrafts may take from the Zagi in moderate turbulence while it climbs, by plain sums."""
    return 12.0 * (2.33 * GUST - (airframe.limits.rates(GROUND + 80.0)[0] - climbs))


@pytest.mark.parametrize("over", [0.5, -0.5])
def test_a_level_path_keeps_what_a_downdraft_may_take(over: float) -> None:
    airframe = load_airframe(scenario_of("moderate"))
    height = 50.0 + needed(airframe) + over
    scenario = scenario_of("moderate", height=height)
    plan = plan_along(airframe, scenario, [scenario.start, scenario.destination])
    assert plan.safe
    settled = keep_height(plan, airframe)
    assert (settled is plan) is (over > 0.0)
    assert settled.safe is (over > 0.0)


def test_a_climb_leaves_less_and_the_plan_says_how_much_it_lacks() -> None:
    """At 0.5 m/s of climb 6 m more than level; the leg begins with 30 m above its clearance."""
    airframe = load_airframe(scenario_of("moderate"))
    steep = 0.5 / airframe.airspeed
    way = np.array([[0, 0, 80], [2000, 0, 80], [2000 + 70 / steep, 0, 150], [4000 + 70 / steep, 0, 150]])
    scenario = from_spec(
        scenario_of("moderate").to_json()
        | {"start": {"east_m": 0, "north_m": 0, "height_m": 150}}
        | {"destination": {"east_m": float(way[-1, 0]), "north_m": 0, "height_m": 150}}
        | {"area": {"east_m": [-3000, 9000], "north_m": [-3000, 3000], "ceiling_amsl_m": GROUND + 800}},
        "gusts",
    )
    plan = plan_along(airframe, scenario, way + np.array([0.0, 0.0, GROUND]))
    assert plan.safe
    (problem,) = keep_height(plan, airframe).certificate.problems
    lacks = needed(airframe, 0.5) - 30.0
    assert f"downdrafts may take it {lacks:.0f} m into the clearance of 50 m on leg 1; less turbulence" in problem


def test_near_a_low_end_the_same_share_is_kept() -> None:
    """15 m above the clearance at both ends no plan keeps 30 m there, and one that climbs from them is taken."""
    scenario = scenario_of("moderate", height=65.0)
    airframe = load_airframe(scenario)
    asked = list[Limits]()

    def search(limits: Limits) -> Plan:
        asked.append(limits)
        return plan_path(scenario, limits, seed=SEED)

    first = plan_path(scenario, airframe.limits, seed=SEED)
    plan = keep_height(first, airframe, search)
    assert first.safe
    assert plan.safe
    assert len(asked) == 1
    # Over the middle, far from the ends, it has all that the searched limits keep.
    reserve = min(1.2 * GUST, 0.25 * airframe.limits.rates(float(first.waypoints[:, 2].max()))[0])
    assert asked[0].reserve_climb == pytest.approx(reserve, rel=5e-3)
    assert asked[0].reserve_height == pytest.approx(12.0 * (2.33 * GUST - reserve), rel=5e-3)
    middle = np.interp(4000.0, plan.waypoints[:, 0], plan.waypoints[:, 2]) - GROUND - 50.0
    assert middle >= asked[0].reserve_height + CERTIFIED_BUFFER


SAM = {"name": "sam", "east_m": 4000.0, "north_m": 0.0, "amsl_m": GROUND, "kill_radius_m": 100.0, "kill_scale_m": 50.0}
MAST = {"name": "mast", "kind": "exclusion", "east_m": 4000.0, "north_m": 0.0, "radius_m": 300.0}


@pytest.mark.parametrize(
    ("tables", "into"),
    [
        ({"threats": [SAM]}, "a missile's reach"),
        ({"zones": [MAST | {"ceiling_amsl_m": GROUND + 100.0}]}, "a zone"),
    ],
    ids=["missile", "zone"],
)
def test_what_lies_below_counts(tables: dict[str, Any], into: str) -> None:
    """20 m above both: a path that high keeps enough above ground, and another is searched for that keeps away."""
    scenario = scenario_of("moderate", height=120.0, **tables)
    airframe = load_airframe(scenario)
    plan = plan_along(airframe, scenario, [scenario.start, scenario.destination])
    assert plan.safe
    (problem,) = keep_height(plan, airframe).certificate.problems
    assert f"downdrafts may take it {needed(airframe) - 20.0:.0f} m into {into}" in problem
    made = make_plan(scenario, airframe, SEED)
    assert made.safe
    assert keep_height(made, airframe) is made


def test_every_command_keeps_it_and_a_front_is_not_left_with_one() -> None:
    radar = {"name": "radar", "east_m": 4000.0, "north_m": 500.0, "amsl_m": GROUND}
    reach = {"detection_radius_m": 1500.0, "detection_scale_m": 800.0}
    scenario = scenario_of("moderate", height=70.0, threats=[radar | reach])
    airframe = load_airframe(scenario)
    front = planfly.plan_front(scenario, 4, seed=SEED)
    assert len(front.plans) >= 3
    assert limits_of_others(front.default.plan, airframe).reserve_height > 30.0
    for one in [*(found.plan for found in front.plans), planfly.plan(scenario, seed=SEED)]:
        assert one.safe
        assert keep_height(one, airframe) is one
