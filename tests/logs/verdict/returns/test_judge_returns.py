"""What returns over a hill come to, by plain sums; and ranges, worst first."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.mission.items import Command, Frame, MissionItem
from flight.mission.return_path import ReturnPoint
from flight.simulation.setup import FlightSetup
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.places import FLIGHT
from logs.verdict.returns.judge_returns import (
    KINDS,
    Returns,
    ReturnWorld,
    SimulatedReturn,
    engine_out_world,
    judge_returns,
    limit_ratio,
    make_return_world,
    worst_first_key,
)
from logs.verdict.returns.return_starts import ReturnStarts, _ground_phase_starts, planned_starts
from logs.verdict.returns.returns_text import measured_text, outcome_text, return_range_text, returns_headline
from planfly.api.returning import ReturnsResult
from tests.logs.verdict.returns.hill import DEGREE, HEAD, hill_setup, mission_text
from tests.soak import some
from world.errors import MissionError


def judged(setup: FlightSetup, every: float = 4.0, **parameters: float) -> Returns:
    world = make_return_world(setup).with_parameters(**parameters)
    return judge_returns(world, planned_starts(setup, every), every)


def first_of(found: Returns, kind: str) -> float:
    """The place (m east) of the first return that comes to this."""
    return min(one.start[0] for one in found.each if one.kind == kind)


def test_it_hits_the_hill_from_where_the_slope_meets_it(tmp_path: Path) -> None:
    found = judged(hill_setup(tmp_path))
    # The turn leaves it 2 R aside, 243 m at 26.2 m/s and 30 degrees, and half of that over the hill: 126 m from its top
    # it is 366 m high.  100 + 500 * 3000 / x + 3 s * 26 m/s * 500 / x = 366, and 30 m of least height more.
    assert first_of(found, "ground") == pytest.approx((500.0 * 3000.0 + 39_000.0) / 266.0, abs=150.0)
    assert first_of(found, "low") == pytest.approx((500.0 * 3000.0 + 39_000.0) / 289.0, abs=200.0)
    assert {one.kind for one in found.each if one.start[0] < 2000.0} == {"safe"}
    hit = min(found.each, key=worst_first_key)
    assert hit.kind == "ground"
    assert hit.lowest_position[0] == pytest.approx(3300.0, abs=350.0)
    assert hit.target.name == "home"


def test_ranges_are_in_order_and_hold_every_return(tmp_path: Path) -> None:
    found = judged(hill_setup(tmp_path))
    assert sum(one.count for one in found.ranges) == len(found.each)
    kinds = [KINDS.index(one.worst.kind) for one in found.ranges]
    assert kinds == sorted(kinds)
    assert [one.worst.kind for one in found.ranges][:2] == ["ground", "low"]
    setup = hill_setup(tmp_path)
    words = {"ground": "unsafe", "low": "too low", "safe": "safe"}
    for one in found.ranges:
        assert f" s: {words[one.worst.kind]}; the " in return_range_text(one, found, setup.scenario)
        inside = [each for each in found.each if one.first <= each.time <= one.last]
        assert len(inside) == one.count
        assert {each.kind for each in inside} == {one.worst.kind}


def test_rtl_altitude_over_the_hill_is_safe(tmp_path: Path) -> None:
    assert all(one.safe for one in judged(hill_setup(tmp_path), RTL_ALTITUDE=600.0).each)
    assert returns_headline(judged(hill_setup(tmp_path), RTL_ALTITUDE=600.0)).startswith("all ")


def test_a_sphere_and_a_zone_beside_the_way_are_met_and_named(tmp_path: Path) -> None:
    # A return from 6 km passes 1,200 m east at 200 + 400 * 1200 / 6000 m, 49 m aside: 70 m inside the sphere.
    threat = (
        '[[threats]]\nname = "post"\neast_m = 1200\nnorth_m = 0\namsl_m = 280\nkill_radius_m = 120\nkill_scale_m = 50\n'
    )
    found = judged(hill_setup(tmp_path, threat), RTL_ALTITUDE=200.0)
    assert first_of(found, "threat") >= 1200.0
    worst = next(one for one in found.ranges if one.worst.kind == "threat")
    assert worst.worst.sphere_distance == pytest.approx(-70.0, abs=15.0)
    assert "m into the sphere of post" in return_range_text(worst, found, hill_setup(tmp_path, threat).scenario)
    zone = (
        '[[zones]]\nname = "town"\nkind = "exclusion"\nradius_m = 300\neast_m = 1200\nnorth_m = 0\n'
        "ceiling_amsl_m = 300\n"
    )
    met = judged(hill_setup(tmp_path, zone))
    assert met.count("zone") > 20
    assert all(one.start[0] > 900.0 for one in met.each if one.kind == "zone")
    assert met.airspace.zones[next(one for one in met.each if one.zone >= 0).zone].name == "town"
    # Name, depth and place, in each return's text and in the worst return's; the name in the headline.
    worst = next(one for one in met.ranges if one.worst.kind == "zone")
    violation = worst.worst.violation
    assert violation is not None
    assert math.hypot(violation.position[0] - 1200.0, violation.position[1]) < 300.0
    # The zone's ceiling is nearer than its side: a return at up is 300 - up below it.
    assert 0.0 < violation.depth <= 300.0
    text = f"m inside zone town at {violation.position[0]:.0f} m east, {violation.position[1]:.0f} m north"
    scenario = hill_setup(tmp_path, zone).scenario
    for told in (
        return_range_text(worst, met, scenario),
        measured_text(worst.worst, met.limit, scenario),
        outcome_text(worst.worst, met.limit),
    ):
        assert text in told
    assert " violate zone town" in returns_headline(met)
    assert judged(hill_setup(tmp_path, zone), RTL_ALTITUDE=600.0).count("zone") == 0


def test_it_goes_to_the_nearest_rally_point_within_the_limit(tmp_path: Path) -> None:
    point = MissionItem(
        0, Command.NAV_RALLY_POINT, Frame.GLOBAL_RELATIVE_ALT, (0.0,) * 4, 46.0, 8.0 + 6000.0 / DEGREE, 300.0
    )
    found = judged(hill_setup(tmp_path, rally=(point,)))
    # Nearest counts, and home is none of the rally points: 5 km from it, it goes home.
    near = {one.target.name for one in found.each if one.start[0] > 1050.0}
    far = {one.target.name for one in found.each if one.start[0] < 950.0}
    assert (near, far) == ({"rally point 1"}, {"home"})
    assert "beyond RALLY_LIMIT_KM 5" in found.each[0].target.reason
    assert all(one.safe for one in found.each if one.start[0] > 4500.0)


def test_energy_that_is_not_there_is_told(tmp_path: Path) -> None:
    # A return of 6 km takes some 9 Wh, besides what is used before: of 10 Wh 8 may be used.
    found = judged(hill_setup(tmp_path, "[flight]\nbattery_wh = 10\n"), RTL_ALTITUDE=600.0)
    assert [one.kind for one in found.each][-1] == "energy"
    assert found.each[0].kind == "safe"
    assert found.reserve == pytest.approx(2.0)
    ends = [one for one in found.each if one.kind == "energy"]
    assert all(one.energy_left < 2.0 for one in ends)
    assert all(one.energy_left == pytest.approx(10.0 - one.energy_used - one.energy) for one in found.each)


def test_a_return_after_the_battery_is_empty_fails_also_where_nothing_was_flown(tmp_path: Path) -> None:
    """The battery holds half of the mission's energy, and 80 % of this may be used: 40 % of the mission's."""
    setup = hill_setup(tmp_path)
    (needed,) = (one.planned for one in judge_geometry(setup).findings if one.rule == "energy")
    assert needed is not None
    found = judged(replace(setup, battery=0.5 * needed), RTL_ALTITUDE=600.0)
    assert found.each[0].energy_used == 0.0
    # On one straight leg, energy grows evenly with time, up to the energy of the mission.
    last = found.each[-1]
    assert [one.energy_used for one in found.each] == pytest.approx(
        [last.energy_used * one.time / last.time for one in found.each], rel=0.02
    )
    assert last.energy_used == pytest.approx(needed, rel=0.02)
    late = [one for one in found.each if one.energy_used > 0.4 * needed]
    assert {one.kind for one in late} == {"energy"}
    assert "ends with an empty battery" in return_range_text(found.ranges[0], found, setup.scenario)


def test_a_return_after_an_unknown_use_of_energy_is_undecided(tmp_path: Path) -> None:
    setup = hill_setup(tmp_path)
    world, starts = make_return_world(setup).with_parameters(RTL_ALTITUDE=600.0), planned_starts(setup, 20.0)
    known = judge_returns(world, starts, 20.0)
    assert known.safe
    assert "Wh are left" in returns_headline(known)
    starts.energy_used[:] = math.nan
    found = judge_returns(world, starts, 20.0)
    assert {one.kind for one in found.each} == {"used"}
    assert (found.safe, found.undecided, found.point_of_no_return.kind) == (False, True, "used")
    assert returns_headline(found) == (
        f"all {len(starts)} returns cannot be judged by energy, because the energy used before them is unknown"
    )
    # With a guessed battery energy is not judged at all.
    assert judge_returns(replace(world, setup=guessed(setup)), starts, 20.0).safe


def test_a_mission_that_returns_is_asked_up_to_there(tmp_path: Path) -> None:
    found = judged(hill_setup(tmp_path, mission=mission_text(0.0, 6500.0, back=True)))
    assert max(one.start[0] for one in found.each) == pytest.approx(6500.0, abs=150.0)
    assert found.each[-1].time < 270.0


class Stub:
    """A flight in JSBSim that finds each return so much higher, m, and farther outside spheres."""

    def __init__(self, before: Returns, higher: float, farther: float = 0.0) -> None:
        self.before, self.higher, self.farther = before, higher, farther
        self.asked: list[SimulatedReturn] = []

    def __call__(self, _world: object, row: np.record) -> tuple[float, float]:
        one = min(self.before.each, key=lambda one: abs(one.start[0] - float(row["east"])))
        self.asked.append(one)
        return one.clearance + self.higher, one.sphere_distance + self.farther


# So often, s, that many graze the hill, or come within 10 m of the least height over it.
OFTEN = 2.0


@pytest.fixture(scope="module")
def hill(tmp_path_factory: pytest.TempPathFactory) -> tuple[ReturnWorld, ReturnStarts, Returns]:
    world = make_return_world(hill_setup(tmp_path_factory.mktemp("hill")))
    starts = planned_starts(world.setup, OFTEN)
    return world, starts, judge_returns(world, starts, OFTEN)


@pytest.mark.parametrize("higher", some([5.0, 2.0, 9.0, 31.0, 400.0], 3))
def test_a_flight_that_finds_it_higher_makes_that_one_better_alone(
    hill: tuple[ReturnWorld, ReturnStarts, Returns], higher: float
) -> None:
    world, starts, before = hill
    stub = Stub(before, higher)
    after = judge_returns(world, starts, OFTEN, stub)
    asked = {one.time for one in stub.asked}
    # Those within 10 m of the ground or of the required 30 m are flown, each of them.
    distances = {one.time: min(abs(one.clearance), abs(one.clearance - 30.0)) for one in before.each}
    assert asked == {time for time, distance in distances.items() if distance < 10.0}
    assert len(asked) > 8
    in_air = [one for one in stub.asked if max(one.clearance, one.clearance + higher) > 0.0]
    assert after.jsbsim_differences == pytest.approx([higher] * len(in_air))
    for old, new in zip(before.each, after.each, strict=True):
        if old.kind == "ground" and old.time not in asked:
            assert new.kind == "ground"
        if old.time not in asked:
            assert KINDS.index(new.kind) <= KINDS.index(old.kind)
        if old.time in asked and higher <= 10.0:
            # A flight ends at the ground, so that depths below it are not compared.
            hits_in_both = old.clearance + higher <= 0.0
            assert new.clearance == pytest.approx(old.clearance + (0.0 if hits_in_both else higher))
            assert new.kind == ("ground" if new.clearance <= 0.0 else "low" if new.clearance < 29.9 else "safe")
        # So far apart, neither is believed.
        if old.time in asked and higher > 10.0:
            assert new.kind == "unsure"


def test_a_flight_that_finds_it_lower_makes_all_like_it_worse(
    hill: tuple[ReturnWorld, ReturnStarts, Returns],
) -> None:
    world, starts, before = hill
    after = judge_returns(world, starts, OFTEN, Stub(before, -8.0), 2)
    assert after.count("ground") + after.count("low") > before.count("ground") + before.count("low")
    assert after.count("safe") < before.count("safe")
    assert not after.count("unsure")
    # Further apart than it may be: what was flown hits, and nobody knows of the others.
    stub = Stub(before, -50.0)
    far = judge_returns(world, starts, OFTEN, stub, 4)
    assert len(stub.asked) == 4
    assert {one.kind for one in far.each if one.time in {asked.time for asked in stub.asked}} == {"ground"}
    assert far.count("unsure") > 5
    assert "JSBSim disagree" in returns_headline(far)
    # How far it is from a sphere that is far away decides nothing.
    assert not judge_returns(world, starts, OFTEN, Stub(before, 0.0, 2000.0)).count("unsure")
    # What could not be flown stays as it was.
    unflown = judge_returns(world, starts, OFTEN, lambda *_: None)
    assert [(one.kind, one.clearance) for one in unflown.each] == [(one.kind, one.clearance) for one in before.each]


def test_one_deep_in_the_ground_is_sure(hill: tuple[ReturnWorld, ReturnStarts, Returns]) -> None:
    world, starts, before = hill
    # From 6.5 km it is at 100 + 500 * 3078 / 6500 = 337 m where the ground is 366 m high.
    deep = {one.time for one in before.each if one.start[0] > 6200.0}
    assert {(one.kind, one.clearance < -10.0) for one in before.each if one.time in deep} == {("ground", True)}
    stub = Stub(before, 5.0)
    judge_returns(world, starts, OFTEN, stub, 100)
    assert not deep & {one.time for one in stub.asked}


@pytest.mark.parametrize(
    ("clearance", "outside", "is_doubtful"),
    [
        *((9.9, math.inf, True), (10.1, math.inf, False), (19.9, math.inf, False), (20.1, math.inf, True)),
        *((39.9, math.inf, True), (40.1, math.inf, False), (100.0, 34.9, True), (100.0, 35.1, False)),
        (100.0, -34.9, True),
    ],
)
def test_a_return_is_doubtful_within_10_m_of_a_height_and_35_m_of_a_sphere(
    hill: tuple[ReturnWorld, ReturnStarts, Returns], clearance: float, outside: float, is_doubtful: bool
) -> None:
    """With 30 m required: 9.9 m is close to the ground, 20.1 m and 39.9 m to the requirement."""
    safe = next(one for one in hill[2].each if one.kind == "safe")
    one = replace(safe, clearance=clearance, required_height=30.0, sphere_distance=outside)
    assert (limit_ratio(one) < 1.0) is is_doubtful


@pytest.mark.parametrize("changed", [{"roll": 0.3}, {"velocity_east": 3.3}])
def test_no_flight_begins_where_none_can(
    hill: tuple[ReturnWorld, ReturnStarts, Returns], changed: dict[str, float]
) -> None:
    """Banked by 17 degrees, or at 3.3 m/s, where the aircraft stalls at 17."""
    world, starts, _ = hill
    for name, value in changed.items():
        starts.rows[name] = value
    judge_returns(world, starts, OFTEN, lambda *_: pytest.fail("it was flown"))


def climb(first_command: int) -> str:
    """A mission that climbs from 10 m to 100 m over level ground, with the command of its first item."""
    return HEAD + (
        f"1\t0\t0\t{first_command}\t0\t0\t0\t0\t46.0\t8.0010000\t10\t1\n"
        "2\t0\t0\t16\t0\t0\t0\t0\t46.0\t8.0140000\t100\t1\n"
    )


def test_one_that_begins_low_in_a_take_off_is_held_to_what_it_has(tmp_path: Path) -> None:
    """The returns go to 100 m."""
    setup = hill_setup(tmp_path, mission=climb(Command.NAV_TAKEOFF))
    found = judged(setup, 2.0)
    low = [one for one in found.each if one.start[2] < 30.0]
    assert len(low) > 2
    assert all(one.required_height == pytest.approx(one.start[2] - 2.0, abs=0.2) for one in low)
    assert {one.kind for one in found.each} == {"safe"}
    assert "taking off" in return_range_text(found.ranges[0], found, setup.scenario)
    # Down to 15 m over home it is lower than those that begin higher, and than the least height where they begin above.
    sinks = judged(setup, 2.0, RTL_ALTITUDE=15.0)
    assert {one.kind for one in sinks.each if one.start[2] > 20.0} == {"low"}
    assert {one.kind for one in sinks.each if one.start[2] < 14.0} == {"safe"}


def test_a_flight_that_is_too_low_without_a_take_off_excuses_no_return(tmp_path: Path) -> None:
    setup = hill_setup(tmp_path, mission=climb(Command.NAV_WAYPOINT))
    found = judged(setup, 2.0)
    assert {one.required_height for one in found.each} == {30.0}
    assert {one.kind for one in found.each if one.start[2] < 29.0} == {"low"}
    assert {one.kind for one in found.each if one.start[2] > 35.0} == {"safe"}
    # The required height is 30 m, with a tolerance of 1 m.
    count = sum(one.start[2] < 29.0 for one in found.each)
    assert 1 < count < len(found.each)
    assert f" safe; at {count} starts the flight itself is below the required height" in returns_headline(found)
    safe = replace(found, each=tuple(one for one in found.each if one.safe))
    assert "the flight itself" not in returns_headline(safe)
    (low,) = [one for one in found.ranges if one.worst.starts_too_low]
    text = return_range_text(low, found, setup.scenario)
    assert ": too low; " in text
    assert (
        text.partition("Wh")[0].count("(the flight itself is below the required height where this return begins)") == 1
    )
    assert not any("taking off" in return_range_text(one, found, setup.scenario) for one in found.ranges)


def test_a_climb_out_ends_where_the_required_height_is_reached_or_its_leg_ends(tmp_path: Path) -> None:
    """It climbs to 40 m, sinks to 15 m, and the leg after it stays there."""
    way = HEAD + "".join(
        f"{k}\t0\t0\t{22 if k == 1 else 16}\t0\t0\t0\t0\t46.0\t{8.0 + x / DEGREE:.7f}\t{up:g}\t1\n"
        for k, (x, up) in enumerate(((0.0, 10.0), (500.0, 40.0), (1000.0, 15.0), (1500.0, 15.0)), 1)
    )
    found = judged(hill_setup(tmp_path, mission=way), 1.0)
    assert all(one.required_height < 30.0 for one in found.each if one.start[0] < 300.0)
    assert {one.required_height for one in found.each if one.start[0] > 400.0} == {30.0}
    assert {one.kind for one in found.each if one.start[0] > 800.0} == {"low"}


def test_a_lower_flight_never_has_more_safe_returns(tmp_path: Path) -> None:
    """In cruise over the hill, 400 m high, from 40 m above its top down to 2 m; the returns climb to 600 m."""
    counts = []
    for amsl in (440.0, 431.0, 425.0, 415.0, 402.0):
        world = make_return_world(hill_setup(tmp_path, mission=mission_text(2000.0, 4000.0, amsl=amsl)))
        starts = planned_starts(world.setup, 2.0)
        found = judge_returns(world.with_parameters(RTL_ALTITUDE=600.0), starts, 2.0)
        counts.append(found.count("safe"))
        assert not any(one.safe and one.clearance < 29.9 for one in found.each)
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > counts[-1]


def test_what_was_low_before_it_left_the_elevation_file_is_low(tmp_path: Path) -> None:
    world = make_return_world(hill_setup(tmp_path))
    # Home lies 3 km west of the file, which ends at -3000 m, its circle 225 m below the ground here.  From x metres
    # east it sinks 825 m in D = x + 6000 m, 3 s late at 26 m/s: where the file ends it is at -225 + 825 * 3078 / D.
    # That is the least height of 30 m for D = 9960 m, and the ground for 11290 m.
    away = replace(world, home=ReturnPoint(-6000.0, 0.0, -325.0))
    starts = planned_starts(world.setup, 2.0)
    found = judge_returns(away, starts, 2.0)
    assert {one.kind for one in found.each} == {"ground", "low", "unknown"}
    assert first_of(found, "low") == pytest.approx(9960.0 - 6000.0, abs=150.0)
    assert first_of(found, "ground") == pytest.approx(11290.0 - 6000.0, abs=150.0)
    assert all(math.isnan(one.time_to_loiter) for one in found.each)
    assert all((one.kind == "unknown") == (one.clearance > 29.9) for one in found.each)


def test_a_scenario_that_requires_them_fails_where_one_is_not_safe(tmp_path: Path) -> None:
    asked = '[returns]\nrequire = ["rtl"]\n'
    verdict = judge_geometry(hill_setup(tmp_path, asked))
    (failed,) = [one for one in verdict.failed if (one.rule, one.place) == ("return", FLIGHT)]
    assert "hit the ground" in failed.reason
    assert not verdict.flyable
    # Without it only the return after the last item is judged.
    unasked = judge_geometry(hill_setup(tmp_path))
    assert not [one for one in unasked.findings if (one.rule, one.place) == ("return", FLIGHT)]
    # From above the hill and back there is nothing that could be hit.
    near = judge_geometry(hill_setup(tmp_path, asked, mission_text(0.0, 2000.0)))
    assert [one.ok for one in near.findings if (one.rule, one.place) == ("return", FLIGHT)] == [True]


def test_where_it_is_required_one_is_flown_from_each_second(tmp_path: Path) -> None:
    verdict = judge_geometry(hill_setup(tmp_path, '[returns]\nrequire = ["rtl"]\n'))
    (failed,) = [one for one in verdict.failed if (one.rule, one.place) == ("return", FLIGHT)]
    # 6.5 km at the equivalent 25 m/s that are commanded, at 600 m: 1.1560 by 1.2250 kg/m^3 (ISO 2533).
    true_airspeed = 25.0 * math.sqrt(1.2250 / 1.1560)
    assert int(failed.reason.split()[2]) == pytest.approx(6500.0 / true_airspeed, abs=2.0)
    assert failed.method.startswith("one return every 1 s of the route, ")


def test_where_the_ground_is_not_known_it_is_undecided_where_it_is_required(tmp_path: Path) -> None:
    # From no further than 3 km east it leaves the file at more than 57 m: -225 + 825 * 3078 / 9000 m.
    home = f"0\t1\t0\t16\t0\t0\t0\t0\t46.0\t{8.0 - 6000.0 / DEGREE:.7f}\t-325\t1\n"
    way = "QGC WPL 110\n" + home + mission_text(0.0, 2500.0).removeprefix(HEAD)
    found = judge_geometry(hill_setup(tmp_path, '[returns]\nrequire = ["rtl"]\n', way))
    (one,) = [one for one in found.findings if (one.rule, one.place) == ("return", FLIGHT)]
    assert one.ok is None
    assert "fly where the terrain is unknown" in one.reason


def guessed(setup: FlightSetup) -> FlightSetup:
    """The same with a battery of which nobody said what it holds."""
    limits = replace(setup.limits, envelope=replace(setup.envelope, battery_guessed=True))
    return replace(setup, limits=limits)


def test_energy_that_may_not_suffice_is_undecided(tmp_path: Path) -> None:
    """Power with a deviation of 0.4: exp(1.645 x 0.4) = 1.931 times as much at the upper end."""
    setup = hill_setup(tmp_path)
    used = max(one.energy_used + one.energy for one in judged(setup, 20.0, RTL_ALTITUDE=600.0).each)
    limits = replace(setup.limits, envelope=replace(setup.envelope, power_sd=0.4))
    for battery, worst in (
        (1.02 * 1.931 * used / 0.8, "safe"),
        (0.98 * 1.931 * used / 0.8, "power"),
        (0.98 * used / 0.8, "energy"),
    ):
        found = judged(replace(setup, limits=limits, battery=battery), 20.0, RTL_ALTITUDE=600.0)
        assert found.each[-1].kind == worst
        assert {one.kind for one in found.each} <= {"safe", "power", "energy"}
        assert (found.undecided, bool(found.unsafe)) == (worst == "power", worst == "energy")
        assert (found.point_of_no_return.kind == "power") is (worst == "power")


def test_a_guessed_battery_is_not_judged_and_a_note_says_so(tmp_path: Path) -> None:
    setup = hill_setup(tmp_path)
    guess = guessed(setup)
    world, starts = make_return_world(guess), planned_starts(guess, 20.0)
    found = ReturnsResult(guess, judge_returns(world, starts, 20.0))
    assert all(math.isnan(one.energy_left) for one in found.returns.each)
    assert not found.returns.count("energy")
    assert any("the battery capacity is guessed, so energy is not judged" in note for note in found.notes)
    stated = hill_setup(tmp_path, "[flight]\nbattery_wh = 10\n")
    known = guessed(stated)
    found = ReturnsResult(known, judge_returns(make_return_world(known), starts, 20.0))
    assert found.returns.count("energy")
    assert not any("battery" in note for note in found.notes)


def test_without_a_home_there_is_nowhere_to_return_to(tmp_path: Path) -> None:
    setup = hill_setup(tmp_path)
    with pytest.raises(MissionError, match="home: missing"):
        make_return_world(replace(setup, mission=replace(setup.mission, home=None)))


def test_glides_and_returns_with_px4_have_the_airspeeds_of_its_file(tmp_path: Path) -> None:
    """A glide is flown at the user's own least airspeed; other values are the aircraft's."""
    setup = hill_setup(tmp_path)
    own = Px4(Px4Parameters.from_text("FW_AIRSPD_MIN 19.5\nFW_AIRSPD_TRIM 24\nFW_AIRSPD_MAX 30\n", "a.params"))
    world = make_return_world(replace(setup, autopilot=own))
    assert (world.autopilot, world.min_airspeed, world.min_airspeed_name) == (own, 19.5, "FW_AIRSPD_MIN")
    # ArduPlane stands in without an engine.
    of_file = engine_out_world(world).autopilot.parameters
    of_aircraft = engine_out_world(make_return_world(replace(setup, autopilot=Px4(Px4Parameters.defaults()))))
    assert isinstance(of_file, ArduPilotParameters)
    assert [of_file[name] for name in ("AIRSPEED_MIN", "AIRSPEED_CRUISE", "AIRSPEED_MAX")] == [19.5, 24.0, 30.0]
    assert of_aircraft.min_airspeed == 18.0
    assert of_file.roll_limit == of_aircraft.autopilot.turns.max_bank


@pytest.mark.parametrize(("first", "has_take_off"), [(5.0, True), (19.9, True), (20.1, False)])
def test_a_log_without_legs_has_a_take_off_if_it_begins_near_the_ground(
    tmp_path: Path, first: float, has_take_off: bool
) -> None:
    """Over level ground it is at 30 m after 10 s and after 50 s, and lands after 60 s."""
    setup = hill_setup(tmp_path)
    time = np.arange(61.0)
    up = np.interp(time, [0.0, 10.0, 20.0, 40.0, 50.0, 60.0], [first, 30.0, 80.0, 80.0, 30.0, 0.0])
    position = np.stack([np.zeros(61), np.zeros(61), up], axis=1)
    found = time[_ground_phase_starts(setup, time, position, None, time)].tolist()
    assert found == [*(range(10) if has_take_off else ()), *range(45, 61)]


def test_returns_on_either_side_of_the_limit_have_different_heights(tmp_path: Path) -> None:
    """30 m are required, with a tolerance of 0.1 m: 29.93 m are enough and 29.87 m are not, and both are 29.9 m."""
    setup = hill_setup(tmp_path)
    found = judged(setup)
    texts = []
    for clearance, kind in ((29.93, "safe"), (29.87, "low")):
        worst = replace(found.ranges[0].worst, clearance=clearance, required_height=30.0, kind=kind)
        texts.append(return_range_text(replace(found.ranges[0], worst=worst), found, setup.scenario))
        assert f"{clearance} m above ground (required: 30 m, with a tolerance of 0.1 m)" in texts[-1]
    assert "safe; " in texts[0]
    assert "too low; " in texts[1]
