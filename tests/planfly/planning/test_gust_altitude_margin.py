"""How much height gusts may take or give, and what a plan does about it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import planfly
from aircraft.path_limits import Limits
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from planfly.planning.gust_altitude_margin import (
    ensure_altitude_margin,
    find_shortfalls,
    limits_for_alternatives,
    limits_in_gusts,
)
from planfly.workflow.make_plan import finish_plan, make_plan
from planfly.workflow.uav import Uav, load_uav
from planner.evaluation.certify import certify
from planner.evaluation.problem import CERTIFIED_BUFFER_M, make_problem
from planner.plan import Plan
from planner.search.plan_path import plan_path
from planner.search.shared_budget import SharedBudget
from tests.setups import spec_around
from world.scenario import Scenario, scenario_from_spec
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
        "flight": {"aircraft": "zagi", "autopilot": "planfly"},
        "limits": {"min_clearance_m": 50.0},
        "wind": {"speed_mps": 0.0, "from_deg": 0.0, "turbulence": turbulence},
    }
    ends = [[0.0, 0.0, GROUND + height], [8000.0, 0.0, GROUND + height]]
    return scenario_from_spec(spec_around(ends, buffer=3000.0, ceiling=GROUND + 800.0) | made | tables, "gusts")


def plan_along(uav: Uav, scenario: Scenario, way: Any) -> Plan:
    """A plan of given waypoints, with its certificate."""
    found = plan_path(scenario, uav.limits, seed=SEED)
    waypoints = np.array(way, dtype=np.float64)
    certificate = certify(make_problem(scenario, uav.limits), waypoints)
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
    assert PlanflyGuidance().deviations.gust_sink(climb, turbulence) == pytest.approx(sink, abs=0.1)


def test_who_keeps_it_otherwise_and_calm_air_are_left_as_they_were() -> None:
    for scenario in (
        scenario_of("none"),
        scenario_of("moderate", flight={"aircraft": "aerosonde", "autopilot": "ardupilot"}),
    ):
        uav = load_uav(scenario)
        plan = plan_path(scenario, uav.limits, seed=SEED)
        assert ensure_altitude_margin(plan, uav, lambda limits: pytest.fail("searched for another")) is plan
        assert limits_for_alternatives(plan, uav) == uav.limits


def needed(uav: Uav, climbs: float = 0.0) -> float:
    """Height (m) that downdrafts may take from the Zagi in moderate turbulence while it climbs, by plain sums."""
    return 12.0 * (2.33 * GUST - (uav.limits.max_climb_and_sink_rates(GROUND + 80.0)[0] - climbs))


@pytest.mark.parametrize("over", [0.5, -0.5])
def test_a_level_path_keeps_what_a_downdraft_may_take(over: float) -> None:
    uav = load_uav(scenario_of("moderate"))
    height = 50.0 + needed(uav) + over
    scenario = scenario_of("moderate", height=height)
    plan = plan_along(uav, scenario, [scenario.start, scenario.destination])
    assert plan.safe
    settled = ensure_altitude_margin(plan, uav)
    assert (settled is plan) is (over > 0.0)
    assert settled.safe is (over > 0.0)


def test_a_climb_leaves_less_and_the_plan_says_how_much_it_lacks() -> None:
    """At 0.5 m/s of climb 6 m more than level; the leg begins with 30 m above its clearance."""
    uav = load_uav(scenario_of("moderate"))
    steep = 0.5 / uav.airspeed
    way = np.array([[0, 0, 80], [2000, 0, 80], [2000 + 70 / steep, 0, 150], [4000 + 70 / steep, 0, 150]])
    scenario = scenario_from_spec(
        scenario_of("moderate").to_json()
        | {"start": {"east_m": 0, "north_m": 0, "height_m": 150}}
        | {"destination": {"east_m": float(way[-1, 0]), "north_m": 0, "height_m": 150}}
        | {"area": {"east_m": [-3000, 9000], "north_m": [-3000, 3000], "ceiling_amsl_m": GROUND + 800}},
        "gusts",
    )
    plan = plan_along(uav, scenario, way + np.array([0.0, 0.0, GROUND]))
    assert plan.safe
    (problem,) = ensure_altitude_margin(plan, uav).certificate.problems
    lacks = needed(uav, 0.5) - 30.0
    assert (
        f"downdrafts may move the aircraft {lacks:.0f} m into the clearance of 50 m on leg 1. Less turbulence"
        in problem
    )


def test_near_a_low_end_half_is_kept() -> None:
    """15 m above the clearance at both ends no plan keeps 28 m there, and one that climbs from them is taken."""
    scenario = scenario_of("moderate", height=65.0)
    uav = load_uav(scenario)
    asked = list[Limits]()

    def search(limits: Limits) -> Plan:
        asked.append(limits)
        return plan_path(scenario, limits, seed=SEED)

    first = plan_path(scenario, uav.limits, seed=SEED)
    plan = ensure_altitude_margin(first, uav, search)
    assert first.safe
    assert plan.safe
    assert len(asked) == 1
    # Over the middle, far from the ends, it has all that the searched limits keep.
    reserve = min(1.2 * GUST, 0.25 * uav.limits.max_climb_and_sink_rates(float(first.waypoints[:, 2].max()))[0])
    assert asked[0].reserve_climb == pytest.approx(reserve, rel=5e-3)
    assert asked[0].reserve_height == pytest.approx(12.0 * (2.33 * GUST - reserve), rel=5e-3)
    middle = np.interp(4000.0, plan.waypoints[:, 0], plan.waypoints[:, 2]) - GROUND - 50.0
    assert middle >= asked[0].reserve_height + CERTIFIED_BUFFER_M


@pytest.mark.parametrize("over", [0.5, -0.5])
def test_an_end_that_lies_too_low_is_named_and_nothing_is_searched_for(over: float) -> None:
    uav = load_uav(scenario_of("moderate"))
    half = 0.5 * 12.0 * (2.33 * GUST - uav.limits.max_climb_and_sink_rates(GROUND + 64.0)[0])
    scenario = scenario_of("moderate", height=50.0 + half + over)
    found = plan_path(scenario, uav.limits, seed=SEED)
    assert found.safe
    plan = ensure_altitude_margin(
        found, uav, None if over > 0.0 else lambda limits: pytest.fail("searched for another")
    )
    (problem,) = plan.certificate.problems
    assert ("at its start. Less turbulence" in problem) is (over < 0.0)
    assert ("a start that is 1 m higher would help" in problem) is (over < 0.0)


@pytest.mark.parametrize(("away", "safe"), [(1700.0, False), (400.0, True)])
def test_the_whole_is_kept_1500_m_from_an_end(away: float, safe: bool) -> None:
    """A path that sinks to 20 m above its clearance, 8 m less than level flight takes and 6 m more than half of it."""
    uav = load_uav(scenario_of("moderate"))
    scenario = scenario_of("moderate", height=100.0)
    low = [[0, 0, 100], [away, 0, 70], [away + 50, 0, 70], [away + 1550, 0, 100], [8000, 0, 100]]
    plan = plan_along(uav, scenario, np.array(low) + np.array([0.0, 0.0, GROUND]))
    shortfalls = find_shortfalls(plan, uav)
    assert bool(shortfalls) is not safe
    assert {one.hazard for one in shortfalls} <= {"into the clearance of 50 m"}


def test_below_a_height_limit_more_climb_is_left_in_place_of_height() -> None:
    """97 m above ground leave 47 m: less than 39 m and the margins of a search, and more than level flight takes."""
    scenario = scenario_of("moderate", height=65.0, limits={"min_clearance_m": 50.0, "max_height_m": 97.0})
    uav = load_uav(scenario)
    plan = make_plan(scenario, uav, SEED)
    assert plan.safe
    assert not find_shortfalls(plan, uav)
    level = plan_along(uav, scenario, [scenario.start, scenario.destination])
    (problem,) = ensure_altitude_margin(level, uav).certificate.problems
    assert "or a higher limit on the height would help" in problem


@pytest.mark.parametrize(("ground", "enough"), [(3000.0, True), (4600.0, False)])
def test_an_aircraft_that_hardly_climbs_is_not_sent_into_gusts(ground: float, enough: bool) -> None:
    """No height makes up for it where it climbs less than 0.6 standard deviations, 0.92 m/s."""
    far = {
        "terrain": {"kind": "flat", "amsl_m": ground},
        "start": {"east_m": 0, "north_m": 0, "height_m": 300},
        "destination": {"east_m": 8000, "north_m": 0, "height_m": 300},
        "area": {"east_m": [-3000, 11000], "north_m": [-3000, 3000], "ceiling_amsl_m": ground + 800},
    }
    scenario = scenario_from_spec(scenario_of("moderate").to_json() | far, "gusts")
    uav = load_uav(scenario)
    assert (uav.limits.max_climb_and_sink_rates(ground + 300.0)[0] > 0.6 * GUST) is enough
    plan = make_plan(scenario, uav, SEED)
    assert plan.safe is enough
    assert any("0.92 m/s, downdrafts" in one for one in plan.certificate.problems) is not enough


def test_a_leg_counts_with_the_least_climb_that_it_leaves() -> None:
    """A leg that sinks begins where the air is thinner: it leaves less there than at its end, where it is lowest."""
    scenario = scenario_of("moderate", height=100.0)
    uav = load_uav(scenario)
    way = np.array([[0, 0, 780], [6000, 0, 79], [8000, 0, 79]]) + np.array([0.0, 0.0, GROUND])
    (lacks,) = find_shortfalls(plan_along(uav, scenario, way), uav)
    assert lacks.place == "on leg 0"
    assert lacks.depth == pytest.approx(
        12.0 * (2.33 * GUST - uav.limits.max_climb_and_sink_rates(GROUND + 780.0)[0]) - 29.0, abs=0.3
    )


@pytest.mark.parametrize(("from_deg", "sign"), [(270.0, 1.0), (90.0, -1.0)])
def test_a_tailwind_makes_a_climb_faster(from_deg: float, sign: float) -> None:
    """The same slope over the ground takes more climb with the wind, and leaves less against downdrafts."""
    wind = {"speed_mps": 5.0, "from_deg": from_deg, "turbulence": "moderate"}
    scenario = scenario_of("moderate", height=150.0, wind=wind)
    uav = load_uav(scenario)
    slope = 0.03
    way = np.array([[0, 0, 150], [2000, 0, 80], [2000 + 70 / slope, 0, 150], [8000, 0, 150]])
    plan = plan_along(uav, scenario, way + np.array([0.0, 0.0, GROUND]))
    # The guidance keeps the true airspeed, and the wind is the same at every height.
    climbs = slope * (uav.airspeed + sign * 5.0)
    left = min(uav.limits.max_climb_and_sink_rates(GROUND + up)[0] for up in (80.0, 150.0)) - climbs
    (lacks,) = find_shortfalls(plan, uav)
    assert lacks.place == "on leg 1"
    assert lacks.depth == pytest.approx(12.0 * (2.33 * GUST - left) - 30.0, abs=0.5)


SAM = {"name": "sam", "east_m": 4000.0, "north_m": 0.0, "amsl_m": GROUND, "kill_radius_m": 100.0, "kill_scale_m": 50.0}
MAST = {"name": "mast", "kind": "exclusion", "east_m": 4000.0, "north_m": 0.0, "radius_m": 300.0}


@pytest.mark.parametrize(
    ("tables", "into"),
    [
        ({"threats": [SAM]}, "the kill zone of sam"),
        ({"zones": [MAST | {"ceiling_amsl_m": GROUND + 100.0}]}, "mast"),
    ],
    ids=["missile", "zone"],
)
def test_what_lies_below_counts(tables: dict[str, Any], into: str) -> None:
    """20 m above both: a path that high keeps enough above ground, and another is searched for that keeps away."""
    scenario = scenario_of("moderate", height=120.0, **tables)
    uav = load_uav(scenario)
    plan = plan_along(uav, scenario, [scenario.start, scenario.destination])
    assert plan.safe
    (problem,) = ensure_altitude_margin(plan, uav).certificate.problems
    assert f"downdrafts may move the aircraft {needed(uav) - 20.0:.0f} m into {into} on leg 0." in problem
    made = make_plan(scenario, uav, SEED)
    assert made.safe
    assert ensure_altitude_margin(made, uav) is made


@pytest.mark.parametrize("tables", [{"zones": [MAST]}, {"threats": [SAM]}], ids=["zone", "missile"])
def test_what_is_thinner_than_the_height_is_not_jumped_over(tables: dict[str, Any]) -> None:
    """8 m thick and 12 m below a path that may come down by 28 m."""
    zone = {"floor_amsl_m": GROUND + 92.0, "ceiling_amsl_m": GROUND + 100.0}
    sphere = {"amsl_m": GROUND + 96.0, "kill_radius_m": 4.0, "kill_scale_m": 2.0}
    thin = {name: [entries[0] | (zone if name == "zones" else sphere)] for name, entries in tables.items()}
    scenario = scenario_of("moderate", height=112.0, **thin)
    uav = load_uav(scenario)
    plan = plan_along(uav, scenario, [scenario.start, scenario.destination])
    assert plan.safe
    (shortfall,) = find_shortfalls(plan, uav)
    assert shortfall.is_threat
    assert 1.0 < shortfall.depth <= 4.1


def test_near_a_low_end_a_zone_needs_as_little_as_the_ground() -> None:
    """The zone's top is 25 m below the start, and half of what level flight takes is 14 m."""
    mast = {"name": "shed", "kind": "exclusion", "east_m": 0.0, "north_m": 0.0, "radius_m": 100.0}
    zones = [mast | {"ceiling_amsl_m": GROUND + 40.0}]
    scenario = scenario_of("moderate", height=65.0, zones=zones)
    assert make_plan(scenario, load_uav(scenario), SEED).safe


def test_a_search_that_was_cut_short_is_not_taken_for_proof() -> None:
    """Without its end a higher plan would have been found, as it is without a budget."""
    scenario = scenario_of("moderate", height=65.0)
    uav = load_uav(scenario)
    first = plan_path(scenario, uav.limits, seed=SEED)
    whole = make_plan(scenario, uav, SEED)
    assert whole.safe
    assert whole.ended == "completed"
    assert whole.evaluations > first.evaluations
    # A straight line is found at once, and what is left then is less than a population.
    budget = first.evaluations + scenario.planner.population - 1
    table = scenario.planner.model_copy(update={"budget": budget})
    cut = make_plan(replace(scenario, planner=table), uav, SEED)
    assert not cut.safe
    assert cut.ended == "budget"
    assert cut.evaluations == first.evaluations
    searches = iter(["completed", "interrupted"])

    def search(asked: Scenario, limits: Limits) -> Plan:
        found = plan_path(asked, limits, seed=SEED)
        return replace(found, ended=next(searches), certificate=first.certificate, waypoints=first.waypoints)

    shared = SharedBudget(search)
    low = shared(scenario, uav.limits)
    refused = ensure_altitude_margin(low, uav, lambda limits: shared(scenario, limits))
    assert not refused.safe
    assert shared.with_total_evaluations(refused).ended == "interrupted"
    assert shared.with_total_evaluations(refused).evaluations > 2 * first.evaluations


def test_no_other_plan_of_a_front_is_lower() -> None:
    """A path that was found is refused where it lacks height, and nothing is searched for."""
    scenario = scenario_of("moderate", height=70.0)
    uav = load_uav(scenario)
    low = plan_path(scenario, uav.limits, seed=SEED)
    assert low.safe
    assert not finish_plan(low, uav).safe


def test_plans_beside_one_that_leads_above_a_missile_keep_above_it_too() -> None:
    wall = [SAM | {"name": f"sam {k}", "north_m": 150.0 * k} for k in range(-19, 20)]
    scenario = scenario_of("moderate", height=120.0, threats=wall)
    uav = load_uav(scenario)
    plan = make_plan(scenario, uav, SEED)
    assert plan.safe
    kept = limits_for_alternatives(plan, uav)
    assert kept.reserve_threats == kept.reserve_height > 30.0
    beside = replace(scenario, threats=scenario_of("moderate").threats)
    assert limits_for_alternatives(make_plan(beside, uav, SEED), uav).reserve_height > 30.0


@pytest.mark.usefixtures("short_fronts")
def test_every_command_keeps_it_and_a_front_is_not_left_with_one() -> None:
    radar = {"name": "radar", "east_m": 4000.0, "north_m": 500.0, "amsl_m": GROUND}
    reach = {"detection_radius_m": 1500.0, "detection_scale_m": 800.0}
    scenario = scenario_of("moderate", height=70.0, threats=[radar | reach])
    uav = load_uav(scenario)
    front = planfly.plan_front(scenario, 4, seed=SEED)
    assert len(front.plans) >= 3
    assert limits_for_alternatives(front.default.plan, uav).reserve_height > 30.0
    for one in [*(found.plan for found in front.plans), planfly.plan(scenario, seed=SEED)]:
        assert one.safe
        assert ensure_altitude_margin(one, uav) is one


# --- Updrafts ---


def band_of(most: float, autopilot: str = "ardupilot", **tables: Any) -> Scenario:
    """8 km for the X8 over level ground at sea level, at 150 m, below a maximum height, in moderate turbulence."""
    made: dict[str, Any] = {
        "terrain": {"kind": "flat", "amsl_m": 0.0},
        "flight": {"aircraft": "x8", "autopilot": autopilot},
        "limits": {"min_clearance_m": 50.0, "max_height_m": most},
        "wind": {"speed_mps": 0.0, "from_deg": 0.0, "turbulence": "moderate"},
    }
    ends = [[0.0, 0.0, 150.0], [8000.0, 0.0, 150.0]]
    return scenario_from_spec(spec_around(ends, buffer=3000.0, ceiling=800.0) | made | tables, "band")


@pytest.mark.parametrize(
    ("sink", "turbulence", "rise"),
    [
        (2.0, "moderate", 12.0 * (2.33 * GUST - 2.0)),
        (4.0, "moderate", 0.0),
        # With less than 0.6 standard deviations, what one of them makes in a minute.
        (0.9, "moderate", 60.0 * GUST),
        (1.5, "light", 12.0 * (2.33 * 0.5 * GUST - 1.5)),
        (0.0, "none", 0.0),
    ],
)
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "planfly"])
def test_an_updraft_lifts_those_who_keep_their_airspeed(
    sink: float, turbulence: Turbulence, rise: float, autopilot: str
) -> None:
    expected = 0.0 if autopilot == "planfly" else rise
    found = load_uav(band_of(300.0, autopilot)).autopilot.deviations.gust_rise(sink, turbulence)
    assert found == pytest.approx(expected, abs=0.3)


@pytest.mark.parametrize("over", [0.5, -0.5])
def test_a_level_path_leaves_what_an_updraft_may_give(over: float) -> None:
    """Below the maximum height: the rise, and ArduPlane's own error of height."""
    uav = load_uav(band_of(300.0))
    error = uav.limits.tracking
    assert error is not None
    rise = 12.0 * (2.33 * GUST - uav.limits.max_climb_and_sink_rates(150.0)[1])
    assert rise > 5.0
    scenario = band_of(150.0 + rise + error.up + over)
    plan = plan_along(uav, scenario, [scenario.start, [4000.0, 0.0, 150.0], scenario.destination])
    shortfalls = find_shortfalls(plan, uav)
    assert bool(shortfalls) is (over < 0.0)
    assert {one.gust for one in shortfalls} <= {"updrafts"}
    assert ensure_altitude_margin(plan, uav).safe is (over > 0.0)


def test_a_leg_that_sinks_leaves_less() -> None:
    """It begins 40 m below the maximum height, and its sink of 1.4 m/s leaves less than 0.6 standard deviations."""
    scenario = band_of(230.0)
    uav = load_uav(scenario)
    way = np.array([[0, 0, 190], [2000, 0, 190], [3500, 0, 80], [8000, 0, 80]], dtype=np.float64)
    sinks = 110.0 / 1500.0 * uav.limits.performance().airspeed
    assert uav.limits.max_climb_and_sink_rates(190.0)[1] - sinks < 0.6 * GUST
    (shortfall,) = find_shortfalls(plan_along(uav, scenario, way), uav)
    assert shortfall.hazard == "above the allowed 230 m above ground"
    assert shortfall.place in {"on leg 0", "on leg 1"}
    assert shortfall.depth == pytest.approx(60.0 * GUST - 40.0 + uav.limits.tracking.up, abs=5.0)  # type: ignore[union-attr]
    # Without a limit above it nothing is wrong.
    free = scenario_from_spec(band_of(230.0).to_json() | {"limits": {"min_clearance_m": 50.0}}, "free")
    assert not find_shortfalls(plan_along(uav, free, way), uav)


def test_a_zone_above_counts() -> None:
    """1 m less above the path than an updraft gives and ArduPlane strays is too little, 1 m more is enough."""
    over = {"name": "corridor", "kind": "exclusion", "east_m": 4000.0, "north_m": 0.0, "radius_m": 500.0}
    free = {"limits": {"min_clearance_m": 50.0}}
    uav = load_uav(band_of(300.0))
    assert uav.limits.tracking is not None
    rise = 12.0 * (2.33 * GUST - uav.limits.max_climb_and_sink_rates(150.0)[1]) + uav.limits.tracking.up
    for above, wrong in ((rise - 1.0, True), (rise + 1.0, False)):
        scenario = band_of(300.0, zones=[over | {"floor_amsl_m": 150.0 + above}], **free)
        plan = plan_along(uav, scenario, [scenario.start, scenario.destination])
        assert bool(find_shortfalls(plan, uav)) is wrong


@pytest.mark.parametrize("aircraft", ["x8", "zagi", "aerosonde"])
def test_a_search_below_a_maximum_height_leaves_sink_unused(aircraft: str) -> None:
    """At most one standard deviation and 0.6 of the sink that there is, but 0.6 standard deviations at least."""
    scenario = band_of(300.0, flight={"aircraft": aircraft, "autopilot": "ardupilot"})
    uav = load_uav(scenario)
    sink = uav.limits.max_climb_and_sink_rates(150.0)[1]
    plan = plan_along(uav, scenario, [scenario.start, scenario.destination])
    least, share, most = 0.6 * GUST, 0.6 * sink, GUST
    kept = limits_in_gusts(plan, uav).reserve_sink
    assert kept == pytest.approx({"zagi": least, "x8": share, "aerosonde": most}[aircraft], rel=3e-3)
    assert (share < least, share > most) == (aircraft == "zagi", aircraft == "aerosonde")


def test_below_a_zone_alone_the_first_search_keeps_from_it() -> None:
    over = {"name": "corridor", "kind": "exclusion", "east_m": 4000.0, "north_m": 0.0, "radius_m": 500.0}
    scenario = band_of(300.0, zones=[over | {"floor_amsl_m": 165.0}], limits={"min_clearance_m": 50.0})
    uav, asked = load_uav(scenario), list[Limits]()

    def search(limits: Limits) -> Plan:
        asked.append(limits)
        return plan_path(scenario, limits, seed=SEED)

    found = plan_along(uav, scenario, [scenario.start, scenario.destination])
    assert found.safe
    assert ensure_altitude_margin(found, uav, search).safe
    assert [one.reserve_threats > 20.0 for one in asked] == [True]


def test_a_plan_below_a_maximum_height_is_made_anew() -> None:
    """20 m below it at both ends the straight line lacks some metres in the middle, and a plan that sinks is taken.

    11 m below, half of the rise and ArduPlane's error of height are more than there is at the ends.
    """
    scenario = band_of(170.0)
    uav = load_uav(scenario)
    first = plan_path(scenario, uav.limits, seed=SEED)
    assert first.safe
    assert find_shortfalls(first, uav)
    plan = make_plan(scenario, uav, SEED)
    assert plan.safe
    assert not find_shortfalls(plan, uav)
    assert np.interp(4000.0, plan.waypoints[:, 0], plan.waypoints[:, 2]) < 145.0
    (problem,) = make_plan(band_of(161.0), uav, SEED).certificate.problems
    assert "in moderate turbulence, updrafts may move the aircraft" in problem
    assert "above the allowed 161 m above ground at its start" in problem
    assert "an aircraft that sinks faster or a start that is 2 m lower would help" in problem
    held = band_of(164.0)
    (problem,) = ensure_altitude_margin(plan_path(held, uav.limits, seed=SEED), load_uav(held)).certificate.problems
    assert "on leg " in problem
    assert "an aircraft that sinks faster or a higher limit on the height would help" in problem


def test_an_end_too_near_the_maximum_height_is_not_searched_for() -> None:
    scenario = band_of(161.0)
    uav = load_uav(scenario)
    found = plan_path(scenario, uav.limits, seed=SEED)
    assert found.safe
    assert not ensure_altitude_margin(found, uav, lambda limits: pytest.fail("searched for another")).safe


def test_with_a_low_maximum_height_a_gentle_way_down_from_the_ends_is_found() -> None:
    """The Zagi is left 0.7 degrees of sink, and what is kept for updrafts grows no faster from the ends."""
    scenario = band_of(160.0, flight={"aircraft": "zagi", "autopilot": "ardupilot"})
    ends = {name: scenario.to_json()[name] | {"height_m": 134.0} for name in ("start", "destination")}
    for end in ends.values():
        end.pop("amsl_m", None)
    low = scenario_from_spec(scenario.to_json() | ends, "low")
    plan = make_plan(low, load_uav(low), SEED)
    assert plan.safe
