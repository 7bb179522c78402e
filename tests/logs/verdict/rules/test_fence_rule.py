"""Zones kept to and violated, planned and flown, by plain sums on a route of straight legs."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flight.mission.items import Command, Frame, MissionItem
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.places import FLIGHT, MISSION, Place
from tests.logs.verdict.judging import ROUTE, judge, of
from tests.synthetic import edited, fly_path, make_setup
from world.airspace.zones import Cylinder, Zone, ZoneLevel, make_polygon

# Beside the first leg, which leads north from 0 to 2 km at 25 m/s: its western edge is 5 m east of it.
BESIDE = make_polygon([[(5.0, 500.0), (400.0, 500.0), (400.0, 1000.0), (5.0, 1000.0)]])
# The same, over the leg: it is entered at 500 m and left at 1,000 m, 10 m deep.
OVER = make_polygon([[(-10.0, 500.0), (400.0, 500.0), (400.0, 1000.0), (-10.0, 1000.0)]])


def within_zones(*zones: Zone, **how: Any) -> FlightSetup:
    setup = make_setup(ROUTE, **how)
    return replace(setup, scenario=replace(setup.scenario, zones=zones))


def findings(setup: FlightSetup, track: Track | None = None) -> list[Finding]:
    verdict = judge_geometry(setup) if track is None else judge(setup, track)
    return [item for item in verdict.findings if item.rule == "fence"]


def facts(item: Finding) -> dict[str, float]:
    return {fact.what: fact.value for fact in item.facts}


def test_without_zones_there_is_nothing_to_say(setup: FlightSetup, track: Track) -> None:
    assert findings(setup) == findings(setup, track) == []


def test_a_zone_beside_the_path_is_kept_to() -> None:
    (item,) = findings(within_zones(Zone("yard", "exclusion", BESIDE)))
    assert (item.ok, item.place, item.planned, item.unit) == (True, FLIGHT, 0.0, "m")
    assert item.margin == pytest.approx(5.0, abs=0.011)
    # The corridor about the legs is 30 m wide on either side.
    assert facts(item) == pytest.approx({"nearest": 5.0, "less the corridor": -25.0}, abs=0.011)
    assert item.reason.startswith("the zone is not violated; the nearest, yard (exclusion), is 5.0 m away at ")
    assert item.reason.endswith(", within the corridor of 30 m about the legs")


@pytest.mark.parametrize(("nav", "away", "luck"), [("gnss", 4.4, True), ("gnss", 4.6, False), ("perfect", 0.4, False)])
def test_a_zone_passed_by_less_than_navigation_may_be_off_is_luck(nav: Any, away: float, luck: bool) -> None:
    """Three standard deviations of 1.5 m."""
    aside = make_polygon([[(away, 500.0), (400.0, 500.0), (400.0, 1000.0), (away, 1000.0)]])
    setup = replace(within_zones(Zone("yard", "exclusion", aside)), nav=nav)
    for verdict in (judge_geometry(setup), judge(setup, fly_path(setup))):
        assert verdict.flyable
        note = f"passes {away:.1f} m from a zone's limit, less than the navigation error"
        assert (note in verdict.headline) is luck
        reason = of(verdict, "fence", FLIGHT).reason
        assert reason.endswith("; that is less than the navigation error of 4.5 m") is luck


def test_each_zone_that_is_passed_within_the_navigation_error_is_named() -> None:
    """Four zones 3, 4.4, 4.6 and 4.2 m from the path; three standard deviations of 1.5 m are 4.5 m."""
    zones = []
    for number, (side, away) in enumerate(((1, 3.0), (-1, 4.4), (1, 4.6), (-1, 4.2))):
        south, edge, end = 200.0 + 400.0 * number, side * away, side * 400.0
        corners = [(edge, south), (end, south), (end, south + 200.0), (edge, south + 200.0)]
        zones.append(Zone(f"z{number}", "exclusion", make_polygon([corners[::side]])))
    setup = replace(within_zones(*zones), nav="gnss")
    for verdict in (judge_geometry(setup), judge(setup, fly_path(setup))):
        note = "passes 3.0 m from a zone's limit, less than the navigation error (2 other zones, too)"
        assert note in verdict.headline
        reason = of(verdict, "fence", FLIGHT).reason
        others = "z3 (exclusion), 4.2 m away and z1 (exclusion), 4.4 m away"
        assert reason.endswith(f"; that is less than the navigation error of 4.5 m; so are {others}")


def test_the_headline_of_a_flight_states_the_flown_depth() -> None:
    """The planned path is 10 m inside; the flight is 4 m to the west, so 6 m inside."""
    setup = within_zones(Zone("yard", "exclusion", OVER))
    assert "yard (exclusion) violated (10.0 m inside)" in judge_geometry(setup).headline
    flown = judge(setup, fly_path(setup, across=lambda along: -4.0 + 0.0 * along))
    assert "yard (exclusion) violated (6.0 m inside)" in flown.headline


def test_a_planned_path_through_a_zone() -> None:
    far = Zone("far", "exclusion", Cylinder(9000.0, 0.0, 50.0))
    (item,) = findings(within_zones(far, Zone("yard", "exclusion", OVER)))
    assert (item.ok, item.place, item.limit_source) == (False, Place("exclusion", 1, name="yard"), "scenario")
    assert item.planned == pytest.approx(10.0, abs=0.011)
    assert item.margin == pytest.approx(-10.0, abs=0.011)
    known = facts(item)
    assert known["time beyond"] == pytest.approx(20.0, abs=1e-3)
    assert (known["entry north"], known["exit north"]) == pytest.approx((500.0, 1000.0), abs=2e-3)
    assert (known["entry time"], known["exit time"]) == pytest.approx((20.0, 40.0), abs=1e-3)
    assert (known["entries"], known["entry leg"], known["exit leg"], known["entry up"]) == (1, 0, 0, 300.0)
    assert item.brief == "10.0 m inside"
    assert "enters it at 20.0 s on leg 0 (to item 1), east 0 m, north 500 m, 300 m AMSL" in item.reason


def test_a_flight_off_its_path_is_judged_by_its_track() -> None:
    setup = within_zones(Zone("yard", "exclusion", BESIDE))
    clean = fly_path(setup)
    kept = of(judge(setup, clean), "fence")
    assert (kept.ok, kept.margin) == (True, pytest.approx(5.0, abs=0.02))
    east = edited(clean, position=clean.position + np.array([12.0, 0.0, 0.0]))
    (item,) = findings(setup, east)
    assert (item.ok, item.planned) == (False, 0.0)
    assert item.flown == pytest.approx(7.0, abs=0.02)
    assert facts(item)["time beyond"] == pytest.approx(20.0, abs=0.02)
    # The other way round: the plan goes in, and the flight does not.
    setup = within_zones(Zone("yard", "exclusion", OVER))
    kept, item = findings(setup, edited(clean, position=clean.position - np.array([12.0, 0.0, 0.0])))
    assert (kept.ok, kept.place, kept.margin) == (True, FLIGHT, pytest.approx(2.0, abs=0.02))
    assert (item.ok, item.flown, item.place.name) == (True, 0.0, "yard")
    assert item.reason.startswith("the planned path is 10.0 m inside at ")


def test_what_was_planned_is_told_where_the_flight_fails_too() -> None:
    setup = within_zones(Zone("yard", "exclusion", OVER))
    (item,) = findings(setup, fly_path(setup))
    assert (item.planned, item.flown) == pytest.approx((10.0, 10.0), abs=0.02)
    assert ". Details: the planned path is 10.0 m inside at " in item.reason


def test_an_inclusion_that_is_left() -> None:
    # 100 m short of the route's easternmost point, which is its end.
    field = make_polygon([[(-500.0, -500.0), (3400.0, -500.0), (3400.0, 7000.0), (-500.0, 7000.0)]])
    (item,) = findings(within_zones(Zone("field", "inclusion", field)))
    assert (item.ok, item.place) == (False, Place("inclusion", 0, name="field"))
    assert item.planned == pytest.approx(100.0, abs=0.011)
    assert facts(item)["exit leg"] == 3
    assert item.brief == "100.0 m outside"
    assert "leaves it at " in item.reason


def test_heights_above_and_below_a_band_do_not_count() -> None:
    # The first leg is level at 300 m.
    for floor, ceiling, ok, margin in (
        (None, 295.0, True, 5.0),
        (None, 305.0, False, -5.0),
        (305.0, None, True, 5.0),
        (295.0, None, False, -5.0),
    ):
        low, high = (None if level is None else ZoneLevel(level, "ground") for level in (floor, ceiling))
        (item,) = findings(within_zones(Zone("layer", "exclusion", Cylinder(0.0, 1000.0, 200.0), low, high)))
        assert (item.ok, item.margin) == (ok, pytest.approx(margin, abs=0.011))


def test_the_missions_own_fence_is_judged() -> None:
    setup = make_setup(ROUTE)
    middle = 46.0 + 1000.0 / 111_146.0  # a degree of latitude there is 111,146 m
    params = (50.0, 0.0, 0.0, 0.0)
    fence = MissionItem(7, int(Command.NAV_FENCE_CIRCLE_EXCLUSION), int(Frame.GLOBAL), params, middle, 8.0, 0.0)
    setup = replace(setup, mission=replace(setup.mission, fences=(fence,)))
    (item,) = findings(setup)
    assert (item.ok, item.place, item.limit_source) == (False, Place("exclusion", 0, name="fence item 7"), "mission")
    assert item.planned == pytest.approx(50.0, abs=0.02)
    assert facts(item)["time beyond"] == pytest.approx(100.0 / 25.0, abs=1e-3)


def test_a_fence_that_is_none_is_not_judged() -> None:
    setup = make_setup(ROUTE)
    fence = MissionItem(2, int(Command.NAV_FENCE_CIRCLE_EXCLUSION), int(Frame.GLOBAL), (0.0,) * 4, 46.0, 8.0, 0.0)
    (item,) = findings(replace(setup, mission=replace(setup.mission, fences=(fence,))))
    assert (item.ok, item.place) == (None, MISSION)
    assert "fence item 2: radius 0 m" in item.reason


def test_unknown_ground_is_not_judged() -> None:
    setup = within_zones(Zone("low", "exclusion", Cylinder(0.0, 1000.0, 200.0), None, ZoneLevel(120.0, "ground")))
    rest, item = findings(replace(setup, scenario=replace(setup.scenario, terrain=None)))
    assert (item.ok, item.place.name) == (None, "low")
    assert item.reason == "the zone's limits are heights above ground, and the terrain is unknown in places"
    assert rest.ok is True


def test_nothing_flown_is_nothing_judged() -> None:
    setup = within_zones(Zone("yard", "exclusion", OVER))
    track = fly_path(setup)
    (item,) = findings(setup, edited(track, position=np.full_like(track.position, np.nan)))
    assert (item.ok, item.place, item.reason) == (None, FLIGHT, "nothing was flown")


def test_of_several_zones_the_nearest_is_named_and_none_is_entered() -> None:
    far = make_polygon([[(300.0, 500.0), (400.0, 500.0), (400.0, 1000.0), (300.0, 1000.0)]])
    zones = Zone("far", "exclusion", far), Zone("yard", "exclusion", BESIDE)
    setup = within_zones(*zones)
    for item in (findings(setup)[0], findings(setup, fly_path(setup))[0]):
        assert item.reason.startswith("none of 2 zones is violated; the nearest, yard (exclusion), is 5.0 m away")
        assert (item.planned, item.flown or 0.0) == (0.0, 0.0)


def test_a_zone_that_is_touched_within_rounding_is_told_and_kept_to() -> None:
    """The leg leads 15 mm inside its western edge; another zone lies apart."""
    edge = make_polygon([[(-0.015, 500.0), (400.0, 500.0), (400.0, 1000.0), (-0.015, 1000.0)]])
    far = Zone("far", "exclusion", Cylinder(9000.0, 0.0, 50.0))
    setup = within_zones(Zone("edge", "exclusion", edge), far)
    for track in (None, fly_path(setup)):
        kept, item = findings(setup, track)
        assert (kept.ok, item.ok, item.reason) == (True, True, "touches the zone's edge")
        assert kept.planned == pytest.approx(0.015, abs=0.011)
        assert kept.planned > 0.0
        if track is not None:
            assert kept.flown is not None
            assert kept.flown > 0.0


def test_the_plan_is_not_told_beside_itself() -> None:
    (item,) = findings(within_zones(Zone("yard", "exclusion", OVER)))
    assert "the planned path" not in item.reason


def test_of_a_zone_over_unknown_ground_no_distance_is_told() -> None:
    setup = within_zones(Zone("low", "exclusion", Cylinder(0.0, 1000.0, 200.0), None, ZoneLevel(120.0, "ground")))
    rest, _ = findings(replace(setup, scenario=replace(setup.scenario, terrain=None)))
    assert (rest.ok, facts(rest), rest.reason) == (True, {}, "the zone is not violated")
