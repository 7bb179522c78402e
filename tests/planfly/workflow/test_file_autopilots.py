"""Files that name their autopilot: the model is taken from them, or they are refused in one line."""

import json
from pathlib import Path

import pytest

import planfly
from planfly.cli import main

WAYPOINTS = """QGC WPL 110
0 1 0 16 0 0 0 0 47.02 8.14 300 1
1 0 3 16 0 0 0 0 47.03 8.14 100 1
2 0 3 16 0 0 0 0 47.05 8.14 100 1
"""
PX4_PARAMS = "# Stack: PX4 Pro\n# Vehicle: Fixed wing aircraft\n1\t1\tFW_R_TC\t0.3\t9\n1\t1\tNAV_ACC_RAD\t40.0\t9\n"
ARDUPLANE_PARAMS = "TECS_CLMB_MAX,4\r\nWP_RADIUS,60\r\n"
COPTER_PARAMS = "ATC_RAT_RLL_P,0.135\nWPNAV_SPEED,500\nWP_RADIUS,60\n"
MIXED_PARAMS = "FW_R_TC 0.3\nNAV_ACC_RAD 40\nTECS_CLMB_MAX 4\nWP_RADIUS 60\n"


def plan_text(firmware: int | None, vehicle: int | None = 1) -> str:
    items = [
        {"type": "SimpleItem", "command": 16, "doJumpId": k, "frame": 3, "params": [0, 0, 0, None, lat, 8.14, 100]}
        for k, lat in enumerate((47.03, 47.05), 1)
    ]
    mission = {"version": 2, "plannedHomePosition": [47.02, 8.14, 300], "items": items}
    mission |= {} if firmware is None else {"firmwareType": firmware}
    mission |= {} if vehicle is None else {"vehicleType": vehicle}
    return json.dumps({"fileType": "Plan", "version": 1, "mission": mission})


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    texts = {
        "m.waypoints": WAYPOINTS,
        "px4.params": PX4_PARAMS,
        "plane.param": ARDUPLANE_PARAMS,
        "copter.param": COPTER_PARAMS,
        "mixed.param": MIXED_PARAMS,
        "px4.plan": plan_text(12),
        "plane.plan": plan_text(3),
        "generic.plan": plan_text(0),
        "unstated.plan": plan_text(None, None),
        "copter.plan": plan_text(3, 2),
        "vtol.plan": plan_text(12, 22),
        "tracker.plan": plan_text(3, 5),
        "slugs.plan": plan_text(1),
    }
    for name, text in texts.items():
        (tmp_path / name).write_bytes(text.encode())
    return tmp_path


@pytest.mark.parametrize(
    ("mission", "options", "flies"),
    [
        ("m.waypoints", {}, "ardupilot"),
        ("m.waypoints", {"params": "px4.params"}, "px4"),
        ("m.waypoints", {"params": "plane.param"}, "ardupilot"),
        ("px4.plan", {}, "px4"),
        ("px4.plan", {"params": "px4.params"}, "px4"),
        ("plane.plan", {}, "ardupilot"),
        ("plane.plan", {"params": "plane.param"}, "ardupilot"),
        ("generic.plan", {}, "ardupilot"),
        ("generic.plan", {"params": "px4.params"}, "px4"),
        ("unstated.plan", {"autopilot": "px4"}, "px4"),
        ("px4.plan", {"autopilot": "px4-1.16"}, "px4"),
        # planfly's own guidance says nothing of an autopilot.
        ("px4.plan", {"autopilot": "planfly"}, "planfly"),
        # Whoever names an autopilot says which of the names apply.
        ("m.waypoints", {"params": "mixed.param", "autopilot": "px4"}, "px4"),
        ("m.waypoints", {"params": "mixed.param", "autopilot": "ardupilot"}, "ardupilot"),
    ],
)
@pytest.mark.usefixtures("files")
def test_the_autopilot_is_taken_from_the_files(mission: str, options: dict[str, str], flies: str) -> None:
    judged = planfly.judge(mission, geometry=True, **options)  # type: ignore[arg-type]
    assert judged.setup.autopilot.name == flies
    (line,) = [line for line in judged.verdict.lines if line.startswith("Autopilot: ")]
    taken = flies == "px4" and "autopilot" not in options
    assert line.endswith(", because no autopilot was named") is taken
    if taken:
        file = options.get("params", mission)
        assert line.startswith("Autopilot: the simulated PX4 1.17 with")
        assert f"; taken from {Path(file).resolve() if file.endswith('params') else file}, because no" in line


TO_PX4 = "but ArduPlane is to fly; --autopilot px4 simulates PX4 instead"
TO_ARDUPLANE = "but PX4 is to fly; --autopilot ardupilot simulates ArduPlane instead"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("m.waypoints --params px4.params --autopilot ardupilot", f'PX4 ("# Stack: PX4 Pro"), {TO_PX4}'),
        (
            "m.waypoints --params plane.param --autopilot px4",
            f"(TECS_CLMB_MAX, WP_RADIUS), {TO_ARDUPLANE}",
        ),
        ("px4.plan --autopilot ardupilot", f"px4.plan: written for PX4 (firmwareType 12), {TO_PX4}"),
        ("plane.plan --autopilot px4", f"plane.plan: written for ArduPilot (firmwareType 3), {TO_ARDUPLANE}"),
        ("px4.plan --params plane.param", "px4.plan: written for PX4 (firmwareType 12), but"),
        ("plane.plan --params px4.params", "plane.plan: written for ArduPilot (firmwareType 3), but"),
        (
            "m.waypoints --params copter.param",
            "copter.param: the parameters are for a multicopter or helicopter (ArduPilot): ",
        ),
        ("m.waypoints --params mixed.param", "FW_R_TC is PX4's and TECS_CLMB_MAX is ArduPilot's: --autopilot names"),
        ("copter.plan", "copter.plan: mission.vehicleType: 2: a multicopter or helicopter"),
        ("vtol.plan", "vtol.plan: mission.vehicleType: 22: a VTOL aircraft"),
        ("tracker.plan", "tracker.plan: mission.vehicleType: 5: not a fixed-wing aircraft"),
        ("slugs.plan", "slugs.plan: mission.firmwareType: 1: not an autopilot that planfly simulates"),
    ],
)
@pytest.mark.usefixtures("files")
def test_files_that_contradict_are_refused_in_a_line(words: str, says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", *words.split()]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line


SCENARIO = """name = "field"
description = "a field"
[terrain]
kind = "flat"
amsl_m = 300.0
[origin]
lat_deg = 47.02
lon_deg = 8.14
[area]
east_m = [-3000, 3000]
north_m = [-1000, 9000]
ceiling_amsl_m = 2000
[start]
east_m = 0
north_m = 0
amsl_m = 400
[destination]
east_m = 0
north_m = 5000
amsl_m = 400
[flight]
"""


@pytest.mark.parametrize(
    ("entries", "flies"),
    [
        ('params = "px4.params"', "px4"),
        ('params = "plane.param"', "ardupilot"),
        ('autopilot = "ardupilot"\nparams = "px4.params"', None),
        ('autopilot = "px4"\nparams = "plane.param"', None),
    ],
)
def test_a_scenario_that_names_an_autopilot_is_held_to_it(entries: str, flies: str | None, files: Path) -> None:
    (files / "field.toml").write_text(SCENARIO + entries + "\n", encoding="utf-8")
    if flies is None:
        with pytest.raises(planfly.PlanflyError, match=r"written for .*--autopilot"):
            planfly.judge("m.waypoints", scenario="field.toml")
        return
    assert planfly.judge("m.waypoints", scenario="field.toml").setup.autopilot.name == flies


@pytest.mark.parametrize(
    ("source", "firmware"), [("px4.plan", 12), ("plane.plan", 3), ("generic.plan", 3), ("m.waypoints", 3)]
)
def test_an_export_states_the_autopilot_that_flies(source: str, firmware: int, files: Path) -> None:
    planfly.export(source, "out.plan", "out.kml")
    mission = json.loads((files / "out.plan").read_text(encoding="utf-8"))["mission"]
    assert (mission["firmwareType"], mission["vehicleType"]) == (firmware, 1)
    assert planfly.judge("out.plan").setup.autopilot.name == planfly.judge(source).setup.autopilot.name
