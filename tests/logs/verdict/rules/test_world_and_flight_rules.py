"""Clearance, threats, bounds and the rules about the flight, passing and failing."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track, join_tracks
from logs.verdict.findings import verdict_json
from logs.verdict.judge_flight import judge_flight, judge_geometry, judge_plan_only
from tests.logs.verdict.judging import ROUTE, bad_plan, failing, judge, of
from tests.synthetic import (
    bump,
    copied,
    edited,
    fly_path,
    make_scenario,
    make_setup,
    waypoint_stations,
)


@pytest.fixture(scope="module")
def setup() -> FlightSetup:
    return make_setup(ROUTE)


@pytest.fixture(scope="module")
def track(setup: FlightSetup) -> Track:
    return fly_path(setup)


def test_clearance_is_exact_and_says_where() -> None:
    hill_at = {"kind": "peaks", "peak": [{"east_m": 0.0, "north_m": 3000.0, "height_m": 260.0, "sigma_m": 400.0}]}
    setup = make_setup([[0, 0, 300], [0, 2000, 300], [0, 6000, 300]], terrain=hill_at)
    item = of(judge(setup, fly_path(setup)), "clearance", "leg 1")
    assert item.ok
    ground = setup.scenario.terrain
    assert ground is not None
    least = 300.0 - float(ground.height(0.0, np.linspace(2900.0, 3100.0, 20001)).max())
    assert least == pytest.approx(40.0, abs=0.5)  # the raster cuts the summit a little
    assert item.flown == pytest.approx(least, abs=1e-3)
    assert item.planned == pytest.approx(least, abs=1e-3)
    assert int(item.reason.split("north ")[1].split(" m")[0]) == pytest.approx(3000, abs=20)
    low = make_setup([[0, 0, 285], [0, 2000, 285], [0, 6000, 285]], terrain=hill_at)
    assert failing(judge(low, fly_path(low))) == {("clearance", "leg 1")}
    assert failing(judge_geometry(low)) == {("clearance", "leg 1")}
    dive = fly_path(setup, up=bump(4500.0, -285.0, 300.0))
    assert ("departure", "flight") in failing(judge(setup, edited(dive, position=dive.position - [0, 0, 20.0])))


def test_terrain_that_is_not_there_is_not_judged(setup: FlightSetup, track: Track) -> None:
    blind = replace(setup, scenario=replace(setup.scenario, terrain=None, external=True))
    verdict = judge(blind, track)
    assert verdict.flyable
    assert verdict.summary.split("\n")[0] == "flyable; terrain not judged"
    assert [item.ok for item in verdict.findings if item.rule in ("clearance", "threat", "bounds")] == [None] * 3
    assert "threat" in verdict.summary


def test_off_the_known_terrain_is_not_judged() -> None:
    setup = make_setup(ROUTE)
    small = make_scenario(ROUTE[:2], area_margin=1000.0)
    cut = replace(setup, scenario=replace(setup.scenario, terrain=small.terrain))
    far = edited(fly_path(cut), position=fly_path(cut).position)
    assert of(judge(cut, far), "clearance", "leg 0").ok is True
    holed = small.terrain
    assert holed is not None
    heights = holed.heights.copy()
    heights[:] = np.nan
    nowhere = replace(cut, scenario=replace(cut.scenario, terrain=replace(holed, heights=heights)))
    item = of(judge(nowhere, far), "clearance", "leg 0")
    assert item.ok is None
    assert "off the known terrain" in item.reason


MISSILE = {
    "name": "Alfa",
    "east_m": 300.0,
    "north_m": 1000.0,
    "amsl_m": 300.0,
    "kill_radius_m": 500.0,
    "kill_scale_m": 200.0,
    "detection_radius_m": 700.0,
    "detection_scale_m": 400.0,
}


@pytest.mark.parametrize("rate", [60.0, 30.0, 2.0])
def test_time_and_exposure_inside_a_threat_are_exact(rate: float) -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300], [0, 4000, 300]], threats=[MISSILE])
    verdict = judge(setup, fly_path(setup, rate=rate))
    item = of(verdict, "threat", "Alfa (missile)")
    # A chord 300 m from the centre of a 500 m sphere is 800 m long.
    assert item.ok is False
    assert item.flown == pytest.approx(800.0 / 25.0, abs=1e-3)
    assert item.planned == pytest.approx(800.0 / 25.0, abs=1e-6)
    h, s = 300.0, 400.0
    exposure = 2 * (s / (2 * h**2 * (h**2 + s**2)) + math.atan(s / h) / (2 * h**3)) * 200.0**4 / 25.0
    assert f"exposure {exposure:.3g} s" in item.reason
    radar = of(verdict, "threat", "Alfa (radar)")
    assert radar.ok is True
    assert radar.limit is None
    assert radar.flown == pytest.approx(2 * math.sqrt(700.0**2 - 300.0**2) / 25.0, abs=1e-3)
    assert "threat Alfa (missile) (32.0 s inside)" in verdict.summary


def test_threats_out_of_reach_give_one_finding() -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300]], threats=[MISSILE | {"east_m": 1300.0}])
    items = [item for item in judge(setup, fly_path(setup)).findings if item.rule == "threat"]
    assert [(item.where, item.ok) for item in items] == [("flight", True)]
    assert "800 m away" in items[0].reason


def test_a_flight_into_a_sphere_that_the_plan_avoids_fails() -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300]], threats=[MISSILE | {"east_m": 510.0}])
    assert judge_geometry(setup).flyable
    verdict = judge(setup, fly_path(setup, across=bump(1000.0, 14.0, 60.0)))
    assert ("threat", "Alfa") in failing(verdict)


def test_a_missed_waypoint(setup: FlightSetup) -> None:
    station = float(waypoint_stations(setup)[1])
    near = judge(setup, fly_path(setup, across=bump(station, 8.0, 150.0)))
    far = judge(setup, fly_path(setup, across=bump(station, 20.0, 150.0)))
    assert of(near, "waypoint", "waypoint 1").ok
    assert ("waypoint", "waypoint 1") in failing(far)
    assert of(far, "waypoint", "waypoint 1").flown == pytest.approx(9.1 + 20.0, abs=0.5)
    high = judge(setup, fly_path(setup, up=bump(station, 20.0, 100.0)))
    assert ("waypoint", "waypoint 1") in failing(high)


def test_an_unfinished_flight_is_never_flyable(setup: FlightSetup) -> None:
    verdict = judge_flight(setup, fly_path(setup, stop=3000.0), "ground contact")
    assert not verdict.complete
    assert not verdict.flyable
    assert verdict.summary.startswith("not flyable: completion (the flight ended early: ground contact)")
    assert of(verdict, "slope", "leg 0").ok
    assert of(verdict, "slope", "leg 3").ok is None
    assert of(verdict, "turn", "waypoint 3").ok is None
    assert of(verdict, "waypoint", "waypoint 2").ok is False
    assert of(verdict, "completion").flown == 1.0
    # The same track is not complete even if its recorder says so, nor is a whole one in a damaged log.
    assert not judge(setup, fly_path(setup, stop=3000.0)).complete
    assert not judge(setup, fly_path(setup), whole=False).complete


def test_a_hole_in_the_record(setup: FlightSetup, track: Track) -> None:
    holed = join_tracks([track.rows(0, 3000), track.rows(3100, len(track))])
    assert "rows are missing" in of(judge(setup, holed), "completion").reason


def test_speed(setup: FlightSetup) -> None:
    assert of(judge(setup, fly_path(setup, airspeed=lambda s: 0.0 * s + 0.8)), "speed", "leg 0").ok
    verdict = judge(setup, fly_path(setup, airspeed=lambda s: 0.0 * s + 1.4))
    assert {("speed", f"leg {k}") for k in range(4)} <= failing(verdict)
    fast = make_setup(ROUTE, airspeed=33.0)
    item = of(judge_geometry(fast), "speed", "leg 0")
    assert (item.ok, item.limit, item.limit_source) == (False, 32.0, "aircraft")
    changed = make_setup(ROUTE, speeds=[25.0, 20.0, 25.0, 25.0])
    assert of(judge(changed, fly_path(changed)), "speed", "leg 1").flown == pytest.approx(20.0, abs=0.1)


def test_wind_that_leaves_no_way() -> None:
    setup = make_setup([[0, 0, 300], [0, 2000, 300], [2000, 2000, 300]], wind={"speed_mps": 30.0, "from_deg": 0.0})
    verdict = judge_geometry(setup)
    assert ("speed", "leg 0") in failing(verdict)
    assert "no way" in of(verdict, "speed", "leg 0").reason


def test_energy(setup: FlightSetup) -> None:
    small = replace(setup, battery=30.0)
    verdict = judge(small, fly_path(small))
    assert failing(verdict) == {("energy", "flight")}
    assert of(verdict, "energy").limit == pytest.approx(24.0)


@pytest.mark.parametrize(
    ("column", "value", "word"),
    [("attitude", math.radians(80.0), "bank 80"), ("airspeed", 14.0, "airspeed 14.0"), ("position", math.nan, "rows")],
)
def test_departures(setup: FlightSetup, track: Track, column: str, value: float, word: str) -> None:
    columns = copied(track)
    columns[column][4000 if column != "position" else slice(4000, 4003)] = value
    verdict = judge(setup, Track(**columns))
    assert not verdict.flyable
    item = of(verdict, "departure")
    assert item.ok is False
    assert word in item.reason


def test_an_infeasible_plan_flown_is_not_complete(setup: FlightSetup, track: Track) -> None:
    plan = bad_plan(setup)
    assert not judge(replace(setup, plan=plan), track).complete
    assert not judge_geometry(replace(setup, plan=plan)).flyable


def test_a_plan_that_is_not_feasible(setup: FlightSetup) -> None:
    verdict = judge_plan_only(bad_plan(setup))
    verdict_json(verdict)
    assert not verdict.complete
    assert not verdict.flyable
    assert failing(verdict) == {("slope", "plan"), ("completion", "plan")}
    assert "slope" in verdict.summary.split("\n")[0]
    assert "leg 2: slope 16.6 deg" in verdict.summary
