"""``--fence``: fences named beside a mission, a plan or a log, by every command that takes them."""

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane_sitl.process import load_user_parameters
from flight.autopilots.parts import BatteryFailsafe
from flight.mission.fences import fence_shapes
from flight.mission.items import Mission, MissionItem
from flight.mission_files.formats import read_fence, read_mission
from flight.simulation.setup import FlightSetup
from logs.recording.reader import read_log
from logs.verdict.judge_flight import judge_geometry
from planfly.cli import main
from planfly.flight_logs import is_log
from planfly.flight_options import MissionOptions, read_named_fences
from planfly.live.served_flights import ServeOptions, load_served_scenario
from planfly.plan_fence import add_plan_fence
from planfly.workflow.make_plan import make_plan
from planfly.workflow.open_flight import _autopilot_notes, mission_of_plan, open_flight
from planfly.workflow.uav import load_uav, uav_of_setup
from planner.plan import plan_json
from tests.mission_lines import a_plan, setup_of, wp
from tests.planfly.conftest import FIELD
from tests.setups import small_scenario
from world.errors import MissionError, PlanflyError
from world.frames import GeoOrigin, to_geo

ORIGIN = GeoOrigin(36.5, -84.2)
HEAD = "QGC WPL 110\n"
LENGTH, RADIUS = 3000.0, 200.0


def degrees(east: float, north: float) -> tuple[float, float]:
    lat, lon = to_geo(ORIGIN, east, north)
    return float(lat), float(lon)


def row(seq: int, frame: int, command: int, p1: float, east: float, north: float, up: float) -> str:
    lat, lon = degrees(east, north)
    return f"{seq}\t0\t{frame}\t{command}\t{p1:g}\t0\t0\t0\t{lat:.8f}\t{lon:.8f}\t{up:g}\t1\n"


def circle(north: float, command: int = 5004) -> str:
    """A fence of one circle half way along the leg, with its centre so far beside it."""
    return HEAD + row(0, 0, command, RADIUS, 0.5 * LENGTH, north, 0.0)


def feature(ceiling: float) -> str:
    """A square across the leg's middle, as GeoJSON, up to a height above the sea."""
    ring = [degrees(0.5 * LENGTH + east, north)[::-1] for east, north in ((-90, -90), (90, -90), (90, 90), (-90, 90))]
    geometry = {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}
    return json.dumps(
        {"type": "Feature", "properties": {"name": "mill", "ceiling_amsl_m": ceiling}, "geometry": geometry}
    )


@pytest.fixture
def mission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A leg of 3 km to the east at 700 m."""
    monkeypatch.chdir(tmp_path)
    rows = [row(0, 0, 16, 0, 0.0, 0.0, 300.0), row(1, 0, 16, 0, 0.0, 0.0, 700.0), row(2, 0, 16, 0, LENGTH, 0.0, 700.0)]
    (tmp_path / "leg.waypoints").write_text(HEAD + "".join(rows), encoding="ascii")
    return tmp_path / "leg.waypoints"


@pytest.mark.parametrize(
    ("name", "text", "code"),
    [
        ("inside.fence", circle(RADIUS - 5.0), 4),
        ("outside.fence", circle(RADIUS + 5.0), 0),
        ("inside.txt", circle(-RADIUS + 5.0), 4),
        ("left.waypoints", circle(0.0, 5003), 4),
        ("above.geojson", feature(705.0), 4),
        ("below.geojson", feature(695.0), 0),
    ],
)
def test_a_mission_is_judged_by_the_fence_that_is_named(name: str, text: str, code: int, mission: Path) -> None:
    Path(name).write_text(text, encoding="ascii")
    assert main(["check", str(mission)]) == 0
    assert main(["check", str(mission), "--fence", name, "--json", "v.json"]) == code
    found = json.loads(Path("v.json").read_text(encoding="utf-8"))["findings"]
    assert [item["ok"] for item in found if item["rule"] == "fence"] == [code == 0]


def test_fences_join_the_missions_own_and_each_other(mission: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mission.write_text(mission.read_text() + row(3, 0, 5004, RADIUS, 0.5 * LENGTH, 5.0 + RADIUS, 0.0), encoding="ascii")
    Path("a.fence").write_text(circle(RADIUS - 5.0), encoding="ascii")
    Path("b.geojson").write_text(feature(705.0), encoding="ascii")
    command = ["check", str(mission), "--fence", "a.fence", "--fence", "b.geojson", "--json", "v.json"]
    assert main(command) == 4
    assert "the mission's own fence of 1 item applies in addition to the named fence" in capsys.readouterr().out
    found = json.loads(Path("v.json").read_text(encoding="utf-8"))["findings"]
    failed = [item["where"] for item in found if item["rule"] == "fence" and item["ok"] is False]
    # The mission's own fence is its item 3, and that of the file its item 0.
    assert failed == ["mill (exclusion)", "fence item 0 (exclusion)"]


def test_a_flight_keeps_the_fence_in_its_log_and_a_log_takes_another(mission: Path) -> None:
    Path("away.fence").write_text(circle(1000.0), encoding="ascii")
    Path("through.fence").write_text(circle(0.0), encoding="ascii")
    Path("mill.geojson").write_text(feature(650.0), encoding="ascii")
    options = ["--fence", "away.fence", "--fence", "mill.geojson"]
    assert main(["fly", str(mission), *options, "--guidance", "path", "--log", "f.mcap", "--log-hz", "10"]) == 0
    setup = read_log(Path("f.mcap")).setup
    assert (len(setup.mission.fences), [zone.name for zone in setup.scenario.zones]) == (1, ["mill"])
    assert main(["check", "f.mcap"]) == 0
    assert main(["check", "f.mcap", "--fence", "through.fence"]) == 4
    assert main(["check", "f.mcap", "--fence", "mill.geojson"]) == 0


def test_export_writes_the_fence_that_is_named(mission: Path) -> None:
    Path("a.fence").write_text(circle(1000.0), encoding="ascii")
    Path("mill.geojson").write_text(feature(650.0), encoding="ascii")
    options = ["--fence", "a.fence", "--fence", "mill.geojson"]
    assert main(["export", str(mission), "out.plan", "out.fence", *options]) == 0
    items = read_fence(Path("out.fence")).fences
    assert [item.command for item in items] == [5004, 5002, 5002, 5002, 5002]
    # A .plan has its polygons before its circles.
    assert [replace(item, seq=0) for item in read_mission(Path("out.plan")).fences] == [
        replace(item, seq=0) for item in (*items[1:], items[0])
    ]
    assert main(["export", str(mission), "map.kml", *options]) == 0
    text = Path("map.kml").read_text(encoding="utf-8")
    assert "fence item 0 (keep out)" in text
    assert "mill (keep out)" in text


def test_export_of_a_plan_adds_the_fence_to_area_and_threats(mission: Path) -> None:
    plan = mission.parent / "plan.json"
    plan.write_text(plan_json(a_plan([(9500.0, -5000.0, 700.0), (9000.0, -3000.0, 750.0), (6000.0, -2000.0, 800.0)])))
    Path("a.fence").write_text(circle(0.0), encoding="ascii")
    assert main(["export", str(plan), "without.fence"]) == 0
    assert main(["export", str(plan), "with.fence", "with.kml", "--fence", "a.fence"]) == 0
    without, with_it = read_fence(Path("without.fence")).fences, read_fence(Path("with.fence")).fences
    assert with_it[: len(without)] == without
    assert [(item.command, item.params[0]) for item in with_it[len(without) :]] == [(5004, RADIUS)]


def test_serve_begins_with_the_fence_that_is_named(mission: Path) -> None:
    Path("a.fence").write_text(circle(0.0), encoding="ascii")
    Path("mill.geojson").write_text(feature(650.0), encoding="ascii")
    options: MissionOptions = {"fence": ["a.fence", "mill.geojson"]}
    served = load_served_scenario(ServeOptions(str(mission), 1.0, Path("logs"), options))
    assert served.mission is not None
    assert len(served.mission.fences) == 1
    assert [zone.name for zone in served.scenario.zones] == ["mill"]


# Active on one day only.
TIMED = """AC R
AN mill
AL GND
AH 5000FT AMSL
AA 2026-05-01T00:00Z/2026-05-02T00:00Z
V X=36:32:00N 084:10:00W
DC 0.1
"""


@pytest.mark.parametrize(("at", "count"), [(None, 1), ("2026-05-01T10:00Z", 1), ("2026-05-03T10:00Z", 0)])
def test_export_and_serve_leave_out_what_is_not_active_then(at: str | None, count: int, mission: Path) -> None:
    Path("mill.openair").write_text(TIMED, encoding="ascii")
    asked = [] if at is None else ["--at", at]
    fenced = ["--fence", "mill.openair", *asked]
    assert main(["export", str(mission), "map.kml", "out.plan", *fenced]) == 0
    assert Path("map.kml").read_text(encoding="utf-8").count("<name>mill (R) (keep out)") == count
    assert bool(read_mission(Path("out.plan")).fences) == bool(count)
    served = load_served_scenario(ServeOptions(str(mission), 1.0, Path("logs"), {"fence": "mill.openair", "at": at}))
    assert len(served.scenario.zones) == count


def test_the_time_of_a_log_is_its_own(mission: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fly", str(mission), "--guidance", "path", "--log", "f.mcap", "--log-hz", "10"]) == 0
    assert main(["export", "f.mcap", "map.kml", "--at", "2026-05-03T10:00Z"]) == 2
    assert "f.mcap: --at 2026-05-03T10:00Z: not allowed: a log is exported with the zones" in capsys.readouterr().err
    for command in (["export", str(mission), "map.kml"], ["serve", str(mission), "--bind", "127.0.0.1:0"]):
        assert main([*command, "--at", "tomorrow"]) == 2
        expected = "expected a time in ISO 8601 format, such as 2026-05-01T10:00+02:00"
        assert capsys.readouterr().err == f"planfly: --at tomorrow: {expected}\n"
    assert main(["export", str(mission), "map.kml", "--at", "2026-05-01T10:00Z/soon"]) == 2
    assert capsys.readouterr().err == f"planfly: --at 2026-05-01T10:00Z/soon: 'soon': {expected}\n"


def test_a_file_that_holds_no_fence_is_named(mission: Path) -> None:
    with pytest.raises(MissionError, match=r"leg\.waypoints: contains no fence"):
        read_named_fences([str(mission)])


RALLY = "QGC WPL 110\n0 1 0 16 0 0 0 0 {home} 300 1\n1 0 3 5100 0 0 0 0 36.51 -84.2 80 1\n"


def test_a_file_of_rally_points_is_accepted_beside_a_fence(mission: Path) -> None:
    """As Mission Planner writes it, with a home line, and as planfly exports it, without."""
    Path("rally.waypoints").write_text(RALLY.format(home="36.5 -84.2"), encoding="ascii")
    Path("a.fence").write_text(circle(0.0), encoding="ascii")
    options = {"fence": ["rally.waypoints", "a.fence"]}
    opened = open_flight(str(mission), options).mission
    assert [(point.command, point.lat_deg, point.alt) for point in opened.rally] == [(5100, 36.51, 80.0)]
    assert [item.command for item in opened.fences] == [5004]
    assert main(["export", str(mission), "out.rally", "--fence", "rally.waypoints"]) == 0
    again = open_flight(str(mission), {"fence": ["out.rally", "rally.waypoints"]}).mission
    assert [(point.seq, point.lat_deg, point.alt) for point in again.rally] == [(0, 36.51, 80.0), (1, 36.51, 80.0)]


# ----------------------------------------------------------------------
# The fence of a plan: kept by the plan's path, in the judgement of whoever gets both.

# North 1500 m, then east: the fly-by arc of 90 degrees cuts the corner by some 50 m.
CORNER = (wp(0.0, 0.0), wp(0.0, 1500.0), wp(1500.0, 1500.0))


def missile(east: float, north: float, radius: float) -> dict[str, Any]:
    return {"name": f"m{east:g}", "east_m": east, "north_m": north, "kill_radius_m": radius, "kill_scale_m": 10.0}


def circles(setup: FlightSetup) -> list[float]:
    mission, _ = add_plan_fence(setup)
    return [shape[0].params[0] for shape in fence_shapes(mission.fences) if shape[0].command == 5004]


@pytest.mark.parametrize(
    ("east", "north", "kept"),
    [
        (202.0, 700.0, True),
        (198.0, 700.0, False),
        # On the arc, and 30 m off both legs.
        (30.0 + 200.0 * 0.7071, 1470.0 - 200.0 * 0.7071, False),
        (110.0 + 200.0 * 0.7071, 1390.0 - 200.0 * 0.7071, True),
    ],
)
def test_a_circle_that_the_path_goes_through_is_no_fence(east: float, north: float, kept: bool) -> None:
    setup = setup_of(*CORNER, threats=[missile(east, north, 200.0), missile(-900.0, 0.0, 150.0)])
    assert circles(setup) == ([200.0, 150.0] if kept else [150.0])


def test_the_judge_finds_the_fence_kept() -> None:
    """All circles together fail the rule `fence`; those that are exported do not."""
    threats = [missile(198.0, 700.0, 200.0), missile(-900.0, 0.0, 150.0)]
    setup = setup_of(*CORNER, threats=threats)
    mission, notes = add_plan_fence(setup)
    assert any(note.startswith("the mission passes above or below m198, so the fence omits it. ") for note in notes)

    def failed(fences: Any) -> list[str]:
        judged = judge_geometry(replace(setup, mission=replace(setup.mission, fences=fences)))
        return [item.rule for item in judged.findings if item.rule == "fence" and item.ok is False]

    every, _ = add_plan_fence(setup_of(wp(-2000.0, -2000.0), wp(-1500.0, -2000.0), threats=threats))
    assert failed(mission.fences) == []
    assert failed(every.fences) == ["fence"]


# ----------------------------------------------------------------------
# Whatever a person brings is opened in its own, a named or a made scenario.

MISSION = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t0\t1
1\t0\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t100\t1
2\t0\t0\t16\t0\t0\t0\t0\t46.01\t8.0\t120\t1
"""


@pytest.fixture
def short_mission(tmp_path: Path) -> Path:
    (tmp_path / "m.waypoints").write_text(MISSION, encoding="ascii")
    (tmp_path / "field.toml").write_text(FIELD, encoding="utf-8")
    return tmp_path / "m.waypoints"


def test_a_log_is_known_by_its_first_bytes_or_its_name(tmp_path: Path) -> None:
    for name, data, log in (
        ("a.bin", b"\x89MCAP0\r\nrest", True),
        ("damaged.MCAP", b"xxxx", True),
        ("empty.mcap", b"", True),
        ("plan.json", b"{}", False),
    ):
        (tmp_path / name).write_bytes(data)
        assert is_log(tmp_path / name) is log, name
    with pytest.raises(PlanflyError, match="none: cannot be read"):
        is_log(tmp_path / "none")


def test_a_mission_without_a_scenario_gets_one_made_around_it(short_mission: Path) -> None:
    setup = open_flight(short_mission, {})
    assert (setup.name, setup.seed) == ("m", 1)
    assert setup.scenario.external
    assert setup.scenario.terrain is None
    # 0.01 degrees of a meridian near 46 degrees north are 1111.5 m.
    assert np.linalg.norm(np.diff(setup.route.positions[:, :2], axis=0)) == pytest.approx(1111.5, abs=0.5)


def test_a_parameter_that_is_assumed_for_a_landing_sequence_is_not_of_the_file(tmp_path: Path) -> None:
    mission, file = tmp_path / "a.waypoints", tmp_path / "mine.parm"
    way = row(0, 0, 16, 0, 0, 0, 0.0) + row(1, 3, 16, 0, 100.0, 0, 100.0) + row(2, 3, 16, 0, 2000.0, 0, 100.0)
    land = "3\t0\t2\t189" + 7 * "\t0" + "\t1\n" + row(4, 3, 16, 0, 3000.0, 0, 60.0) + row(5, 3, 21, 0, 4000.0, 0, 0.0)
    mission.write_text(HEAD + way + land, encoding="utf-8")
    setup = open_flight(mission, {"autopilot": "ardupilot"})
    assert isinstance(setup.autopilot, ArduPlane)
    # Also in a log, in another release, and for the program, which would not arm without it.
    restored = ArduPlane.restore(setup.autopilot.store())
    for found in (setup.autopilot.parameters, restored.parameters, setup.autopilot.parameters.with_release("4.6")):
        assert (found.by_origin("assumed"), found.by_origin("file")) == ({"RTL_AUTOLAND": 1.0}, {})
    assert load_user_parameters(setup) == {"RTL_AUTOLAND": 1.0}
    assert any("RTL_AUTOLAND 1 is assumed" in note for note in setup.route.notes)
    for stated in (1.0, 2.0):
        file.write_text(f"RTL_AUTOLAND {stated:g}\n", encoding="utf-8")
        setup = open_flight(mission, {"autopilot": "ardupilot", "params": str(file)})
        assert setup.autopilot.parameters is not None
        assert setup.autopilot.parameters.by_origin("file") == {"RTL_AUTOLAND": stated}
        assert not setup.autopilot.parameters.by_origin("assumed")
        assert not any("assumed" in note for note in setup.route.notes)


def test_a_mission_is_judged_in_the_scenario_that_is_named(short_mission: Path) -> None:
    slower = open_flight(short_mission, {"scenario": short_mission.parent / "field.toml", "seed": 9, "airspeed": 21.0})
    assert (slower.scenario.name, slower.seed) == ("field", 9)
    assert slower.scenario.wind.speed == 3.0
    assert slower.airspeed == uav_of_setup(slower).airspeed == 21.0
    assert (slower.route.leg_airspeeds == 21.0).all()


def test_a_plan_is_opened_in_its_own_scenario_unless_another_is_named(short_mission: Path, tmp_path: Path) -> None:
    scenario = small_scenario()
    plan = make_plan(scenario, load_uav(scenario), 3)
    file = tmp_path / "plan.json"
    file.write_text(plan_json(plan), encoding="utf-8")
    own = open_flight(file, {})
    assert (own.scenario.name, own.seed, own.name) == ("small", 3, "small")
    assert own.plan is not None
    np.testing.assert_array_equal(own.plan.waypoints, plan.waypoints)
    np.testing.assert_allclose(own.route.positions, plan.waypoints, atol=0.02)
    other = open_flight(file, {"scenario": short_mission.parent / "field.toml", "seed": 4})
    assert (other.scenario.name, other.seed, other.name) == ("field", 4, "plan")
    assert other.plan is None
    assert other.mission == own.mission == mission_of_plan(plan, uav_of_setup(own))


def test_what_is_not_there_names_what_is_expected(tmp_path: Path) -> None:
    with pytest.raises(MissionError, match=r"no such file; expected a plan\.json, \.waypoints or \.plan file"):
        open_flight(tmp_path / "none.plan", {})


def test_a_mission_that_lies_beside_the_name_is_named(short_mission: Path) -> None:
    (short_mission.parent / "m.waypoints.bak").write_text("", encoding="ascii")
    named = re.escape(f"did you mean '{short_mission.parent}/m.waypoints'?")
    with pytest.raises(MissionError, match=rf"\.waypoints or \.plan file: {named}$"):
        open_flight(short_mission.with_name("n.waypoints"), {})
    with pytest.raises(MissionError, match=r"\.waypoints or \.plan file$"):
        open_flight(short_mission.parent / "nowhere" / "m.waypoints", {})


def autopilot_notes(
    items: tuple[MissionItem, ...], dialect: Any, failsafes: tuple[BatteryFailsafe, ...] = ()
) -> tuple[str, ...]:
    """With a battery of 29.6 Wh at 14.8 V, and no limits of the airspeed."""
    checks, speeds = SimpleNamespace(dialect=dialect, battery_failsafes=failsafes), SimpleNamespace(limits=None)
    autopilot: Any = SimpleNamespace(checks=checks, speeds=speeds, title="")
    return tuple(_autopilot_notes(Mission(None, items), autopilot, 29.6, 14.8))


@pytest.mark.parametrize(
    ("dialect", "count", "limit"),
    # `StorageManager` of ArduPilot on a Pixhawk; `NUM_MISSIONS_SUPPORTED` of PX4; planfly's own guidance has no board.
    [("ardupilot", 724, None), ("ardupilot", 725, 724), ("px4", 500, None), ("px4", 501, 500), ("planfly", 9000, None)],
)
def test_a_mission_that_a_common_board_does_not_store_is_noted(dialect: Any, count: int, limit: int | None) -> None:
    items = tuple(MissionItem(k, 16, 3, (0.0, 0.0, 0.0, 0.0), 46.0, 8.0, 100.0) for k in range(count))
    notes = autopilot_notes(items, dialect=dialect)
    assert len(notes) == (limit is not None)
    assert all(note.startswith(f"{count} items: ") and f" stores {limit}," in note for note in notes)


@pytest.mark.parametrize(
    ("capacity", "left"),
    # 2,000 mAh at 14.8 V are 29.6 Wh.  A failsafe at 800 mAh left counts from BATT_CAPACITY.
    [(2000.0, None), (1620.0, None), (2380.0, None), (1580.0, 1220), (2420.0, 380), (3000.0, 0)],
)
def test_a_capacity_unlike_the_batterys_is_noted_with_what_the_failsafe_leaves(
    capacity: float, left: int | None
) -> None:
    failsafe = BatteryFailsafe("BATT_LOW_MAH", 800.0, capacity - 800.0)
    failsafe = failsafe._replace(capacity_parameter="BATT_CAPACITY", capacity=capacity)
    notes = autopilot_notes((), dialect="ardupilot", failsafes=(failsafe, BatteryFailsafe("BATT_LOW_VOLT", 14.0)))
    expected = (
        f"BATT_CAPACITY {capacity:g} mAh, but the aircraft's battery has 2000 mAh (29.6 Wh at 14.8 V)."
        f" The failsafe BATT_LOW_MAH 800 ends the mission with {left} mAh left"
    )
    assert notes == (() if left is None else (expected,))
