"""What returns over a hill come to, by plain sums; and ranges, worst first."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flight.mission.items import Command, Frame, MissionItem
from flight.simulation.setup import FlightSetup
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.returns.judge_returns import KINDS, Returns, badness, judge_returns, return_world
from logs.verdict.returns.return_starts import planned_starts
from logs.verdict.returns.returns_text import headline, range_text
from tests.logs.verdict.returns.hill import DEGREE, hill_setup, mission_text
from world.errors import MissionError


def judged(setup: FlightSetup, every: float = 4.0, **parameters: float) -> Returns:
    world = return_world(setup).with_parameters(**parameters)
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
    hit = min(found.each, key=badness)
    assert hit.kind == "ground"
    assert hit.clearance_at[0] == pytest.approx(3300.0, abs=350.0)
    assert hit.target.name == "home"


def test_ranges_are_in_order_and_hold_every_return(tmp_path: Path) -> None:
    found = judged(hill_setup(tmp_path))
    assert sum(one.count for one in found.ranges) == len(found.each)
    kinds = [KINDS.index(one.worst.kind) for one in found.ranges]
    assert kinds == sorted(kinds)
    assert [one.worst.kind for one in found.ranges][:2] == ["ground", "low"]
    for one in found.ranges:
        inside = [each for each in found.each if one.first <= each.time <= one.last]
        assert len(inside) == one.count
        assert {each.kind for each in inside} == {one.worst.kind}


def test_rtl_altitude_over_the_hill_is_safe(tmp_path: Path) -> None:
    assert all(one.safe for one in judged(hill_setup(tmp_path), RTL_ALTITUDE=600.0).each)
    assert headline(judged(hill_setup(tmp_path), RTL_ALTITUDE=600.0)).startswith("all ")


def test_a_sphere_and_a_zone_beside_the_way_are_met_and_named(tmp_path: Path) -> None:
    # A return from 6 km passes 1,200 m east at 200 + 400 * 1200 / 6000 m, 49 m aside: 70 m inside the sphere.
    threat = (
        '[[threats]]\nname = "post"\neast_m = 1200\nnorth_m = 0\namsl_m = 280\nkill_radius_m = 120\nkill_scale_m = 50\n'
    )
    found = judged(hill_setup(tmp_path, threat), RTL_ALTITUDE=200.0)
    assert first_of(found, "threat") >= 1200.0
    worst = next(one for one in found.ranges if one.worst.kind == "threat")
    assert worst.worst.outside == pytest.approx(-70.0, abs=15.0)
    assert "inside the sphere of post" in range_text(worst, found, hill_setup(tmp_path, threat).scenario)
    zone = (
        '[[zones]]\nname = "town"\nkind = "exclusion"\nradius_m = 300\neast_m = 1200\nnorth_m = 0\n'
        "ceiling_amsl_m = 300\n"
    )
    met = judged(hill_setup(tmp_path, zone))
    assert met.count("zone") > 20
    assert all(one.start[0] > 900.0 for one in met.each if one.kind == "zone")
    assert met.airspace.zones[next(one for one in met.each if one.zone >= 0).zone].name == "town"
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
    # A return of 6 km takes some 9 Wh: of 10 Wh 8 may be used.
    found = judged(hill_setup(tmp_path, "[flight]\nbattery_wh = 10\n"), RTL_ALTITUDE=600.0)
    assert [one.kind for one in found.each][-1] == "energy"
    assert found.each[0].kind == "safe"
    assert found.reserve == pytest.approx(2.0)
    ends = [one for one in found.each if one.kind == "energy"]
    assert all(one.left < 2.0 for one in ends)
    assert all(one.left == pytest.approx(10.0 - one.energy) for one in found.each)


def test_a_mission_that_returns_is_asked_up_to_there(tmp_path: Path) -> None:
    found = judged(hill_setup(tmp_path, mission=mission_text(0.0, 6500.0, back=True)))
    assert max(one.start[0] for one in found.each) == pytest.approx(6500.0, abs=150.0)
    assert found.each[-1].time < 270.0


def test_a_flight_in_jsbsim_sets_the_unsure_right(tmp_path: Path) -> None:
    setup = hill_setup(tmp_path)
    world, starts = return_world(setup), planned_starts(setup, 4.0)
    before = judge_returns(world, starts, 4.0)
    asked = []

    def lower(_world: object, row: np.record) -> tuple[float, float]:
        asked.append(float(row["east"]))
        one = min(before.each, key=lambda one: abs(one.start[0] - float(row["east"])))
        return one.clearance - 50.0, one.outside

    after = judge_returns(world, starts, 4.0, lower, 2)
    assert len(asked) == 2
    assert after.again == pytest.approx((-50.0, -50.0))
    assert after.count("ground") > before.count("ground")
    # What could not be flown stays as it was.
    unflown = judge_returns(world, starts, 4.0, lambda *_: None)
    assert [(one.kind, one.clearance) for one in unflown.each] == [(one.kind, one.clearance) for one in before.each]


def test_a_scenario_that_requires_them_fails_where_one_is_not_safe(tmp_path: Path) -> None:
    asked = '[returns]\nrequire = ["rtl"]\n'
    verdict = judge_geometry(hill_setup(tmp_path, asked))
    (failed,) = [one for one in verdict.failed if one.rule == "return"]
    assert "hit the ground" in failed.reason
    assert not verdict.flyable
    assert judge_geometry(hill_setup(tmp_path)).flyable
    # From above the hill and back there is nothing that could be hit.
    near = judge_geometry(hill_setup(tmp_path, asked, mission_text(0.0, 2000.0)))
    assert [one.ok for one in near.findings if one.rule == "return"] == [True]


def test_without_a_home_there_is_nowhere_to_return_to(tmp_path: Path) -> None:
    setup = hill_setup(tmp_path)
    with pytest.raises(MissionError, match="home: none is stated"):
        return_world(replace(setup, mission=replace(setup.mission, home=None)))
