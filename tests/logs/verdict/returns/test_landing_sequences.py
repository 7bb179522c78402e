"""Ways to a landing sequence over the hill, by plain sums; and what is said of a landing, which is not judged."""

from pathlib import Path

import numpy as np
import pytest

from logs.verdict.judge_flight import judge_geometry
from logs.verdict.places import FLIGHT
from logs.verdict.returns.drawn_returns import min_safe_altitudes
from logs.verdict.returns.judge_returns import Returns, judge_returns, make_return_world, required_heights
from logs.verdict.returns.return_starts import planned_starts
from logs.verdict.returns.returns_text import describe_return_causes, describe_rtl_ending, returns_headline
from logs.verdict.returns.suggest_returns import (
    Remedy,
    meets_return_limits,
    suggest_parameters,
    suggest_rally_points,
)
from planfly.workflow.open_flight import open_flight
from tests.logs.verdict.returns.hill import DEGREE, HEAD, hill_setup, mission_text
from tests.logs.verdict.returns.valley import valley_mission

EVERY = 4.0


def row(number: int, command: int, east: float = 0.0, amsl: float = 0.0, north: float = 0.0, p2: float = 0.0) -> str:
    """A line of a mission file; without a place, one of a command that has none."""
    lat, lon = (46.0 + north / 111_150.0, 8.0 + east / DEGREE) if east or amsl else (0.0, 0.0)
    return f"{number}\t0\t0\t{command}\t0\t{p2:g}\t0\t0\t{lat:.7f}\t{lon:.7f}\t{amsl:g}\t1\n"


# Over the hill at 600 m to 5 km; a landing sequence that begins 6 km east, at 100 m.
WAY = HEAD + row(1, 16, 10.0, 600.0) + row(2, 16, 5000.0, 600.0)
LANDING = WAY + row(3, 189) + row(4, 16, 6000.0, 100.0) + row(5, 21, 7000.0, 1.0)


def judged(folder: Path, mission: str = LANDING, more: str = "", **parameters: float) -> Returns:
    setup = hill_setup(folder, more, mission)
    world = make_return_world(setup).with_parameters(**parameters)
    starts = planned_starts(setup, EVERY)
    return judge_returns(world, starts.subset(np.flatnonzero(starts.rows["east"] < 4900.0)), EVERY)


def reaches(found: Returns, kind: str) -> float:
    """The last place (m east) before the hill's top whose return comes to this."""
    return max(one.start[0] for one in found.each if one.kind == kind and one.start[0] < 3000.0)


def test_it_flies_straight_to_the_landing_sequence_over_what_is_between(tmp_path: Path) -> None:
    found = judged(tmp_path, RTL_AUTOLAND=2)
    assert {one.target.name for one in found.each} == {"the landing sequence at item 4"}
    # From x it sinks 500 m in D = 6000 - x metres, 3 s late at 26 m/s: at the hill, 3000 m before the end, it is at
    # 100 + 500 * (3000 + 78) / D.  That is the hill's 400 m for D = 5130 m, and 30 m more for D = 4664 m.
    assert reaches(found, "ground") == pytest.approx(6000.0 - 5130.0, abs=150.0)
    assert reaches(found, "low") == pytest.approx(6000.0 - 4664.0, abs=150.0)
    assert all(one.safe for one in found.each if one.start[0] > 1500.0)
    assert describe_rtl_ending(found)[0] == (
        "RTL_AUTOLAND 2: a return flies straight to the landing sequence at item 4; RTL_ALTITUDE has no effect"
    )
    assert found.trials_text == "RTL_AUTOLAND, RTL_ALTITUDE, climb"
    assert not found.safe
    assert returns_headline(found).endswith("are safe; the landing is not judged")


@pytest.mark.parametrize(("amsl", "kind"), [(20.0, "safe"), (-30.0, "ground")])
def test_the_approach_after_the_first_item_may_be_low_but_not_in_the_ground(
    tmp_path: Path, amsl: float, kind: str
) -> None:
    """The required height is 30 m; the ground there is at 0 m."""
    lower = WAY + row(3, 189) + row(4, 16, 6000.0, 100.0) + row(5, 16, 7000.0, amsl) + row(6, 21, 8000.0, 1.0)
    found = judged(tmp_path, lower, RTL_AUTOLAND=2)
    # A return from further east cannot sink to these heights.
    assert {one.kind for one in found.each if 1500.0 < one.start[0] < 2500.0} == {kind}
    # The hill before the first item is judged as before.
    assert reaches(found, "ground") >= 700.0


# From 100 m at 6 km down to 20 m at 7 km, where 30 m are required and the ground is at 0 m.
THROUGH_THE_LIMIT = WAY + row(3, 189) + row(4, 16, 6000.0, 100.0) + row(5, 16, 7000.0, 20.0) + row(6, 21, 8000.0, 1.0)


def test_no_more_height_is_required_in_a_landing_sequence_than_the_sequence_itself_has(tmp_path: Path) -> None:
    """It loses 8 m in 100 m, and so in 5 s at ground speed v 0.4 v; a return loses 2 m more in its turn."""
    setup = hill_setup(tmp_path, "", THROUGH_THE_LIMIT)
    starts = planned_starts(setup, 1.0)
    heights = required_heights(make_return_world(setup), starts)
    checked = 0
    for start, height in zip(starts.rows, heights.tolist(), strict=True):
        if 6150.0 < start["east"] < 6800.0:
            own = 100.0 - 0.08 * (float(start["east"]) - 6000.0) - 0.4 * float(start["velocity_east"])
            if abs(own - 30.0) > 1.0:
                assert height == pytest.approx(30.0 if own > 30.0 else own - 2.0, abs=1.0)
                checked += 1
    assert checked > 15


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_no_return_is_too_low_where_a_landing_sequence_passes_the_required_height(
    tmp_path: Path, autopilot: str
) -> None:
    setup = hill_setup(tmp_path, f'[flight]\nautopilot = "{autopilot}"\n', THROUGH_THE_LIMIT)
    world, starts = make_return_world(setup), planned_starts(setup, 0.25)
    if autopilot == "ardupilot":
        world = world.with_parameters(RTL_AUTOLAND=2)
    east, up = starts.rows["east"], starts.rows["up"]
    in_sequence = starts.subset(np.flatnonzero((east > 6100.0) & (up > 25.0) & (up < 40.0)))
    found = judge_returns(world, in_sequence, 0.25)
    assert len(found.each) > 20
    assert {one.kind for one in found.each} == {"safe"}
    # Some of them sink below 30 m from above.
    assert any(one.clearance < 30.0 < one.start[2] for one in found.each)


@pytest.mark.parametrize("value", [1, 2])
def test_suggestions_and_drawn_altitudes_judge_an_approach_as_the_verdict_does(tmp_path: Path, value: int) -> None:
    """Over the valley no return before the approach comes near the 30 m."""
    setup = open_flight(valley_mission(tmp_path), {"terrain": "jacksboro"})
    world = make_return_world(setup).with_parameters(RTL_AUTOLAND=value)
    starts = planned_starts(setup, EVERY)
    east = starts.rows["east"]
    starts = starts.subset(np.flatnonzero(east > east.max() - 1900.0))
    assert {one.kind for one in judge_returns(world, starts, EVERY).each} == {"safe"}
    assert meets_return_limits(world, starts).all()
    assert suggest_parameters(world, starts) == []
    assert suggest_rally_points(world, starts) is None
    # The valley floor and 30 m: below the mission's altitude everywhere.
    altitudes = min_safe_altitudes(world, starts).altitude
    assert np.all((altitudes > 325.0 + 25.0) & (altitudes < 356.0 + 30.0 + 15.0))


def test_another_ending_is_suggested_where_the_altitude_has_no_effect(tmp_path: Path) -> None:
    """Straight to the landing sequence, returns from the near side meet the hill; home lies on the near side."""
    setup = hill_setup(tmp_path, "", LANDING)
    world, starts = make_return_world(setup).with_parameters(RTL_AUTOLAND=2), planned_starts(setup, 8.0)
    near = starts.subset(np.flatnonzero(starts.rows["east"] < 2000.0))
    assert suggest_parameters(world, near) == [Remedy({"RTL_AUTOLAND": 3.0})]
    # Returns from beyond the hill to 30 m need a height, too.
    world = world.with_parameters(RTL_ALTITUDE=30.0)
    far = starts.subset(np.flatnonzero(starts.rows["east"] < 4900.0))
    (found,) = suggest_parameters(world, far)
    assert sorted(found.parameters) == ["RTL_ALTITUDE", "RTL_AUTOLAND"]
    assert found.parameters["RTL_AUTOLAND"] == 3.0
    assert all(one.safe for one in judge_returns(found.apply_to(world), far, 8.0).each)


def test_rally_points_are_found_before_a_low_approach(tmp_path: Path) -> None:
    """A return to home goes on through the hill, 400 m high; from a rally point east of it, it does not."""
    lower = WAY + row(3, 189) + row(4, 16, 6000.0, 100.0) + row(5, 16, 7000.0, 10.0) + row(6, 21, 8000.0, 1.0)
    setup = hill_setup(tmp_path, mission=lower)
    world, starts = make_return_world(setup).with_parameters(RTL_AUTOLAND=1), planned_starts(setup, 20.0)
    starts = starts.subset(np.flatnonzero((starts.rows["east"] > 3800.0) & (starts.rows["east"] < 4900.0)))
    assert {one.kind for one in judge_returns(world, starts, 20.0).each} == {"ground"}
    remedy = suggest_rally_points(world, starts)
    assert remedy is not None
    assert remedy.rally is not None
    assert len(remedy.rally) == 1
    # The lowest altitude that is tried is 45 m above the ground, and from there the approach is flown.
    assert remedy.rally[0].up < 100.0
    assert {one.kind for one in judge_returns(remedy.apply_to(world), starts, 20.0).each} == {"safe"}


def test_it_goes_on_from_its_circle_to_the_landing_sequence(tmp_path: Path) -> None:
    # At 100 m over home it comes home safely from before the hill, and goes on at 100 m into the hill, 400 m high.
    stays = judged(tmp_path, RTL_AUTOLAND=0)
    assert {one.kind for one in stays.each if one.start[0] < 2000.0} == {"safe"}
    found = judged(tmp_path, RTL_AUTOLAND=1)
    assert {one.kind for one in found.each} == {"ground"}
    assert found.each[0].target.name == "home, and on to the landing sequence at item 4"
    assert found.each[0].lowest_position[0] == pytest.approx(2600.0, abs=200.0)
    # From 600 m over home it is over the hill at 100 + 500 * 3000 / 6000 m, and hits it; from 900 m at 500 m.
    assert {one.kind for one in judged(tmp_path, RTL_AUTOLAND=1, RTL_ALTITUDE=600).each} == {"ground"}
    high = judged(tmp_path, RTL_AUTOLAND=1, RTL_ALTITUDE=900)
    assert {one.kind for one in high.each} == {"safe"}
    assert min(one.clearance for one in high.each) == pytest.approx(100.0, abs=25.0)
    assert high.safe
    assert returns_headline(high).startswith(f"all {len(high.each)} returns are safe up to their landing: ")
    assert returns_headline(high).endswith("; the landing is not judged")


@pytest.mark.parametrize("value", [1, 2, 4])
def test_without_a_landing_sequence_a_return_stays_in_its_circle(tmp_path: Path, value: int) -> None:
    alone, found = judged(tmp_path, WAY), judged(tmp_path, WAY, RTL_AUTOLAND=value)
    assert [(one.kind, one.target) for one in found.each] == [(one.kind, one.target) for one in alone.each]
    assert describe_rtl_ending(found)[0].startswith(f"RTL_AUTOLAND {value}: ")
    assert not found.unjudged_parts


def test_a_mission_with_a_landing_sequence_is_judged_with_a_setting_that_arms(tmp_path: Path) -> None:
    """ArduPlane's default, 0, does not arm with DO_LAND_START."""
    assumed = "RTL_AUTOLAND 1 (assumed: with 0 ArduPlane does not arm): from its loiter"
    assert describe_rtl_ending(judged(tmp_path))[0].startswith(assumed)
    # A value that is stated is not assumed.
    assert describe_rtl_ending(judged(tmp_path, RTL_AUTOLAND=1))[0].startswith("RTL_AUTOLAND 1: from its loiter")


def test_what_each_value_says(tmp_path: Path) -> None:
    said = [describe_rtl_ending(judged(tmp_path, RTL_AUTOLAND=value))[0] for value in range(5)]
    assert "ArduPlane does not arm" in said[0]
    assert said[1].endswith("from its loiter a return continues to the landing sequence at item 4")
    assert "for go-arounds only" in said[3]
    assert judged(tmp_path, RTL_AUTOLAND=3).each[0].target.name == "home"
    by_path = judged(tmp_path, RTL_AUTOLAND=4)
    assert by_path.unjudged_parts == ("return path",)
    assert not by_path.safe


def test_it_goes_to_the_nearest_of_two(tmp_path: Path) -> None:
    two = LANDING + row(6, 189) + row(7, 31, -500.0, 100.0, 100.0, 150.0) + row(8, 21, -1500.0, 1.0)
    found = judged(tmp_path, two, RTL_AUTOLAND=2)
    # 3D distances from x at 600 m to 6000 m and to -500 m, both at 100 m: equal at 2750 m.
    for one in found.each:
        if abs(one.start[0] - 2750.0) > 20.0:
            assert one.target.name == f"the landing sequence at item {7 if one.start[0] < 2750.0 else 4}"
    assert found.each[0].target.reason == "item 7 begins the nearest of 2 landing sequences"
    # Its first place is a loiter: flown around at its height, 99 m over the ground.
    assert found.each[0].kind == "safe"
    assert found.each[0].clearance == pytest.approx(100.0, abs=8.0)


def test_a_landing_itself_is_not_judged(tmp_path: Path) -> None:
    mission = WAY + row(3, 189) + row(4, 21, 6000.0, 1.0)
    found = judged(tmp_path, mission, RTL_AUTOLAND=2)
    assert (found.each, found.unjudged_parts) == ((), ("landing",))
    assert returns_headline(found) == "not judged: the landing sequence begins with the landing itself"
    assert found.undecided
    # The way to the circle is.
    to_circle = judged(tmp_path, mission, RTL_AUTOLAND=1, RTL_ALTITUDE=600)
    assert {one.kind for one in to_circle.each} == {"safe"}
    assert (to_circle.safe, to_circle.undecided) == (False, True)


def test_a_battery_that_lands_goes_another_way_than_rtl(tmp_path: Path) -> None:
    both = judged(tmp_path, RTL_AUTOLAND=0, RTL_ALTITUDE=600, BATT_FS_LOW_ACT=2, BATT_MONITOR=4, BATT_LOW_VOLT=14)
    names = ["home", "the landing sequence at item 4"]
    assert sorted({one.target.name for one in both.each}) == names
    kinds = {name: {one.kind for one in both.each if one.target.name == name} for name in names}
    assert kinds["home"] == {"safe"}
    assert "ground" in kinds["the landing sequence at item 4"]
    lines = describe_return_causes(both.causes)
    assert "landing after battery low (BATT_FS_LOW_ACT 2): the aircraft lands by its landing sequence" in lines
    assert "the mission's end: the aircraft has landed" in lines[-1]
    # Nothing triggers it, and it is not flown.
    unset = judged(tmp_path, RTL_AUTOLAND=0, BATT_FS_LOW_ACT=2, BATT_MONITOR=0)
    assert {one.target.name for one in unset.each} == {"home"}
    assert (
        "battery low (BATT_FS_LOW_ACT 2): set, but no threshold triggers it" in describe_return_causes(unset.causes)[-1]
    )


def test_mode_autoland_is_not_judged(tmp_path: Path) -> None:
    found = judged(tmp_path, WAY, FS_LONG_ACTN=5, RTL_ALTITUDE=600)
    assert found.unjudged_parts == ("autoland",)
    assert {one.kind for one in found.each} == {"safe"}
    assert (found.safe, found.undecided) == (False, True)


@pytest.mark.parametrize(
    ("name", "value"), [("ARSPD_TYPE", 0), ("ARSPD_ENABLE", 0), ("ARSPD_USE", 0), ("SOAR_ENABLE", 1), ("ALT_OFFSET", 9)]
)
def test_returns_with_settings_that_are_not_simulated_are_never_called_safe(
    tmp_path: Path, name: str, value: float
) -> None:
    """The sensor's throttle is in `_update_throttle_with_airspeed`; without a sensor another function sets it."""
    found = judged(tmp_path, WAY, RTL_ALTITUDE=600, **{name: value})
    assert {one.kind for one in found.each} == {"safe"}
    assert (found.safe, found.undecided) == (False, True)
    assert returns_headline(found).startswith(f"not judged in full ({name} {value}")
    assert judged(tmp_path, WAY, RTL_ALTITUDE=600).safe


def test_returns_that_follow_the_terrain_are_not_judged(tmp_path: Path) -> None:
    for bits in (1, 16):
        found = judged(tmp_path, TERRAIN_FOLLOW=bits)
        assert (found.each, found.unjudged_parts, found.safe, found.undecided) == ((), ("terrain",), False, True)
    # Bits of other modes change nothing.
    assert judged(tmp_path, WAY, TERRAIN_FOLLOW=2 + 8).unjudged_parts == ()


@pytest.mark.parametrize(("home", "ok"), [(49.9, True), (50.1, False)])
def test_returns_to_a_home_far_above_the_ground_are_not_judged_in_full(tmp_path: Path, home: float, ok: bool) -> None:
    """The ground at home is at 0 m: an aircraft that is armed there returns 50 m lower."""
    head, item = HEAD.splitlines(keepends=True)[:2], row(1, 16, 10.0, 600.0) + row(2, 16, 5000.0, 600.0)
    fields = head[1].split("\t")
    mission = head[0] + "\t".join([*fields[:10], f"{home}", *fields[11:]]) + item.replace("\t0\t0\t16", "\t0\t3\t16")
    found = judged(tmp_path, mission, RTL_ALTITUDE=600)
    assert {one.kind for one in found.each} == {"safe"}
    assert (found.safe, found.undecided) == (ok, not ok)
    assert returns_headline(found).startswith("not judged in full (home is 50 m above the ground there; ") is not ok


def test_what_is_not_judged_is_neither_kept_nor_failed_where_it_is_required(tmp_path: Path) -> None:
    law = 'params = "mine.parm"\n'
    for number, (stated, ok) in enumerate(
        [("RTL_ALTITUDE 600\n", True), ("RTL_ALTITUDE 600\nTERRAIN_FOLLOW 1\n", None)]
    ):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "mine.parm").write_text(stated, encoding="utf-8")
        setup = hill_setup(folder, f'[returns]\nrequire = ["rtl"]\n[flight]\nautopilot = "ardupilot"\n{law}', WAY)
        (one,) = [each for each in judge_geometry(setup).findings if (each.rule, each.place) == ("return", FLIGHT)]
        assert one.ok is ok
    # PX4 returns at its own height, or along the mission, which is not simulated.
    for number, (stated, ok) in enumerate([("RTL_TYPE 1\n", True), ("RTL_TYPE 2\n", None)]):
        folder = tmp_path / f"px4-{number}"
        folder.mkdir()
        (folder / "mine.params").write_text(stated, encoding="utf-8")
        demand = '[returns]\nrequire = ["rtl"]\n[flight]\nautopilot = "px4"\nparams = "mine.params"\n'
        px4 = hill_setup(folder, demand, mission_text(0.0, 2000.0))
        (one,) = [each for each in judge_geometry(px4).findings if each.rule == "return"]
        assert one.ok is ok
        assert "by the simulated PX4" in one.method
        assert ("RTL_TYPE 2 returns along the mission" in one.reason) is (ok is None)
