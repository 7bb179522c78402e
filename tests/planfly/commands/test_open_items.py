"""Items that change the flight path and are not flown leave the verdict open: exit code 3 in check and in fly.

The missions are small copies of what was reported: ArduPilot #21534 (jump tags), #30376 (commands behind a jump), and
items of ArduPlane's commands_logic.cpp.
"""

import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from aircraft.catalog import load_aircraft
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.planfly.autopilot import PlanflyGuidance
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4.parameters import Px4Parameters
from flight.mission.items import Mission
from logs.verdict.judge_geometry import judge_geometry
from planfly.cli import main
from planfly.workflow.open_flight import make_setup
from planfly.workflow.uav import load_uav
from tests.mission_lines import mission, wp
from world.scenario import scenario_from_spec

SPEC = {
    "name": "items",
    "origin": {"lat_deg": 36.5, "lon_deg": -84.2},
    "terrain": {"kind": "flat", "amsl_m": 300.0},
    "area": {"east_m": [-9000, 9000], "north_m": [-9000, 9000], "ceiling_amsl_m": 4000},
    "start": {"east_m": 0.0, "north_m": -3000.0, "amsl_m": 500.0},
    "destination": {"east_m": 0.0, "north_m": 4000.0, "amsl_m": 500.0},
}

START = (
    "0 1 0 16 0 0 0 0 36.2578 -84.1401 335 1",
    "1 0 3 16 0 0 0 0 36.2578 -84.1401 200 1",
    "2 0 3 16 0 0 0 0 36.2640 -84.1401 200 1",
)
END = "{} 0 3 16 0 0 0 0 36.2640 -84.1150 200 1"


def written(path: Path, *lines: str) -> str:
    rows = [*START, *(f"{k} 0 {line}" for k, line in enumerate(lines, 3))]
    path.write_text("\n".join(["QGC WPL 110", *rows, END.format(len(rows))]), encoding="utf-8")
    return str(path)


# By the autopilot: an item between two places, and the answer.  Not judged in full: it steers and is not flown.  Not
# flyable: the autopilot refuses it at the upload.
FLYABLE, OPEN, REFUSED = "flyable", "not judged in full", "not flyable"
LAWS = {
    "ArduPlane": lambda: ArduPlane(ArduPilotParameters.load(load_aircraft("aerosonde"))),
    "PX4": lambda: Px4(Px4Parameters.defaults("1.17")),
    "planfly": PlanflyGuidance,
}
CASES = {
    ("ArduPlane", "3 30 1 0 0 0 0 0 300"): OPEN,
    ("ArduPlane", "3 188 0 0 0 0 0 0 0"): FLYABLE,
    ("ArduPlane", "2 42702 1 10 0 0 0 0 0"): OPEN,
    ("ArduPlane", "2 223 0 0 0 0 0 0 0"): OPEN,
    ("ArduPlane", "2 210 1 0 0 0 0 0 0"): OPEN,
    ("ArduPlane", "2 208 2 0 0 0 0 0 0"): OPEN,
    ("ArduPlane", "2 218 50 2 0 0 0 0 0"): OPEN,
    ("ArduPlane", "2 83 5000 0 0 0 0 0 0"): OPEN,
    ("ArduPlane", "2 93 60 0 0 0 0 0 0"): FLYABLE,
    ("ArduPlane", "2 183 9 1500 0 0 0 0 0"): FLYABLE,
    ("ArduPlane", "2 2003 1 0 0 0 0 0 0"): REFUSED,
    ("ArduPlane", "2 186 100 3 0 0 0 0 0"): REFUSED,
    ("ArduPlane", "2 176 1 0 0 0 0 0 0"): REFUSED,
    ("ArduPlane", wp(900, 1000, 200, command=22)): OPEN,
    ("ArduPlane", "3 16 0 0 0 0 0 0 250"): OPEN,
    ("ArduPlane", wp(700, 1500, 200, p="0 0 150 0")): FLYABLE,
    ("ArduPlane", wp(700, 1500, 200, p="0 0 -150 0")): OPEN,
    ("ArduPlane", "2 178 1 20 -1 0 0 0 0"): FLYABLE,
    ("ArduPlane", "2 178 0 -1 60 0 0 0 0"): OPEN,
    ("ArduPlane", "2 178 0 20 60 0 0 0 0"): FLYABLE,
    ("PX4", "2 93 60 0 0 0 0 0 0"): OPEN,
    ("PX4", "2 179 1 0 0 0 0 0 0"): OPEN,
    ("PX4", "2 2003 1 0 0 0 0 0 0"): FLYABLE,
    ("PX4", "3 30 1 0 0 0 0 0 300"): REFUSED,
    ("PX4", "2 600 9 0 0 0 0 0 0"): REFUSED,
    ("planfly", "3 30 1 0 0 0 0 0 300"): OPEN,
    ("planfly", "2 2003 1 0 0 0 0 0 0"): FLYABLE,
    ("planfly", "2 5000 1 0 0 0 0 0 0"): REFUSED,
}


def answer(law: str, read: Mission) -> str:
    scenario = scenario_from_spec(SPEC, "items")
    uav = replace(load_uav(scenario), autopilot=LAWS[law]())
    return judge_geometry(make_setup(scenario, uav, read, 1)).answer


@pytest.mark.parametrize(("law", "line"), CASES)
def test_a_mission_is_answered_by_what_the_autopilot_does_with_its_item(law: str, line: str) -> None:
    items = wp(0, 0, 200), wp(0, 1500, 200), line, wp(1500, 1500, 200)
    assert answer(law, mission(*items)) == CASES[law, line]


@pytest.mark.parametrize(("law", "expected"), [("ArduPlane", FLYABLE), ("PX4", OPEN)])
def test_px4_waits_where_autocontinue_is_0_and_arduplane_does_not(law: str, expected: str) -> None:
    read = mission(wp(0, 0, 200), wp(0, 1500, 200), wp(1500, 1500, 200))
    items = read.items[0], replace(read.items[1], autocontinue=False), read.items[2]
    assert answer(law, replace(read, items=items)) == expected
    last = *read.items[:2], replace(read.items[2], autocontinue=False)
    assert answer(law, replace(read, items=last)) == FLYABLE


@pytest.mark.parametrize("condition", ["2 112 5 0 0 0 0 0 0", "2 114 300 0 0 0 0 0 0"])
def test_a_condition_leaves_the_verdict_open_where_it_holds_back_a_speed(condition: str) -> None:
    begin, end = (wp(0, 0, 200), wp(0, 1500, 200)), wp(1500, 1500, 200)
    speed, servo = "2 178 0 22 -1 0 0 0 0", "2 183 9 1500 0 0 0 0 0"
    assert answer("ArduPlane", mission(*begin, condition, speed, end)) == OPEN
    assert answer("ArduPlane", mission(*begin, condition, servo, end)) == FLYABLE
    assert answer("ArduPlane", mission(*begin, speed, condition, end)) == FLYABLE


def test_an_open_item_is_named_in_the_headline_the_json_and_the_junit_of_check_and_fly(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path / "m.waypoints", "3 30 1 0 0 0 0 0 300 1")
    for command in ("check", "fly"):
        files = [str(tmp_path / f"{command}.{suffix}") for suffix in ("json", "xml")]
        log = ["--log", str(tmp_path / "f.mcap")] if command == "fly" else []
        args = [command, path, "--terrain", "jacksboro", "--json", files[0], "--junit", files[1], *log]
        assert main(args) == 3
        assert capsys.readouterr().out.startswith(
            "not judged in full: item 3: NAV_CONTINUE_AND_CHANGE_ALT is not flown"
        )
        verdict = json.loads(Path(files[0]).read_text(encoding="utf-8"))
        verdict = verdict if command == "check" else verdict["verdict"]
        assert verdict["answer"] == "not judged in full"
        assert [(one["place"]["item"], one["ok"]) for one in verdict["findings"] if one["check"] == "not flown"] == [
            (3, None)
        ]
        cases = ElementTree.parse(files[1]).getroot().iter("testcase")
        said = {case.get("classname"): [child.tag for child in case] for case in cases if len(case)}
        suite = f"planfly.{str(path).replace('.', '_')}"
        assert said[suite] == ["failure"]
        assert said[f"{suite}.mission"] == ["skipped"]
