"""Plans for time and energy: what the wind triangle says of a plain, and limits that they keep."""

import math
from typing import Any

import numpy as np
import pytest

from planfly.workflow.uav import load_uav
from planner.evaluation.travel_cost import LENGTH_COST, make_energy_cost, path_cost
from planner.plan import Plan
from planner.search.plan_path import plan_path
from tests.setups import spec_around
from world.errors import ScenarioError
from world.geometry import path_length
from world.scenario import Scenario, scenario_from_spec

WIND, SHEAR, RUN, LOW, CEILING = 8.0, 0.02, 12_000.0, 150.0, 600.0


def plain(objective: str, from_deg: float, **tables: Any) -> Scenario:
    """12 km to the north over a plain, at 150 m, in a wind of 8 m/s there, which rises by 2 m/s every 100 m."""
    ends = [[0.0, 0.0, LOW], [0.0, RUN, LOW]]
    wind = {"speed_mps": WIND, "from_deg": from_deg, "gradient": SHEAR}
    flight = {"aircraft": "aerosonde", "autopilot": "planfly"}
    planner = {"objective": objective}
    spec = spec_around(ends, buffer=3000.0, ceiling=CEILING, wind=wind, flight=flight, planner=planner, **tables)
    return scenario_from_spec(spec, "plain")


def planned(scenario: Scenario) -> tuple[Plan, float]:
    """A plan and its time, s."""
    limits = load_uav(scenario).limits
    plan = plan_path(scenario, limits, seed=1)
    assert plan.safe, plan.certificate.problems
    seconds = path_cost(LENGTH_COST._replace(length=0.0, time=1.0), limits.performance(), np.array(plan.waypoints))
    return plan, seconds


def test_with_a_wind_that_rises_the_fastest_way_climbs_to_the_ceiling() -> None:
    """At the bottom 12 km take 12000 / 33 = 364 s, at the ceiling, in 17 m/s, 286 s; a climb lies between."""
    (_, straight), (fast, seconds) = planned(plain("length", 180.0)), planned(plain("time", 180.0))
    assert straight == pytest.approx(RUN / 33.0, rel=1e-3)
    assert RUN / 42.0 < seconds < 0.87 * straight
    assert CEILING - 30.0 < fast.waypoints[:, 2].max() <= CEILING


def test_against_a_wind_that_rises_the_fastest_way_stays_as_low_as_it_may() -> None:
    """Required are 30 m above ground and what is kept in reserve; at 60 m the wind is 6.2 m/s, not 8."""
    limits = {"min_clearance_m": 30.0}
    (_, straight), (fast, seconds) = (planned(plain(goal, 0.0, limits=limits)) for goal in ("length", "time"))
    assert straight == pytest.approx(RUN / 17.0, rel=1e-3)
    assert RUN / (25.0 - 5.6) < seconds < 0.95 * straight
    assert 30.0 <= fast.waypoints[:, 2].min() < 60.0


def test_in_the_same_wind_everywhere_a_straight_line_is_the_fastest() -> None:
    spec = plain("time", 70.0).to_json()
    spec["wind"]["gradient"] = 0.0
    plan, seconds = planned(scenario_from_spec(spec, "plain"))
    # 8 m/s from 70 degrees: 2.74 against, 7.52 across.
    along = math.sqrt(25.0**2 - (8.0 * math.sin(math.radians(70.0))) ** 2) - 8.0 * math.cos(math.radians(70.0))
    assert seconds == pytest.approx(RUN / along, rel=1e-4)
    assert path_length(plan.waypoints) < 1.0001 * RUN


def test_a_plan_for_energy_takes_less_of_the_envelopes_power_than_the_straight_line() -> None:
    """At the bottom, against 8 m/s, 12 km take the power of level flight for 12000 / 17 s."""
    scenario = plain("energy", 0.0)
    limits = load_uav(scenario).limits
    table = limits.performance()
    cost = make_energy_cost(limits.envelope, table)
    assert cost is not None
    (straight, _), (sparing, _) = planned(plain("length", 0.0)), planned(scenario)
    used, least = (path_cost(cost, table, np.array(one.waypoints)) / cost.energy for one in (straight, sparing))
    assert used == pytest.approx(limits.envelope.power(25.0, LOW, 0.0) * RUN / 17.0, rel=1e-3)
    assert least < 0.97 * used


def test_energy_is_refused_where_the_power_of_the_aircraft_is_not_known(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = plain("energy", 0.0)
    monkeypatch.setattr("planner.search.search_cheapest.make_travel_cost", lambda *_: None)
    with pytest.raises(ScenarioError, match="power of this aircraft is unknown"):
        plan_path(scenario, load_uav(scenario).limits, seed=1)
