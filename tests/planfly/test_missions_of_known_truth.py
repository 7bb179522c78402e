"""Missions over level ground whose answer is known beforehand, judged by geometry and flown."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from flight.simulation.setup import FlightSetup
from logs.verdict.findings import Finding
from logs.verdict.judge_geometry import judge_geometry
from logs.verdict.verdict import Verdict
from planfly.cli import main
from planfly.workflow.open_flight import make_setup
from planfly.workflow.pipeline import fly_and_judge
from planfly.workflow.uav import load_uav
from tests.mission_lines import ORIGIN, mission, wp
from tests.setups import spec_around
from tests.soak import some
from world.scenario import scenario_from_spec

# Home and ground in metres AMSL, unless a mission says otherwise.
GROUND = 300.0
SQUARE = (wp(0, 0), wp(0, 750), wp(750, 750), wp(750, 0))
SPEED = "2 178 0 {} -1 0 0 0 0"


def corner(turn_deg: float, acceptance: float, leg: float = 3000.0) -> tuple[str, ...]:
    """Two legs, and a turn with this acceptance between them."""
    turn, radius = math.radians(turn_deg), f"0 {acceptance} 0 0"
    end = wp(leg * math.sin(turn), leg + leg * math.cos(turn), p=radius)
    return wp(0, 0, p=radius), wp(0, leg, p=radius), end


@dataclass(frozen=True)
class Case:
    """A mission, and what is true of it.

    flyable: the answer of both levels.  rules: that fail by geometry, and in flight.  ended: how the flight ends.
    equivalent: the answers of geometry and flight where the airspeeds are equivalent ones, which ArduPlane takes them
    for; None for the same.  says: how the first line begins.
    """

    lines: tuple[str, ...]
    flyable: bool
    rules: tuple[str, ...] = ()
    flown: tuple[str, ...] | None = None
    ended: str = "completed"
    equivalent: tuple[bool, bool] | None = None
    says: str = ""
    ground: float = GROUND
    home: str = "36.5 -84.2 300"
    tables: dict[str, Any] = field(default_factory=dict)


def wind(speed: float, from_deg: float) -> dict[str, Any]:
    return {"wind": {"speed_mps": speed, "from_deg": from_deg}}


CASES = {
    # 16.7 m/s is the stall at 1,000 m, and 17.9 in the 30 degrees of bank of a corner.
    "17 m/s with right angles": Case(
        (SPEED.format(17), *(wp(*place, 700) for place in ((0, 0), (0, 1500), (1500, 1500), (1500, 0)))),
        False,
        ("stall",),
        # ArduPlane ignores them (AIRSPEED_MIN is 18), and flies its 25 m/s.
        equivalent=(True, True),
    ),
    "18.5 m/s with right angles": Case(
        (SPEED.format(18.5), *(wp(*place, 700) for place in ((0, 0), (0, 1500), (1500, 1500), (1500, 0)))), True
    ),
    "a jump without end": Case((*SQUARE, "2 177 1 -1 0 0 0 0 0"), False, ("energy",)),
    # 3 km a round at 25 m/s and some 340 W: 11.3 Wh.
    "10 jumps, 3 times the battery": Case(
        (*SQUARE, "2 177 1 10 0 0 0 0 0"),
        False,
        ("energy",),
        ("completion", "energy"),
        "not started: the mission needs 3 times",
        tables={"flight": {"battery_wh": 39.0}},
    ),
    "3 jumps with half the energy they take": Case(
        (*SQUARE, "2 177 1 2 0 0 0 0 0"),
        False,
        ("energy",),
        ("completion", "energy", "waypoint"),
        "nothing is left in the battery or the tank",
        tables={"flight": {"battery_wh": 23.0}},
    ),
    "3 jumps with twice the energy they take": Case(
        (*SQUARE, "2 177 1 2 0 0 0 0 0"), True, tables={"flight": {"battery_wh": 65.0}}
    ),
    "landing at 45 degrees": Case((wp(0, 0), wp(0, 1500), wp(0, 1600, 0, command=21)), False, ("landing",)),
    "landing at 3.4 degrees": Case((wp(0, 0), wp(0, 1500, 60), wp(0, 2500, 0, command=21)), True),
    # Said in the first line: an autopilot climbs on beyond the place that it takes off to.
    "200 m of climb in the 100 m from home": Case(
        (wp(0, 100, 200, command=22), wp(0, 1500, 200), wp(1500, 1500, 200)),
        False,
        says="not judged in full: the take-off climbs 200 m in 100 m",
    ),
    "200 m of climb in 1,500 m from home": Case((wp(0, 1500, 200, command=22), wp(0, 3000, 200)), True, says="flyable"),
    "wind of 30 m/s from ahead": Case(
        SQUARE[:2], False, ("speed",), ("completion", "speed"), "not started: no progress", tables=wind(30.0, 0.0)
    ),
    "wind of 24 m/s across": Case(SQUARE[:2], True, tables=wind(24.0, 270.0)),
    "wind of 26 m/s across": Case(
        SQUARE[:2], False, ("speed",), ("completion", "speed"), "not started: no progress", tables=wind(26.0, 270.0)
    ),
    "8,800 m": Case(
        (wp(0, 0, 8800, frame=0), wp(0, 3000, 8800, frame=0)),
        False,
        ("speed",),
        ("completion", "speed"),
        "not started: no level flight at 25.0 m/s and 8800 m AMSL",
    ),
    # The slowest level flight is 20.5 m/s there.
    "5,000 m at 19 m/s": Case(
        (SPEED.format(19), wp(0, 0, 5000, frame=0), wp(0, 3000, 5000, frame=0)),
        False,
        ("speed",),
        ("completion", "speed"),
        "not started: aerosonde cannot hold steady flight at 19.0 m/s",
        # 24.5 m/s of true airspeed.
        equivalent=(True, True),
    ),
    "heights over home written as AMSL": Case(
        (wp(0, 0, 100, frame=0), wp(0, 3000, 100, frame=0)),
        False,
        ("clearance",),
        ("clearance", "completion"),
        "not started: start at 100 m AMSL: not above the terrain, which is at 513 m",
        ground=513.0,
    ),
    "home at 0 over ground at 513 m": Case(
        (wp(0, 0), wp(0, 3000)),
        False,
        ("clearance",),
        ("clearance", "completion"),
        "not started: start at 100 m AMSL: not above the terrain, which is at 513 m",
        ground=513.0,
        home="36.5 -84.2 0",
    ),
    "a first waypoint 12 km from home": Case((wp(0, 12_000), wp(0, 14_000)), True),
}


def setup_of(case: Case, autopilot: str = "planfly") -> FlightSetup:
    made = {
        "origin": {"lat_deg": ORIGIN.lat_deg, "lon_deg": ORIGIN.lon_deg},
        "terrain": {"kind": "flat", "amsl_m": case.ground},
        "area": {"east_m": [-20_000, 20_000], "north_m": [-20_000, 20_000], "ceiling_amsl_m": 9000.0},
    }
    ends = [[0.0, 0.0, case.ground + 100.0], [500.0, 0.0, case.ground + 100.0]]
    tables = made | case.tables | {"flight": {"autopilot": autopilot, **case.tables.get("flight", {})}}
    spec = spec_around(ends, name="known", buffer=0.0, ceiling=9000.0, **tables)
    scenario = scenario_from_spec(spec, "known", external=True)
    return make_setup(scenario, load_uav(scenario), mission(*case.lines, home=case.home), 1)


def failed(verdict: Verdict) -> set[str]:
    return {item.rule for item in verdict.findings if item.ok is False}


@pytest.mark.parametrize("name", some(CASES, 7))
def test_ardupilots_law_knows_the_answer_too(name: str) -> None:
    case = CASES[name]
    setup = setup_of(case, "ardupilot")
    answers = case.equivalent or (case.flyable, case.flyable)
    planned = judge_geometry(setup)
    assert planned.flyable is answers[0], planned.summary
    flown = fly_and_judge(setup)
    assert flown.verdict.flyable is answers[1], flown.verdict.summary
    if case.equivalent is None:
        assert failed(flown.verdict) == set(case.rules if case.flown is None else case.flown)
        assert flown.ended.split(":")[0] == case.ended.split(":")[0]


@pytest.mark.parametrize("name", CASES)
def test_both_levels_know_the_answer(name: str) -> None:
    case = CASES[name]
    setup = setup_of(case)
    planned = judge_geometry(setup)
    assert planned.flyable is case.flyable, planned.summary
    assert failed(planned) == set(case.rules)
    assert planned.headline.startswith(case.says)
    flown = fly_and_judge(setup)
    assert flown.verdict.flyable is case.flyable, flown.verdict.summary
    assert flown.verdict.headline.startswith(case.says)
    assert failed(flown.verdict) == set(case.rules if case.flown is None else case.flown)
    assert flown.ended.startswith(case.ended)


RADIUS = 25.0**2 / (9.80665 * math.tan(math.radians(30.0)))


def turn_of(verdict: Verdict) -> Finding:
    (found,) = [item for item in verdict.findings if item.rule == "turn"]
    return found


@pytest.mark.parametrize("turn_deg", some((120.0, 175.0, 150.0, 170.0), 2))
def test_a_corner_whose_arc_would_miss_its_waypoint_is_flown_over(turn_deg: float) -> None:
    setup = setup_of(Case(corner(turn_deg, 10.0), True))
    assert setup.route.fly_over.tolist() == [False, True, False]
    flown = fly_and_judge(setup)
    # 110 m from the waypoint, 316, 1,156 and 2,420.
    passes = RADIUS / math.cos(math.radians(turn_deg) / 2.0) - RADIUS
    beside = RADIUS * (1.0 - math.cos(math.radians(turn_deg)))
    for verdict in (judge_geometry(setup), flown.verdict):
        reason = turn_of(verdict).reason
        assert (
            f"flown over, because a fly-by arc would pass {passes:.0f} m away, outside the acceptance radius of 10 m"
            in reason
        )
        assert f"up to {beside:.0f} m off the next leg" in reason
    (at,) = [item for item in flown.verdict.findings if item.rule == "waypoint" and item.place.index == 1]
    assert at.flown is not None
    assert at.flown < 10.0
    # As far beside the next leg as it says, and a roll further.
    course = math.radians(turn_deg)
    across = flown.track.position[:, 0] * math.cos(course) - (flown.track.position[:, 1] - 3000.0) * math.sin(course)
    after = flown.track.time > flown.track.time[-1] / 2.0
    assert abs(across[after]).max() == pytest.approx(beside, rel=0.25)


def test_a_corner_that_its_acceptance_has_room_for_is_flown_by() -> None:
    """120 degrees: an arc of radius R passes at R(1/cos 60 - 1), which is R."""
    by, over = (setup_of(Case(corner(120.0, RADIUS + off), True)) for off in (0.5, -0.5))
    assert not by.route.fly_over.any()
    assert over.route.fly_over.tolist() == [False, True, False]
    assert "flown over" not in turn_of(judge_geometry(by)).reason


def test_a_corner_flown_over_needs_the_next_leg_to_come_back_to_it() -> None:
    # A corner of 120 degrees takes 2.8 radii, 312 m, of the next leg.
    for leg, ok in ((320.0, True), (300.0, False)):
        assert turn_of(judge_geometry(setup_of(Case(corner(120.0, 10.0, leg), True)))).ok is ok


def test_the_note_on_a_home_at_zero_says_where_it_comes_from() -> None:
    case = CASES["home at 0 over ground at 513 m"]
    note = "home is at 0.0 m AMSL, but the ground there is at 513.0 m"
    assert any(line.startswith(note) and line.endswith("no home was set") for line in setup_of(case).route.notes)
    assert not any("no home was set" in line for line in setup_of(Case(SQUARE, True, ground=250.0)).route.notes)


def test_px4s_distance_to_the_first_waypoint_is_named_as_px4s() -> None:
    verdict = judge_geometry(setup_of(CASES["a first waypoint 12 km from home"]))
    assert verdict.headline == "flyable"
    assert "PX4 would reject the mission: the first waypoint is 12000 m from home" in verdict.summary


FILE = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t0\t1
1\t0\t0\t16\t0\t0\t0\t0\t46.00\t8.0\t{up}\t1
2\t0\t0\t16\t0\t0\t0\t0\t46.01\t8.0\t{up}\t1
"""


@pytest.mark.parametrize(
    ("up", "options", "code", "says"),
    [
        (500, ["--wind", "30,0"], 4, "the wind is too strong to hold the course of leg 0"),
        (500, ["--wind", "24,270"], 0, "flyable"),
        (500, ["--wind", "24,270", "--turbulence", "light"], 0, "flyable"),
        (8800, [], 4, "40.0 m/s TAS is above the maximum level speed"),
    ],
)
def test_what_cannot_be_flown_is_a_verdict_on_the_command_line_too(
    up: int, options: list[str], code: int, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "m.waypoints").write_text(FILE.format(up=up), encoding="utf-8")
    name, log = str(tmp_path / "m.waypoints"), str(tmp_path / "f.mcap")
    assert main(["check", "--geometry", name, *options]) == code
    assert says in capsys.readouterr().out
    if "--turbulence" in options:
        return  # a gust from the side is more than the metre a second that is left
    assert main(["fly", name, "--log", log, *options]) == code
    said = capsys.readouterr().out
    assert says in said
    # A flight that never began leaves no log.
    assert Path(log).exists() is (code == 0)
    assert ("log       none: nothing was flown" in said) is (code == 4)


def test_a_log_is_judged_in_the_wind_it_was_flown_in(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "f.mcap").write_bytes(b"\x89MCAP0\r\n")
    assert main(["check", str(tmp_path / "f.mcap"), "--wind", "5,270"]) == 2
    assert "--wind: not allowed with a log" in capsys.readouterr().err
