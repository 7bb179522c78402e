"""What can be reached without an engine over a hill, by plain sums: home, a rally point, a landing, flat ground."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flight.mission.items import Command, Frame, MissionItem
from flight.simulation.setup import FlightSetup
from logs.verdict.findings import Finding
from logs.verdict.judge_geometry import judge_geometry
from logs.verdict.places import FLIGHT
from logs.verdict.returns.glides_text import glide_notes, glide_range_text, glides_headline
from logs.verdict.returns.judge_glides import Glides, judge_glides
from logs.verdict.returns.judge_returns import PointOfNoReturn, judge_returns, make_return_world
from logs.verdict.returns.return_starts import planned_starts
from logs.verdict.returns.returns_text import point_of_no_return_text
from tests.logs.verdict.returns.hill import DEGREE, HEAD, hill_setup, mission_text

# Nobody may land within 20 km: without it, all but the hill is flat.
BARRED = (
    '[[zones]]\nname = "town"\nkind = "exclusion"\nradius_m = 20000\neast_m = 3000\nnorth_m = 0\nceiling_amsl_m = 50\n'
)
# ArduPlane's Aerosonde glides 10.4 to 10.8 : 1 at its least airspeed.
RATIO = 10.6


def judged(setup: FlightSetup, every: float = 4.0, **parameters: float) -> Glides:
    return judge_glides(make_return_world(setup).with_parameters(**parameters), planned_starts(setup, every))


def rally(east: float, up: float = 100.0) -> MissionItem:
    return MissionItem(0, Command.NAV_RALLY_POINT, Frame.GLOBAL_RELATIVE_ALT, (0.0,) * 4, 46.0, 8.0 + east / DEGREE, up)


def test_home_is_in_reach_as_far_as_the_height_lasts(tmp_path: Path) -> None:
    """At 600 m, flying away: 8 m are lost in 3 s, some 60 m in the turn, and 30 m are kept."""
    found = judged(hill_setup(tmp_path, BARRED), 2.0)
    home = [one for one in found.each if one.reach == "home"]
    farthest = max(one.start[0] for one in home)
    # Back over 78 m and a turn's width aside; the hill's top, 400 m + 30 m, is 3 km before home and hardly in the way.
    assert farthest == pytest.approx((600.0 - 8.0 - 60.0 - 30.0) * RATIO - 78.0, abs=350.0)
    assert {one.reach for one in found.each if one.start[0] > farthest} == {"nothing"}
    near = min(found.each, key=lambda one: abs(one.start[0] - 1500.0))
    assert near.home_altitude_left == pytest.approx(600.0 - 8.0 - 60.0 - 30.0 - 1578.0 / RATIO, abs=30.0)
    # 50 m further on 5 m less are left, and no start has a turn of its own.
    left = [one.home_altitude_left for one in home if one.start[0] > 500.0]
    assert np.diff(left) == pytest.approx(-50.0 / RATIO, abs=10.0)
    assert [one.kind for one in found.sites] == ["home"]
    assert found.airspeed == 18.0


def test_what_is_reached_falls_from_home_to_flat_ground_to_nothing(tmp_path: Path) -> None:
    open_ground = judged(hill_setup(tmp_path), 4.0)
    assert {one.reach for one in open_ground.each} == {"home", "flat"}
    flat = [one for one in open_ground.each if one.reach == "flat"]
    assert all(0.0 <= one.flat_altitude_left <= 600.0 - 8.0 - 30.0 for one in flat)
    # The hill is no flat ground: 400 m high with a deviation of 300 m it is steeper than 5 % within 850 m.
    assert all(math.dist(one.flat_position[:2], (3000.0, 0.0)) > 800.0 for one in flat)
    barred = judged(hill_setup(tmp_path, BARRED), 4.0)
    assert {one.reach for one in barred.each} == {"home", "nothing"}
    assert all(one.flat_altitude_left == -math.inf and math.isnan(one.flat_position[0]) for one in barred.each)


def test_a_rally_point_and_a_landing_of_the_mission_are_reached(tmp_path: Path) -> None:
    way = HEAD + "".join(
        f"{k}\t0\t0\t{command}\t0\t0\t0\t0\t46.0\t{8.0 + x / DEGREE:.7f}\t{up}\t1\n"
        for k, (command, x, up) in enumerate(((16, 0.0, 600), (16, 6500.0, 600), (21, 8000.0, 0)), 1)
    )
    found = judged(hill_setup(tmp_path, BARRED, way, (rally(7500.0),)), 4.0)
    assert [(one.kind, one.number) for one in found.sites] == [("home", 0), ("rally", 1), ("landing", 3)]
    site = [one for one in found.each if one.reach == "site"]
    assert site
    late = min(site, key=lambda one: one.start[0])
    # Ahead of it, with no turn: the rally point is 500 m nearer than the landing.
    without_rally = judged(hill_setup(tmp_path, BARRED, way), 4.0)
    landing_alone = next(one for one in without_rally.each if one.time == late.time)
    assert late.site_altitude_left - landing_alone.site_altitude_left == pytest.approx(500.0 / RATIO, abs=8.0)
    assert (found.best_site(late), without_rally.best_site(landing_alone)) == (1, 1)
    assert without_rally.sites[1].kind == "landing"
    assert any(": rally point 1 is in reach " in glide_range_text(group, found) for group in found.ranges)
    assert ": the landing at item 3 is in reach " in glide_range_text(found.ranges[-1], found)
    assert "a rally point or landing place, but not home, from " in glides_headline(found)


def test_arduplanes_own_return_ends_where_its_law_says(tmp_path: Path) -> None:
    """It glides straight home, into the hill from behind it, and gets there from before it."""
    found = judged(hill_setup(tmp_path), 4.0)
    before = [one for one in found.each if 500.0 < one.start[0] < 2500.0]
    assert {one.own_return.end for one in before} == {"arrives"}
    assert all(one.own_return.arrival_height > 100.0 for one in before)
    behind = [one for one in found.each if one.start[0] > 5600.0]
    assert {one.own_return.end for one in behind} == {"ground"}
    for one in behind:
        assert one.own_return.shortfall == pytest.approx(math.dist(one.own_return.impact[:2], (0.0, 0.0)), abs=1.0)
        assert one.own_return.shortfall > 600.0
        assert math.isnan(one.own_return.arrival_height)
    # Over the hill, and not by 30 m.
    low = [one.own_return for one in judged(hill_setup(tmp_path), 1.0).each if one.own_return.end == "low"]
    assert low
    assert all(0.0 < one.clearance < 30.0 for one in low)
    assert found.arrival_count == sum(one.own_return.end == "arrives" for one in found.each) > len(before)
    # It is never better than the best there is, but for what the turn gives back of its speed.
    assert all(one.home_altitude_left > -25.0 for one in found.each if one.own_return.end == "arrives")


def test_a_return_that_comes_down_short_of_home_is_no_arrival(tmp_path: Path) -> None:
    """At 150 m, flying away: 8 m and 60 m are lost as above, and (25^2 - 18^2) / 2 g = 15 m are gained by slowing."""
    found = judged(hill_setup(tmp_path, mission=mission_text(0.0, 2000.0, amsl=150.0)), 1.0)
    away = [one for one in found.each if one.start[0] > 300.0]
    short = [one for one in away if one.own_return.end == "ground"]
    assert short[0].start[0] == pytest.approx((150.0 - 8.0 - 60.0 + 15.0) * RATIO - 78.0, abs=150.0)
    # A start is 25.1 m farther each second, at 25 m/s of equivalent airspeed, and so is the place where it comes down.
    shortfalls = [one.own_return.shortfall for one in short[:12]]
    assert shortfalls[0] < 25.1 + 10.0
    assert np.diff(shortfalls) == pytest.approx(25.1, abs=10.0)
    # 30 m of height are 30 * 10.6 m of way.
    last = max(one.start[0] for one in away if one.own_return.end == "arrives")
    assert short[0].start[0] - last == pytest.approx(30.0 * RATIO, abs=60.0)
    assert all(0.0 < one.own_return.arrival_height < 30.0 for one in away if last < one.start[0] < short[0].start[0])
    # The search does not count the 15 m, and the headline and the note say so.
    beyond = sum(one.reach == "flat" for one in found.each if one.own_return.end == "arrives")
    assert beyond > 0
    assert f" ({beyond} of them where the search, which is pessimistic," in glides_headline(found)
    assert any("without the height that excess airspeed gives" in note for note in glide_notes(found))
    texts = [glide_range_text(group, found) for group in found.ranges if group.lowest_glide.own_return.end == "ground"]
    assert any(f"comes down {one.own_return.shortfall:.0f} m from home" in text for one in short for text in texts)


def test_a_sphere_on_the_way_home_stops_its_own_return_and_is_flown_around(tmp_path: Path) -> None:
    threat = (
        '[[threats]]\nname = "post"\neast_m = 900\nnorth_m = 0\namsl_m = 350\nkill_radius_m = 150\nkill_scale_m = 50\n'
    )
    found = judged(hill_setup(tmp_path, threat), 4.0)
    ones = [one for one in found.each if 2400.0 < one.start[0] < 3800.0]
    assert {one.own_return.end for one in ones} == {"threat"}
    assert {one.reach for one in ones} == {"home"}


def test_what_is_not_known_is_said(tmp_path: Path) -> None:
    setup = hill_setup(tmp_path)
    nowhere = replace(setup, scenario=replace(setup.scenario, terrain=None))
    found = judge_glides(make_return_world(nowhere), planned_starts(setup, 20.0))
    assert (found.each, found.not_judged) == ((), "terrain")
    assert glides_headline(found) == "not judged: there is no elevation file"
    assert glide_notes(found) == []
    world = make_return_world(setup)
    without = replace(world, aircraft=world.aircraft._replace(glides=False))
    assert glides_headline(judge_glides(without, planned_starts(setup, 20.0))) == (
        "not judged: the model has no trim with the throttle closed"
    )
    follows = judged(setup, 20.0, TERRAIN_FOLLOW=1)
    assert {one.own_return.end for one in follows.each} == {"not flown"}
    assert {one.reach for one in follows.each} == {"home", "flat"}
    assert "is not simulated" in glides_headline(follows)
    starts = planned_starts(setup, 20.0)
    starts.rows["east"] += 50_000.0
    away = judge_glides(make_return_world(setup), starts)
    assert away.not_judged == "far" or {one.reach for one in away.each} == {"unknown"}


def demanded(folder: Path, more: str = "", mission: str = "", demand: str = '["glide"]') -> Finding:
    """What a verdict says by geometry alone where a scenario requires it."""
    setup = hill_setup(folder, f"{more}[returns]\nrequire = {demand}\n", mission)
    (found,) = [one for one in judge_geometry(setup).findings if (one.rule, one.place) == ("return", FLIGHT)]
    return found


def test_a_scenario_that_requires_it_fails_where_nothing_is_in_reach(tmp_path: Path) -> None:
    # Nobody may land but at home, which a glide from 600 m reaches over 5.2 km, as above.  The 25 m/s are equivalent:
    # with 1.1560 by 1.2250 kg/m^3 (ISO 2533) 25.74 m/s of true airspeed, so that 4.5 km take 174.9 s.
    near, far = (demanded(tmp_path, BARRED, mission_text(0.0, east)) for east in (4500.0, 6500.0))
    assert (near.ok, far.ok) == (True, False)
    assert "without the engine: home can be reached from 175 of 175 positions" in near.reason
    assert "; nothing from " in far.reason
    assert far.method == "one return every 1 s of the route, glides that keep 30 m above ground"
    # Flat ground counts, for it is somewhere to land.
    assert demanded(tmp_path).ok is True
    barred = judge_geometry(hill_setup(tmp_path, BARRED))
    assert not [one for one in barred.findings if (one.rule, one.place) == ("return", FLIGHT)]


def test_just_enough_height_is_enough(tmp_path: Path) -> None:
    setup = hill_setup(tmp_path, BARRED)
    world, starts = make_return_world(setup), planned_starts(setup, 1.0).subset(np.array([60]))

    def lowered(metres: float) -> Glides:
        rows = starts.rows.copy()
        rows["up"] -= metres
        return judge_glides(world, replace(starts, rows=rows))

    spare = 0.0
    for _ in range(3):
        # What is lost on the way changes with the height by hundredths of it.
        spare += lowered(spare).each[0].home_altitude_left
    assert spare > 200.0
    just, hardly = lowered(spare - 0.5), lowered(spare + 0.5)
    assert 0.0 <= just.each[0].home_altitude_left < 1.0
    assert -1.0 < hardly.each[0].home_altitude_left < 0.0
    assert (just.always_reaches_ground, hardly.always_reaches_ground) == (True, False)


def test_both_may_be_required_and_the_worse_counts(tmp_path: Path) -> None:
    both = demanded(tmp_path, demand='["rtl", "glide"]')
    assert both.ok is False
    assert "hit the ground" in both.reason
    assert "; without the engine: home can be reached from " in both.reason
    short = demanded(tmp_path, mission=mission_text(0.0, 2000.0), demand='["glide", "rtl"]')
    assert short.ok is True


def test_taking_off_is_left_out_and_what_is_not_known_is_undecided(tmp_path: Path) -> None:
    """From 10 m to 210 m on 2 km: the least height above ground, 30 m, is reached after 200 m, in 7.96 s; 0 s counts.

    The 25 m/s are equivalent: with 1.2121 by 1.2250 kg/m^3 (ISO 2533, 110 m) 25.13 m/s of true airspeed on the first
    leg, and 25.43 m/s with 1.1836 on the second one, at 355 m.
    """
    rows = ((1, 0.0, 10), (2, 2000.0, 210), (3, 3000.0, 500))
    way = HEAD + "".join(f"{k}\t0\t0\t16\t0\t0\t0\t0\t46.0\t{8.0 + x / DEGREE:.7f}\t{up}\t1\n" for k, x, up in rows)
    found = demanded(tmp_path, mission=way)
    assert "; 8 starts lower than 30 m above ground are omitted" in found.reason
    # 2 km in 79.6 s and 1 km in 39.3 s, and the start.
    assert f" of {119 - 8} positions; " in found.reason
    setup = hill_setup(tmp_path, '[returns]\nrequire = ["glide"]\n')
    bare = replace(setup, scenario=replace(setup.scenario, terrain=None))
    verdict = judge_geometry(bare)
    (unknown,) = [one for one in verdict.findings if (one.rule, one.place) == ("return", FLIGHT)]
    assert unknown.ok is None
    assert unknown.reason == "without the engine: not judged: there is no elevation file"
    # The scenario asks for it: nothing is flyable without.
    assert (verdict.flyable, verdict.undecided, verdict.flies) == (False, True, True)
    assert verdict.headline.endswith("it is not fully known whether the aircraft gets home as the scenario requires")
    homeless = replace(setup, mission=replace(setup.mission, home=None))
    (nowhere,) = [one for one in judge_geometry(homeless).findings if (one.rule, one.place) == ("return", FLIGHT)]
    assert nowhere.ok is None
    assert "home: missing" in nowhere.reason


def test_ranges_hold_every_place_in_order(tmp_path: Path) -> None:
    found = judged(hill_setup(tmp_path), 4.0)
    assert sum(one.count for one in found.ranges) == len(found.each)
    assert [one.first for one in found.ranges] == sorted(one.first for one in found.ranges)
    for group in found.ranges:
        inside = [one for one in found.each if group.first <= one.time <= group.last]
        assert {one.reach for one in inside} == {group.lowest_glide.reach}
        assert found.altitude_left(group.lowest_glide) == min(found.altitude_left(one) for one in inside)
    assert sum(found.count(one) for one in ("home", "flat")) == len(found.each)
    assert "which contains no trees, houses or water" in " ".join(glide_notes(found))


def test_an_engine_that_burns_fuel_has_a_note(tmp_path: Path) -> None:
    setup = hill_setup(tmp_path)
    fuelled = replace(setup, limits=replace(setup.limits, envelope=replace(setup.envelope, volts=0.0)))
    assert any("throttle closed" in note for note in glide_notes(judged(fuelled, 40.0)))
    assert not any("throttle closed" in note for note in glide_notes(judged(setup, 40.0)))


# ----------------------------------------------------------------------
# The point of no return, by energy.


def no_return(setup: FlightSetup, used: float = 0.0, flown: float = 0.0, **parameters: float) -> PointOfNoReturn:
    """Of a flight that had used so many Wh at first, and uses so many in each second."""
    starts = planned_starts(setup, 4.0)
    starts.energy_used[:] = used + flown * starts.time
    return judge_returns(make_return_world(setup).with_parameters(**parameters), starts, 4.0).point_of_no_return


def test_the_point_of_no_return_is_the_last_with_the_reserve(tmp_path: Path) -> None:
    """10 Wh, 2 of them reserve; a return takes some 7 Wh for its circle, and 4 Wh a kilometre."""
    setup = hill_setup(tmp_path, "[flight]\nbattery_wh = 10\n")
    starts = planned_starts(setup, 4.0)
    starts.energy_used[:] = 0.0
    each = judge_returns(make_return_world(setup).with_parameters(RTL_ALTITUDE=600.0), starts, 4.0).each
    point = no_return(setup, flown=0.02, RTL_ALTITUDE=600.0)
    leaves = [one.energy_left - 0.02 * one.time for one in each]
    last = max(one.time for one, left in zip(each, leaves, strict=True) if left >= 2.0)
    assert (point.kind, point.time) == ("later", last)
    assert 0.0 < point.time < each[-1].time
    assert no_return(setup, 9.0, RTL_ALTITUDE=600.0).kind == "at once"
    plenty = hill_setup(tmp_path, "[flight]\nbattery_wh = 100\n")
    never = no_return(plenty, RTL_ALTITUDE=600.0)
    assert never.kind == "never"
    assert math.isnan(never.time)
    assert never.remaining_energy == pytest.approx(100.0 - 10.0 + min(one.energy_left for one in each))


def test_a_return_that_hits_the_ground_after_its_loiter_does_not_leave_the_reserve(tmp_path: Path) -> None:
    """Such a return has a time to its loiter and an energy, but does not arrive."""
    setup = hill_setup(tmp_path, "[flight]\nbattery_wh = 100\n")
    world = make_return_world(setup).with_parameters(RTL_ALTITUDE=600.0)
    found = judge_returns(world, planned_starts(setup, 4.0), 4.0)
    first = found.each[0]
    assert math.isfinite(first.time_to_loiter + first.energy_left)
    crashed = replace(found, each=(replace(first, kind="ground"), *found.each[1:]))
    assert (found.point_of_no_return.skipped_count, crashed.point_of_no_return.skipped_count) == (0, 1)
    assert "every return that arrives leaves" in point_of_no_return_text(crashed)


def test_more_wind_against_the_way_back_brings_it_nearer(tmp_path: Path) -> None:
    """The wind blows away from home: back it is slower, and takes longer."""
    away = []
    for wind in (0, 5, 10):
        weather = f"[flight]\nbattery_wh = 30\n[wind]\nspeed_mps = {wind}\nfrom_deg = 270\n"
        setup = hill_setup(tmp_path, weather)
        point, starts = no_return(setup, RTL_ALTITUDE=600.0), planned_starts(setup, 4.0)
        assert point.kind == "later"
        away.append(float(starts.rows["east"][starts.time == point.time][0]))
    assert away[0] > away[1] + 200.0 > away[2] + 400.0


def test_what_is_not_known_of_energy_is_said(tmp_path: Path) -> None:
    setup = hill_setup(tmp_path)
    unknown = planned_starts(setup, 20.0)
    unknown.energy_used[:] = math.nan
    returns = judge_returns(make_return_world(setup), unknown, 20.0)
    assert returns.point_of_no_return.kind == "used"
    assert "the energy used before is unknown" in point_of_no_return_text(returns)
    guessed = replace(setup, limits=replace(setup.limits, envelope=replace(setup.envelope, battery_guessed=True)))
    assert no_return(guessed).kind == "battery"
    # From behind the hill, into it: what does not arrive is left out.
    found = no_return(setup)
    assert found.kind == "never"
    assert found.skipped_count > 0
    starts = planned_starts(setup, 20.0)
    starts.energy_used[:] = 0.0
    deep = starts.subset(np.flatnonzero(starts.rows["east"] > 6000.0))
    none = judge_returns(make_return_world(setup), deep, 20.0)
    assert none.point_of_no_return.kind == "arrives"
    assert point_of_no_return_text(none).endswith("because no return arrives")
