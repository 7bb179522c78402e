"""``planfly check``: PX4's rules by name, and a climb on the spot, which is judged and not refused."""

import json
import math
from pathlib import Path
from xml.etree import ElementTree

import pytest

from planfly.cli import main
from tests.planfly.terminal.answers.checked_answers import validate

MISSIONS = Path(__file__).parents[2] / "flight" / "missions"
MISSION = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t100\t1
1\t0\t3\t16\t0\t0\t0\t0\t46.00\t8.00\t200\t1
2\t0\t3\t16\t0\t0\t0\t0\t46.01\t8.00\t200\t1
3\t0\t3\t16\t0\t0\t0\t0\t46.01\t8.00\t{up}\t1
4\t0\t3\t16\t0\t0\t0\t0\t46.02\t8.01\t{up}\t1
"""


@pytest.mark.parametrize("up", [1434, 650])
def test_a_climb_on_the_spot_is_judged_and_not_flyable(
    up: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """450 m up are too steep for the 1.35 km of the next leg, too: 18 degrees."""
    mission = tmp_path / "up.waypoints"
    mission.write_text(MISSION.format(up=up), encoding="utf-8")
    assert main(["check", str(mission), "--geometry", "--json", str(tmp_path / "verdict.json")]) == 4
    verdict = json.loads((tmp_path / "verdict.json").read_text(encoding="utf-8"))
    failed = [item for item in verdict["findings"] if item["ok"] is False]
    assert [(item["rule"], item["where"]) for item in failed] == [("slope", "leg 1 (to item 3)")]
    assert abs(failed[0]["planned"]) == pytest.approx(90.0, abs=0.1)
    assert f"leg 1 climbs {up - 200:g} m vertically, 90.0°; the aircraft's limit is " in failed[0]["reason"]
    assert "m (it is vertical)" in failed[0]["suggestion"]
    assert main(["fly", str(mission), "--log", str(tmp_path / "flight.mcap")]) == 4
    assert "vertically" in capsys.readouterr().out


@pytest.mark.parametrize(("up", "geometry"), [(350, 3), (210.5, 3), (80, 0)])
def test_a_change_of_altitude_on_the_spot_is_flown_on_the_next_leg(up: float, geometry: int, tmp_path: Path) -> None:
    """ArduPlane passes both items at once; below the leg as drawn, only a flight tells."""
    mission = tmp_path / "up.waypoints"
    mission.write_text(MISSION.format(up=up), encoding="utf-8")
    assert main(["check", str(mission), "--geometry", "--json", str(tmp_path / "verdict.json")]) == geometry
    verdict = json.loads((tmp_path / "verdict.json").read_text(encoding="utf-8"))
    (slope,) = (
        item for item in verdict["findings"] if item["where"] == "leg 1 (to item 3)" and item["rule"] == "slope"
    )
    run = math.hypot(1112.0, 764.0)
    assert slope["planned"] == pytest.approx(math.degrees(math.atan((up - 200) / run)), rel=0.01)
    assert main(["check", str(mission)]) == 0


@pytest.mark.parametrize("up", [201.5, 209.5, 190.5])
def test_a_step_on_the_spot_is_flown_within_its_own_height(up: float, tmp_path: Path) -> None:
    """Ten metres are a step, whatever their slope."""
    mission = tmp_path / "up.waypoints"
    mission.write_text(MISSION.format(up=up), encoding="utf-8")
    assert main(["check", str(mission)]) == 0


def test_check_names_px4s_rules(tmp_path: Path) -> None:
    """A landing steeper than PX4's parameter has it, and a command that neither autopilot has."""
    mission, target = tmp_path / "land.waypoints", tmp_path / "v.json"
    text = (MISSIONS / "mission_planner_land.waypoints").read_text(encoding="utf-8")
    mission.write_text(text.replace("4\t0\t3\t183\t", "4\t0\t3\t5000\t"), encoding="utf-8")
    assert main(["check", str(mission), "--geometry", "--autopilot", "px4", "--json", str(target)]) == 4
    findings = json.loads(target.read_text())["findings"]
    reasons = {item["reason"]: item["ok"] for item in findings if item["rule"] == "mission" and item["ok"] is not True}
    assert [ok for reason, ok in reasons.items() if ("(see PX4's function checkFixedWindLandApproach)") in reason] == [
        False
    ]
    assert [ok for reason, ok in reasons.items() if ("(see PX4's function checkMissionItemValidity)") in reason] == [
        False
    ]


OTHERS = {
    82: "NAV_SPLINE_WAYPOINT: a command for a multicopter",
    92: "NAV_GUIDED_ENABLE: a command for a multicopter or a rover",
    94: "NAV_PAYLOAD_PLACE: a command for a multicopter or a VTOL aircraft",
    42703: "NAV_ATTITUDE_TIME: a command for a multicopter",
    213: "NAV_SET_YAW_SPEED: a command for a rover",
    84: "NAV_VTOL_TAKEOFF: a command for a VTOL aircraft",
    85: "NAV_VTOL_LAND: a command for a VTOL aircraft",
    3000: "DO_VTOL_TRANSITION: a command for a VTOL aircraft",
}


@pytest.mark.parametrize("command", OTHERS)
def test_a_mission_for_another_vehicle_is_a_line(
    command: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A .waypoints file names no vehicle: its steps do."""
    mission = tmp_path / "m.waypoints"
    row = f"5\t0\t3\t{command}\t0\t0\t0\t0\t46.03\t8.0\t120\t1\n"
    mission.write_text(MISSION.format(up=200) + row, encoding="utf-8")
    for name in ("check", "fly"):
        assert main([name, str(mission)]) == 2
        wanted = f"planfly: {mission}: item 5: {OTHERS[command]}; planfly flies only fixed-wing aircraft\n"
        assert capsys.readouterr().err == wanted


@pytest.mark.parametrize(("command", "name"), [(115, "CONDITION_YAW"), (42600, "DO_WINCH"), (222, "DO_GUIDED_LIMITS")])
def test_what_arduplane_passes_over_is_no_other_vehicles(
    command: int, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mission = tmp_path / "m.waypoints"
    row = f"5\t0\t2\t{command}\t0\t0\t0\t0\t0\t0\t0\t1\n"
    mission.write_text(MISSION.format(up=201) + row, encoding="utf-8")
    assert main(["check", str(mission)]) == 0
    out = capsys.readouterr().out
    assert f"{name} is not flown" in out
    assert "ArduPlane accepts it" not in out


FENCED = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t100\t1
1\t0\t0\t16\t0\t0\t0\t0\t46.00\t8.0\t400\t1
2\t0\t0\t16\t0\t0\t0\t0\t46.02\t8.0\t400\t1
3\t0\t0\t5004\t100\t0\t0\t0\t46.01\t{lon}\t0\t1
"""
ZONED = """name = "zoned"
[origin]
lat_deg = 46.0
lon_deg = 8.0
[terrain]
kind = "flat"
amsl_m = 300
[area]
east_m = [-2000, 2000]
north_m = [-1000, 4000]
[start]
east_m = 0
north_m = 0
amsl_m = 400
[destination]
east_m = 0
north_m = 2223.03
amsl_m = 400
[limits]
max_height_m = {most}
[[zones]]
name = "town"
kind = "exclusion"
polygon_m = [[{west}, 800], [900, 800], [900, 1500], [{west}, 1500]]
ceiling_agl_m = 150
"""


# A leg through the middle of the mission's own circle of 100 m; the same beside it: 0.002 degrees are 155 m.
@pytest.mark.parametrize(("lon", "code"), [("8.0", 4), ("7.998", 0)])
def test_a_leg_through_the_missions_own_fence_is_not_flyable(
    lon: str, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, log = tmp_path / "m.waypoints", tmp_path / "flight.mcap"
    file.write_text(FENCED.format(lon=lon), encoding="utf-8")
    assert main(["check", str(file)]) == code
    assert ("fence item 3 (exclusion) violated (100.0 m inside)" in capsys.readouterr().out) == (code == 4)
    assert main(["fly", str(file), "--log", str(log)]) == code
    capsys.readouterr()
    assert main(["check", str(log)]) == code


# 150 m off a leg at 100 m above ground, or over it; and the height allowed, 99 m or 101 m.
@pytest.mark.parametrize(("west", "most", "rules"), [(150, 101, set()), (-50, 101, {"fence"}), (150, 99, {"height"})])
def test_a_log_holds_its_zones_and_repeats_the_verdict(
    west: int, most: int, rules: set[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, scenario, log = tmp_path / "m.waypoints", tmp_path / "s.toml", tmp_path / "flight.mcap"
    file.write_text(FENCED.format(lon="8.02"), encoding="utf-8")
    scenario.write_text(ZONED.format(west=west, most=most), encoding="utf-8")
    told = ["--json", str(tmp_path / "geometry.json")]
    assert main(["check", str(file), "--scenario", str(scenario), *told]) == (4 if rules else 0)
    findings = json.loads((tmp_path / "geometry.json").read_text(encoding="utf-8"))["findings"]
    assert {item["rule"] for item in findings if item["ok"] is False} == rules
    guided = ["--guidance", "path"]  # ArduPlane's law keeps no height to a metre
    code = main(["fly", str(file), "--scenario", str(scenario), "--log", str(log), *guided])
    assert code == (4 if rules else 0)
    capsys.readouterr()
    first, again = tmp_path / "first.json", tmp_path / "again.json"
    for target in (first, again):
        assert main(["check", str(log), "--json", str(target)]) == code
        scenario.unlink(missing_ok=True)
    assert first.read_bytes() == again.read_bytes()
    flown = json.loads(first.read_text(encoding="utf-8"))["findings"]
    assert {item["rule"] for item in flown if item["ok"] is False} == rules
    assert [item["place"]["name"] for item in flown if item["rule"] == "fence" and item["ok"] is False] == (
        ["town"] if "fence" in rules else []
    )


JUMPING = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t36.25\t-84.15\t500\t1
1\t0\t3\t16\t0\t0\t0\t0\t36.25\t-84.15\t400\t1
2\t0\t3\t16\t0\t0\t0\t0\t36.28\t-84.15\t400\t1
3\t0\t3\t16\t0\t0\t0\t0\t36.28\t-84.12\t400\t1
4\t0\t2\t177\t2\t1\t0\t0\t0\t0\t0\t1
5\t0\t3\t16\t0\t0\t0\t0\t36.25\t-84.12\t400\t1
"""
ZONE = """{"type": "Polygon", "coordinates": [[[-84.16, 36.26], [-84.14, 36.26], [-84.14, 36.27], [-84.16, 36.27],
[-84.16, 36.26]]]}"""


def test_legs_have_their_items_and_limits_their_owner_through_a_jump(tmp_path: Path) -> None:
    mission, zone = tmp_path / "jumps.waypoints", tmp_path / "zone.geojson"
    mission.write_text(JUMPING, encoding="utf-8")
    zone.write_text(ZONE, encoding="utf-8")
    out = tmp_path / "v.json"
    argv = ["check", str(mission), "--terrain", "jacksboro", "--fence", str(zone), "--json", str(out)]
    assert main(argv) == 4
    findings = json.loads(out.read_text(encoding="utf-8"))["findings"]
    # Flown are the items 1, 2, 3, then 2 and 3 again, and 5.
    legs = {
        item["place"]["index"]: (item["where"], item["place"]["to_item"])
        for item in findings
        if item["rule"] == "clearance"
    }
    assert legs == {k: (f"leg {k} (to item {item})", item) for k, item in enumerate((2, 3, 2, 3, 5))}
    assert {item["limit_source"] for item in findings if item["rule"] == "clearance"} == {"default"}
    (violated,) = [item for item in findings if item["rule"] == "fence" and item["ok"] is False]
    assert violated["limit_source"] == "fence"
    assert " on leg 0 (to item 2), " in violated["reason"]
    assert "scenario" not in {item["limit_source"] for item in findings}


def test_several_autopilots_are_told_in_one_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A jump tag, which PX4 refuses, at a corner of 72 degrees."""
    mission = tmp_path / "corner.waypoints"
    lines = MISSION.format(up=200).splitlines()
    lines[4:] = ["3\t0\t3\t16\t0\t0\t0\t0\t46.012\t8.02\t200\t1", "4\t0\t2\t600\t9\t0\t0\t0\t0\t0\t0\t1"]
    mission.write_text("\n".join(lines) + "\n", encoding="utf-8")
    written, junit = tmp_path / "both.json", tmp_path / "both.xml"
    asked = ["--for", "ardupilot,px4", "--json", str(written), "--junit", str(junit)]
    assert main(["check", str(mission), *asked]) == 4
    answer = json.loads(written.read_text(encoding="utf-8"))
    validate("check", answer)
    assert {name: one["flyable"] for name, one in answer["verdicts"].items()} == {"ardupilot": True, "px4": False}
    suites = {suite.get("name"): suite.get("failures") for suite in ElementTree.parse(junit).getroot()}
    assert suites[f"{mission} by ardupilot"] == "0" < suites[f"{mission} by px4"]
    said = capsys.readouterr().out.splitlines()
    assert said[0].split() == ["ardupilot", "px4"]
    assert said[1].split() == ["verdict", "flyable", "not", "flyable"]
    assert any(line.split()[0] == "mission" and line.endswith("fail") for line in said)
    assert said[-8].startswith("ardupilot: flyable")
    assert said[-7].startswith(
        "  Aircraft: aerosonde, 11 kg, 25 m/s equivalent airspeed (its cruise speed); no aircraft was named"
    )
    assert said[-5].startswith("  Flown by: the simulated ArduPlane 4.7 with its default parameters")
    assert any("px4: not flyable: mission" in line for line in said[-5:])


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--for", "px4", "--guidance", "l1"], "cannot be combined with --for, which flies with several autopilots"),
        (
            ["--for", "px4", "--params", "a.params"],
            "cannot be combined with --for, which flies with several autopilots",
        ),
    ],
)
def test_what_does_not_go_with_several_autopilots_is_one_line(
    more: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mission = tmp_path / "up.waypoints"
    mission.write_text(MISSION.format(up=200), encoding="utf-8")
    assert main(["check", str(mission), *more]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert said in told.err
    assert told.err.count("\n") == 1


def test_an_autopilot_that_is_none_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["check", "up.waypoints", "--for", "ardupilot,px5"])
    assert ended.value.code == 2
    assert (
        "argument --for: 'px5': expected one or more of ardupilot, ardupilot-4.6, ardupilot-4.7, px4, px4-1.16,"
        " px4-1.17, planfly" in capsys.readouterr().err
    )


@pytest.mark.parametrize("more", [[], ["--geometry"]])
def test_a_gap_in_seq_is_a_note_of_the_verdict(
    more: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A person who deletes a line by hand leaves a gap: jumps then lead elsewhere, which a log of CI must say."""
    monkeypatch.chdir(tmp_path)
    rows = ((0, 46.0, 0), (1, 46.0, 100), (3, 46.01, 100), (3, 46.015, 100))
    lines = [f"{seq} 0 {3 if alt else 0} 16 0 0 0 0 {lat} 8 {alt} 1" for seq, lat, alt in rows]
    Path("gap.waypoints").write_text("\n".join(["QGC WPL 110", *lines]) + "\n")
    notes = [
        "Note: gap.waypoints:4: the sequence numbers have a gap before 3 (1 gap in all): ",
        "Note: gap.waypoints:5: sequence number 3 is not above the previous line's number (1 such line in all): ",
    ]
    main(["check", "gap.waypoints", *more, "--json", "a.json", "--junit", "a.xml"])
    printed = capsys.readouterr().out
    output = ElementTree.parse("a.xml").find(".//system-out")
    assert output is not None
    for text in (printed, json.loads(Path("a.json").read_text())["summary"], output.text or ""):
        assert all(f"\n{note}" in text for note in notes)
    if not more:
        main(["fly", "gap.waypoints", "--log", "a.mcap"])
        capsys.readouterr()
        main(["check", "a.mcap"])
        assert all(f"\n{note}" in capsys.readouterr().out for note in notes[:1])


@pytest.mark.parametrize(
    ("argv", "name"),
    [
        (["check", "broken.waypoints", "--scenario", "tight"], "broken.waypoints"),
        (["fly", "broken.waypoints", "--log", "f.mcap"], "broken.waypoints"),
        (["import", "broken.BIN", "f.mcap"], "broken.BIN"),
        (["import", "broken.BIN", "f.mcap", "--scenario", "tight"], "broken.BIN"),
        (["run", "broken.toml"], "broken.toml"),
    ],
)
def test_an_error_is_a_case_with_the_name_of_the_file_in_junit(
    argv: list[str], name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken.waypoints").write_text("QGC WPL 110\nbroken\n")
    assert main([*argv, "--junit", "r.xml"]) == 2
    [suite] = ElementTree.parse("r.xml").getroot()
    assert (suite.get("name"), suite.get("errors")) == (name, "1")


@pytest.mark.parametrize(("stated", "code"), [(None, 0), (0, 0), (2, 4)])
def test_the_first_line_says_that_px4_rejects_a_mission_without_a_landing(
    stated: int | None, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """PX4's default is 2, a landing; a file that does not state the parameter does not fail the mission."""
    mission, params = tmp_path / "a.waypoints", tmp_path / "a.params"
    mission.write_text(
        MISSION.replace("3\t0\t3\t16\t0\t0\t0\t0\t46.01\t8.00\t{up}\t1\n", "").replace("4\t0", "3\t0").format(up=200),
        encoding="utf-8",
    )
    lines = ["1\t1\tNAV_ACC_RAD\t10.0\t9"] + ([] if stated is None else [f"1\t1\tMIS_TKO_LAND_REQ\t{stated}\t6"])
    params.write_text(
        "# Onboard parameters for Vehicle 1\n# Stack: PX4 Pro\n" + "\n".join(lines) + "\n", encoding="utf-8"
    )
    assert main(["check", str(mission), "--geometry", "--autopilot", "px4", "--params", str(params)]) == code
    first = capsys.readouterr().out.splitlines()[0]
    assert ("by default (MIS_TKO_LAND_REQ 2) PX4 rejects a mission without a landing" in first) is (stated is None)
