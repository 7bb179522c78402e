"""``planfly survey``: a survey without turn-arounds, what it prints, answers and writes; and what would help."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import planfly
from flight.mission.items import Camera, MissionItem, SurveyPlan
from flight.mission_files.formats import mission_text, read_mission
from flight.simulation.setup import FlightSetup
from logs.verdict.verdict import Verdict
from planfly.api import surveying
from planfly.cli import main
from planfly.surveys import survey_remedies
from planfly.surveys.survey_remedies import SurveyRemedy, TriedRemedies
from planfly.workflow.uav import Uav
from tests.soak import SOAK

FIELD_SURVEY = Path(__file__).with_name("field.waypoints")
BY = ["--aircraft", "x8", "--autopilot", "ardupilot"]


def test_each_line_is_told_and_what_would_help_is_flown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    if not SOAK:
        # Fifteen flights more, of which some help, too.
        for kind in (
            "try_other_side",
            "find_stride",
            "find_course",
            "find_parameter",
            "find_airspeed",
            "try_default_airspeed",
        ):
            monkeypatch.setattr(survey_remedies._Trials, kind, lambda *_: None)
    asked = ["survey", str(FIELD_SURVEY), *BY, "--suggest", "--out", "better", "--json", "answer.json"]
    assert main(asked) == 4
    out = capsys.readouterr().out
    assert "survey    0 of 4 photo lines can be used" in out
    assert "4 lines, 60 m apart, the first on course 0°" in out
    # Whose lines they are, in which weather and world.
    aircraft, world, pilot = out.splitlines()[2:5]
    assert aircraft == "  Aircraft: x8, 3.36 kg, 18 m/s equivalent airspeed (its cruise speed)"
    assert world.startswith("  Conditions: no wind, no turbulence; ")
    assert pilot.startswith("  Flown by: the simulated ArduPlane 4.7")
    assert "would help: turn-arounds of" in out
    answer = json.loads((tmp_path / "answer.json").read_text(encoding="utf-8"))
    assert (answer["conditions"]["aircraft"], answer["conditions"]["wind_mps"]) == ("x8", 0.0)
    [lines] = answer["surveys"]
    assert [(one["first_item"], one["last_item"]) for one in lines] == [(2, 4), (6, 8), (10, 12), (14, 16)]
    for one in lines:
        parts = sum(one[name] for name in ("usable", "away", "banked", "high", "dark", "unknown"))
        assert parts == pytest.approx(1.0, abs=0.001)
        assert sum(high - low for low, high in one["lost_m"]) == pytest.approx(500.0 * (1.0 - one["usable"]), abs=2.0)
    assert (tmp_path / "better" / "survey.png").read_bytes().startswith(b"\x89PNG")
    assert "next      planfly survey better/turn-around.waypoints with the same options" in out
    # What is said to help does: flown again from its file, all lines can be used.
    assert "turn-around" in {one["kind"] for one in answer["remedies"]}
    assert main(["survey", "better/turn-around.waypoints", *BY]) == 0
    assert "4 of 4 photo lines can be used" in capsys.readouterr().out


def test_a_flight_and_its_log_say_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flown = planfly.fly(FIELD_SURVEY, aircraft="x8", autopilot="ardupilot", log=tmp_path / "f.mcap")
    assert [item.rule for item in flown.verdict.findings if item.ok is False] == ["survey"] * 4
    of_flight, of_log = planfly.survey(flown), planfly.survey(tmp_path / "f.mcap")
    assert of_flight.survey_lines == of_log.survey_lines
    assert repr(of_log) == f"<SurveyResult field.waypoints: {of_log.headline}>"
    assert of_log.survey_lines[2] == "overlap not judged: the camera is unknown (--camera)"
    # 120 m up: 176 m by 117 m, a photo each 20 m; lines 60 m apart, each within 20 m of where it is drawn.
    [seen] = planfly.survey(flown, camera=(23.5, 15.6, 16.0)).overlaps
    assert seen is not None
    assert seen.front == pytest.approx(1.0 - 20.0 / 117.0, abs=0.02)
    assert 1.0 - 100.0 / 176.0 <= seen.side <= 1.0 - 60.0 / 176.0
    # What was asked for is told beside it: 95 % along are 12 more than such photos give.
    capsys.readouterr()
    asked = ["survey", str(tmp_path / "f.mcap"), "--camera", "23.5x15.6,16,95,60", "--json", str(tmp_path / "a.json")]
    assert main(asked) == 4
    out = capsys.readouterr().out
    assert "front overlap 8" in out
    assert "95 % is required" in out
    [found] = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))["overlaps"]
    assert (found["front"], found["front_asked"]) == (pytest.approx(seen.front, abs=1e-3), 0.95)
    assert (found["side"], found["side_asked"]) == (pytest.approx(seen.side, abs=1e-3), 0.6)


def test_a_parameter_that_would_help_is_written_beside_ones_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def found(setup: FlightSetup, _: Uav, verdict: Verdict, *__: Any) -> TriedRemedies:
        laid = replace(setup.mission, items=setup.mission.items[:-1])
        of = SurveyRemedy("parameter", "ROLL_LIMIT_DEG", 35.0, 47.0, "deg", verdict, laid, 5000.0, 150.0)
        return TriedRemedies((of,))

    monkeypatch.setattr(surveying, "find_survey_remedies", found)
    monkeypatch.chdir(tmp_path)
    # With all parameters of the file, flown or not.
    Path("own.param").write_text("# mine\nNAVL1_PERIOD,15.5\nSERVO1_TRIM,1500\n", encoding="ascii")
    assert main(["survey", str(FIELD_SURVEY), *BY, "--params", "own.param", "--suggest", "--out", "better"]) == 4
    told = "next      planfly survey better/parameter.waypoints --params better/parameter.param with the same options"
    assert told in capsys.readouterr().out
    assert Path("better/parameter.param").read_text(encoding="ascii") == (
        "# mine\nNAVL1_PERIOD,15.5\nSERVO1_TRIM,1500\nROLL_LIMIT_DEG,47\n"
    )
    assert len(Path("better/parameter.waypoints").read_text(encoding="ascii").splitlines()) == 19


def test_parameters_of_px4_are_in_a_file_for_qgroundcontrol(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def found(setup: FlightSetup, _: Uav, verdict: Verdict, *__: Any) -> TriedRemedies:
        of = SurveyRemedy("parameter", "NAV_ACC_RAD", 60.0, 10.0, "m", verdict, setup.mission, 5000.0)
        return TriedRemedies((of,))

    monkeypatch.setattr(surveying, "find_survey_remedies", found)
    monkeypatch.chdir(tmp_path)
    Path("own.params").write_text("1\t1\tNAV_ACC_RAD\t60\t9\n", encoding="ascii")
    options = ["--aircraft", "x8", "--autopilot", "px4", "--params", "own.params", "--suggest", "--out", "better"]
    assert main(["survey", str(FIELD_SURVEY), *options]) == 4
    out = capsys.readouterr().out
    assert "  written better/parameter.params\n" in out
    assert "before the end of a line (NAV_ACC_RAD 60 m)\n" in out
    assert Path("better/parameter.params").read_text(encoding="ascii") == "1\t1\tNAV_ACC_RAD\t10\t9\n"


def test_a_layout_for_a_plan_is_a_plan_with_all_that_it_holds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With fence, rally points and firmwareType; its items hold no camera, so that the next command states it."""

    def found(setup: FlightSetup, _: Uav, verdict: Verdict, *__: Any) -> TriedRemedies:
        laid = replace(setup.mission, items=setup.mission.items[:-1])
        return TriedRemedies((SurveyRemedy("turn-around", "", 0.0, 150.0, "m", verdict, laid, 5000.0, 150.0),))

    monkeypatch.setattr(surveying, "find_survey_remedies", found)
    monkeypatch.chdir(tmp_path)
    mission = read_mission(FIELD_SURVEY)
    lat, lon = next((item.lat_deg, item.lon_deg) for item in mission.items if item.has_position)
    corners = ((lat - 0.2, lon - 0.2), (lat - 0.2, lon + 0.2), (lat + 0.2, lon))
    fences = tuple(MissionItem(k, 5001, 0, (3.0, 0.0, 0.0, 0.0), *place, 0.0) for k, place in enumerate(corners))
    rally = MissionItem(0, 5100, 3, (0.0,) * 4, lat, lon, 100.0)
    whole = replace(mission, fences=fences, rally=(rally,), autopilot="px4")
    Path("field.plan").write_text(mission_text(whole, "plan"), encoding="utf-8")
    options = ["--aircraft", "x8", "--suggest", "--out", "better", "--camera", "23.5x15.6,16,75,60"]
    assert main(["survey", "field.plan", *options]) == 4
    out = capsys.readouterr().out
    assert "next      planfly survey better/turn-around.plan with the same options" in out
    # Of a plan of plain items nothing is lost, so that nothing is said of it; a survey of a ground station is.
    assert "  written better/turn-around.plan\n" in out
    opened = surveying.open_flight

    def with_survey_item(*how: Any) -> FlightSetup:
        setup = opened(*how)
        plans = (SurveyPlan(20.0, 0.0, Camera(1.0, 1.0)),)
        return replace(setup, mission=replace(setup.mission, survey_plans=plans))

    monkeypatch.setattr(surveying, "open_flight", with_survey_item)
    assert main(["survey", "field.plan", *options, "--overwrite"]) == 4
    note = "  written better/turn-around.plan (the survey as plain items, without its camera)\n"
    assert note in capsys.readouterr().out
    written = read_mission(Path("better/turn-around.plan"))
    assert (len(written.items), len(written.fences), len(written.rally)) == (len(mission.items) - 1, 3, 1)
    assert written.autopilot == "px4"
    # The camera of the plan is stated as it is: 23.5 mm by 15.6 mm behind 16 mm.
    without_camera = options[: options.index("--camera")]

    def with_camera(*how: Any) -> FlightSetup:
        setup, camera = opened(*how), Camera(23.5 / 16.0, 15.6 / 16.0, 0.75, 0.6, focal_length_mm=16.0)
        return replace(setup, mission=replace(setup.mission, survey_plans=(SurveyPlan(20.0, 0.0, camera),)))

    monkeypatch.setattr(surveying, "open_flight", with_camera)
    assert main(["survey", "field.plan", *without_camera, "--overwrite"]) == 4
    next_command = "planfly survey better/turn-around.plan --camera 23.5x15.6,16,75,60 with the same options"
    assert f"next      {next_command}" in capsys.readouterr().out


@pytest.mark.parametrize("camera", [(23.5, 15.6), (23.5, 0.0, 16.0), "23.5x15.6,16", (1.0, 1.0, 1.0, 70.0, 100.0), 5])
def test_a_camera_that_is_none_is_one_line(camera: Any) -> None:
    with pytest.raises(
        planfly.PlanflyError, match="the sensor's size across and along the track and the focal length, mm"
    ):
        planfly.survey(FIELD_SURVEY, camera=camera)


def test_what_is_no_survey_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = FIELD_SURVEY.read_text(encoding="ascii").splitlines()
    short = tmp_path / "short.waypoints"
    # One line: two are a survey where photos are taken along them.
    short.write_text("\n".join(rows[:7]) + "\n", encoding="ascii")
    assert main(["survey", str(short), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "no survey found; expected at least three parallel lines, or two with photos along them" in said
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()
