"""Clearance along the planned and the flown path, and less the terrain's stated error, where one is stated."""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup, Heights, ImportedLog
from flight.simulation.track import Track
from logs.recording.reader import read_log
from logs.recording.recorder import Recorder
from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_flight, judge_geometry
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import align_track
from logs.verdict.places import FLIGHT
from logs.verdict.rules.clearance_rule import clearance_findings
from tests.logs.verdict.judging import ROUTE, failing, judge, leg, of
from tests.logs.verdict.rules.test_climbout_approach_rule import with_arduplane
from tests.mission_lines import setup_of, wp
from tests.synthetic import (
    bump,
    edited,
    fly_path,
    make_scenario,
    make_setup,
)
from world.airfield import LandingStrip
from world.arrays import Floats
from world.errors import ScenarioError
from world.scenario_file import parse_scenario
from world.terrain import make_gridded_terrain


def test_clearance_is_exact_and_says_where() -> None:
    hill_at = {"kind": "peaks", "peak": [{"east_m": 0.0, "north_m": 3000.0, "height_m": 260.0, "sigma_m": 400.0}]}
    setup = make_setup([[0, 0, 300], [0, 2000, 300], [0, 6000, 300]], terrain=hill_at)
    item = of(judge(setup, fly_path(setup)), "clearance", leg(1))
    assert item.ok
    ground = setup.scenario.terrain
    assert ground is not None
    least = 300.0 - float(ground.height(0.0, np.linspace(2900.0, 3100.0, 20001)).max())
    assert least == pytest.approx(40.0, abs=0.5)  # the raster cuts the summit a little
    assert item.flown == pytest.approx(least, abs=1e-3)
    assert item.planned == pytest.approx(least, abs=1e-3)
    assert int(item.reason.split("north ")[1].split(" m")[0]) == pytest.approx(3000, abs=20)
    # Nothing is required of a leg that passes.
    assert of(judge_geometry(setup), "clearance", leg(1)).reason == f"{least:.1f} m above ground at the lowest point"
    low = make_setup([[0, 0, 285], [0, 2000, 285], [0, 6000, 285]], terrain=hill_at)
    assert failing(judge(low, fly_path(low))) == {("clearance", leg(1))}
    assert failing(judge_geometry(low)) == {("clearance", leg(1))}
    assert of(judge_geometry(low), "clearance", leg(1)).reason.endswith("m are required")
    dive = fly_path(setup, up=bump(4500.0, -285.0, 300.0))
    assert ("departure", FLIGHT) in failing(judge(setup, edited(dive, position=dive.position - [0, 0, 20.0])))


@pytest.mark.parametrize(
    ("depth", "flown", "text"), [(0.3, 0.0, "on the ground at "), (5.0, -5.0, "5.0 m below ground at ")]
)
def test_the_row_of_a_ground_contact_is_on_the_ground(depth: float, flown: float, text: str) -> None:
    """A track through a summit 260 m high, at its closest this far below it; level ground is 0 m high."""
    hill_at = {"kind": "peaks", "peak": [{"east_m": 0.0, "north_m": 3000.0, "height_m": 260.0, "sigma_m": 400.0}]}
    setup = make_setup([[0, 0, 300], [0, 2000, 300], [0, 6000, 300]], terrain=hill_at)
    track = fly_path(setup)
    height = of(judge(setup, track), "clearance", leg(1)).flown or 0.0
    item = of(judge(setup, edited(track, position=track.position - [0, 0, height + depth])), "clearance", leg(1))
    assert (item.ok, item.flown) == (False, pytest.approx(flown, abs=1e-3))
    assert item.reason.startswith(text)
    assert item.margin == pytest.approx(flown - (item.limit or 0.0), abs=1e-3)


def with_hole(setup: FlightSetup) -> FlightSetup:
    """The setup over ground without data 100 m around the line, from 3000 m to 3500 m north."""
    ground = setup.scenario.terrain
    assert ground is not None
    east, north = np.linspace(-1000.0, 1000.0, 201), np.linspace(-1000.0, 8000.0, 901)
    heights = np.zeros((901, 201))
    heights[400:451, 90:111] = np.nan
    holed = make_gridded_terrain(heights, east, north, source="holed.tif", sha256="", datum="mean sea level")
    return replace(setup, scenario=replace(setup.scenario, terrain=holed))


def test_a_leg_across_a_hole_of_the_terrain_is_not_judged_and_named() -> None:
    setup = with_hole(make_setup([[0, 0, 300], [0, 2000, 300], [0, 6000, 300]]))
    for verdict in (judge_geometry(setup), judge(setup, fly_path(setup))):
        assert of(verdict, "clearance", leg(0)).ok
        open_leg = of(verdict, "clearance", leg(1))
        assert (open_leg.ok, open_leg.margin) == (None, None)
        # The pixel before the hole is 2990 m north; heights between it and the hole depend on the hole.
        assert int(re.findall(r"data .*?north (\d+) m", open_leg.reason)[0]) == pytest.approx(2995, abs=30)
        assert re.search(r"\(latitude \d+\.\d{5}, longitude \d+\.\d{5}\)", open_leg.reason)
        assert open_leg.brief.startswith("leg 1 (to item ")
        assert verdict.answer == "not judged in full"
        assert not verdict.failed


def test_a_leg_that_is_too_low_beside_a_hole_fails() -> None:
    """10 m above level ground from 2000 m to 3000 m and from 3500 m to 6000 m, where 30 m are required."""
    verdict = judge_geometry(with_hole(make_setup([[0, 0, 300], [0, 2000, 10], [0, 6000, 10]])))
    low = of(verdict, "clearance", leg(1))
    assert low.ok is False
    assert low.planned == pytest.approx(10.0, abs=0.1)
    assert low.reason.startswith("leaves the data of holed.tif at east 0 m, north 29")


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
    assert of(judge(cut, far), "clearance", leg(0)).ok is True
    holed = small.terrain
    assert holed is not None
    heights = holed.heights.copy()
    heights[:] = np.nan
    nowhere = replace(cut, scenario=replace(cut.scenario, terrain=replace(holed, heights=heights)))
    item = of(judge(nowhere, far), "clearance", leg(0))
    assert item.ok is None
    assert "outside the terrain data" in item.reason


LEVEL = [[0, 0, 300], [0, 3000, 300]]
STATED = {"kind": "flat", "amsl_m": 230.0, "vertical_error_m": 16.0}


def test_both_levels_show_it_and_it_decides_nothing() -> None:
    setup = make_setup(LEVEL, terrain=STATED, limits={"min_clearance_m": 60.0})
    for verdict in (judge_geometry(setup), judge(setup, fly_path(setup))):
        item = of(verdict, "clearance", leg(0))
        assert item.ok is True
        assert "54.0 m if the terrain's stated error of 16 m is subtracted, less than the 60 m required" in item.reason
        assert (
            "Terrain's stated error: 16 m; the lowest clearance is 70.0 m, or 54.0 m with that error subtracted"
            in verdict.summary
        )
    high = make_setup(LEVEL, terrain=STATED, limits={"min_clearance_m": 50.0})
    assert "than the 50 m required" not in of(judge_geometry(high), "clearance").reason


def test_nothing_is_said_where_none_is_stated() -> None:
    setup = make_setup(LEVEL, terrain={"kind": "flat", "amsl_m": 230.0})
    verdict = judge_geometry(setup)
    assert "stated error" not in verdict.summary + of(verdict, "clearance").reason


def test_a_log_carries_it(tmp_path: Path) -> None:
    setup = make_setup(LEVEL, terrain=STATED)
    track = fly_path(setup)
    with Recorder(tmp_path / "flight.mcap", setup) as recorder:
        recorder.write(track)
        recorder.finish("completed", judge_flight(setup, track, "completed"))
    again = read_log(tmp_path / "flight.mcap").setup.scenario
    assert again.terrain is not None
    assert again.terrain.vertical_error == 16.0


@pytest.mark.parametrize(("value", "said"), [("-1", "allowed 0..1000"), ('"16"', "number"), ("nan", "allowed 0..1000")])
def test_a_bad_value_is_refused(value: str, said: str) -> None:
    text = f'name = "x"\n[terrain]\nkind = "flat"\namsl_m = 0\nvertical_error_m = {value}\n'
    with pytest.raises(ScenarioError, match=r"terrain\.vertical_error_m") as caught:
        parse_scenario(text, "x.toml")
    assert said in str(caught.value)


@pytest.mark.parametrize("share", [0.25, 0.7])
def test_the_lowest_point_between_two_rows_is_told_with_its_time_and_place(share: float) -> None:
    """Rows 5 s and 125 m apart on a course of 60 degrees, and a summit under a point between the eighth and ninth."""
    ahead = np.array([math.sin(math.radians(60.0)), math.cos(math.radians(60.0))])
    run = (8.0 + share) * 125.0
    east, north = (run * ahead).tolist()
    hill = {"kind": "peaks", "peak": [{"east_m": east, "north_m": north, "height_m": 240.0, "sigma_m": 150.0}]}
    setup = make_setup([[0, 0, 300], [*(1500.0 * ahead), 300], [*(3000.0 * ahead), 300]], terrain=hill)
    item = of(judge(setup, fly_path(setup, rate=0.2)), "clearance", leg(0))
    told = re.search(r"at ([\d.]+) s, east (\d+) m, north (\d+) m", item.reason)
    assert told is not None
    assert float(told[1]) == pytest.approx(run / 25.0, abs=0.5)
    assert (float(told[2]), float(told[3])) == (pytest.approx(east, abs=12.0), pytest.approx(north, abs=12.0))


@pytest.mark.parametrize(("high", "ok"), [(300.0, None), (25.0, False)])
def test_where_a_flight_leaves_the_known_terrain_is_told(high: float, ok: bool | None) -> None:
    """Known along half of a leg of 5 km; too low before that is a fault all the same."""
    low = {"kind": "peaks", "peak": [{"east_m": 1000.0, "north_m": 0.0, "height_m": 1.0, "sigma_m": 50.0}]}
    setup = make_setup([[0, 0, high], [0, 5000, high]], terrain=low)
    ground = setup.scenario.terrain
    assert ground is not None
    heights = ground.heights.copy()
    heights[len(heights) // 2 :] = np.nan
    cut = replace(setup, scenario=replace(setup.scenario, terrain=replace(ground, heights=heights)))
    item = of(judge(cut, fly_path(setup)), "clearance", leg(0))
    assert item.ok is ok
    assert item.flown == pytest.approx(high, abs=0.1)
    known = replace(ground, heights=heights).height(np.zeros(5000), np.arange(5000.0))
    assert np.isfinite(known[0])
    north = float(item.reason.split("outside the terrain data at ")[1].split("north ")[1].split(" m")[0])
    assert north == pytest.approx(int(np.flatnonzero(np.isnan(known))[0]), abs=2.0)
    planned = of(judge_geometry(cut), "clearance", leg(0))
    assert planned.ok is ok
    # Of an undecided leg no height is stated.
    assert planned.planned == (None if ok is None else pytest.approx(high, abs=0.1))


def test_less_height_is_asked_for_near_a_field_only_after_the_last_high_waypoint() -> None:
    """100 m are required: of a landing sequence at 30 m only the final has 20 m, and what follows a place at 100 m."""
    mark = "3 189 0 0 0 0 0 0 0"

    def judged(*heights: float) -> dict[int, Finding]:
        ways = [wp(0, 2000 - 400 * k, up) for k, up in enumerate(heights)]
        lines = (wp(0, 5000, 30), mark, *ways, wp(0, 300, 0, command=21))
        setup = setup_of(*lines, home="36.5 -84.2 100", limits={"min_clearance_m": 100.0})
        field = replace(setup.scenario, landing=LandingStrip(0.0, 300.0, math.pi, 400.0))
        verdict = judge_geometry(with_arduplane(replace(setup, scenario=field)))
        return {one.place.index: one for one in verdict.findings if one.rule == "clearance"}

    low = judged(30.0, 30.0, 30.0)
    assert [low[k].ok for k in sorted(low)] == [False, False, False, True]
    assert [low[k].limit for k in (0, 2, 3)] == [100.0, 100.0, 20.0]
    assert (low[2].limit_source, low[3].limit_source) == ("default", "near the field")
    high = judged(100.0, 60.0, 30.0)
    assert [high[k].limit for k in sorted(high)] == [100.0, 20.0, 20.0, 20.0]


@pytest.mark.parametrize(("last", "low_legs"), [(22.0, []), (18.0, [1])])
def test_the_leg_to_a_landing_that_is_not_flown_needs_no_height(last: float, low_legs: list[int]) -> None:
    """Without a [landing] 30 m are required, 20 m near the field, and nothing of the descent to NAV_LAND."""
    lines = (wp(0, 3000, 60), wp(0, 1500, 60), wp(0, 800, last), wp(0, 300, 0, command=21))
    verdict = judge_geometry(with_arduplane(setup_of(*lines, home="36.5 -84.2 100")))
    found = {one.place.index: one for one in verdict.findings if one.rule == "clearance"}
    assert sorted(found) == [0, 1]
    assert [k for k, one in found.items() if not one.ok] == low_legs
    assert {one.ok for one in verdict.findings if one.rule in ("landing", "approach")} == {True}


def logged(setup: FlightSetup) -> FlightSetup:
    """The same mission, flown in an imported log by a named aircraft."""
    source = ImportedLog("a.tlog", "", "telemetry log", heights=Heights("GPS", "amsl"), aircraft_known=True)
    return replace(setup, imported_log=source)


def test_the_take_off_and_the_landing_of_a_log_need_no_height() -> None:
    """It climbs from the ground within 400 m of home, and touches down at the landing point."""
    take_off = "3 22 15 0 0 0 0 0 50"
    lines = (take_off, wp(0, 3000, 60), wp(0, 5000, 60), wp(3000, 5000, 60), wp(4000, 5000, 0, command=21))
    setup = logged(setup_of(*lines, home="36.5 -84.2 100"))
    legs = setup.route.positions
    runs = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(legs[:, :2], axis=0).T))])

    def judged(up: Callable[[Floats], Floats]) -> dict[int, Finding]:
        track = fly_path(setup, up=up)
        aligned = align_track(route_requirements(setup), track)
        findings = clearance_findings(route_requirements(setup), aligned)
        return {one.place.index or 0: one for one in findings}

    def grounded(s: Floats) -> Floats:
        return -50.0 * np.clip(1.0 - s / 400.0, 0.0, 1.0) - 60.0 * np.clip((s - runs[-2]) / 900.0, 0.0, 1.0)

    assert [one.ok for _, one in sorted(judged(grounded).items())] == [True, True, True]
    # 25 m above ground pass near home, where 20 m are enough, and not 2.5 km from it.
    assert judged(lambda s: grounded(s) + bump(1200.0, -28.0, 50.0)(s))[0].ok
    assert judged(lambda s: grounded(s) + bump(2500.0, -32.0, 50.0)(s))[0].ok is False
    # Once it has climbed, it may not come back to the ground.
    assert judged(lambda s: grounded(s) + bump(1200.0, -45.0, 50.0)(s))[0].ok is False


@pytest.mark.parametrize(("low_to", "ok"), [(1900.0, True), (2100.0, False)])
def test_a_log_that_is_low_beyond_two_kilometres_from_home_has_not_just_taken_off(low_to: float, ok: bool) -> None:
    """At 5 m, 15 m are required; it may climb from the ground as long as it is near home."""
    take_off = "3 22 15 0 0 0 0 0 50"
    lines = (take_off, wp(0, 5000, 50), wp(3000, 5000, 50))
    setup = logged(setup_of(*lines, home="36.5 -84.2 100", limits={"min_clearance_m": 15.0}))
    requirements = route_requirements(setup)
    aligned = align_track(requirements, fly_path(setup, up=lambda s: -45.0 * np.clip((low_to - s) / 50.0, 0.0, 1.0)))
    assert clearance_findings(requirements, aligned)[0].ok is ok
