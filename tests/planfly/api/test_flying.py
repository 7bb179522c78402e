"""What the verbs give prints in a line and is a table in a notebook."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import planfly
from logs.verdict.verdict import verdict_json
from planfly.cli import main
from planner.plan import plan_json
from tests.planfly.conftest import FIELD
from tests.setups import small_scenario


def test_a_flight_prints_in_a_line(flown: planfly.FlownMission) -> None:
    line = repr(flown)
    assert line.startswith("<FlownMission paper-07: completed; <Track: ")
    assert "<Verdict flown: flyable; " in line
    assert len(line) < 250


def test_a_flight_names_its_parts(flown: planfly.FlownMission, path: planfly.Plan) -> None:
    assert flown.flyable is flown.verdict.flyable is True
    assert flown.mission is flown.setup.mission
    assert flown.plan is path


def test_a_notebook_shows_verdict_and_track(flown: planfly.FlownMission) -> None:
    page = ElementTree.fromstring(f"<page>{flown._repr_html_()}</page>")
    assert [title.text for title in page.iter("strong")] == [flown.verdict.headline, repr(flown.track)[1:-1]]


def test_a_report_shows_its_files() -> None:
    written = planfly.WrittenReport(Path("out/report.html"), (Path("out/map.png"), Path("out/report.html")))
    page = ElementTree.fromstring(written._repr_html_())
    assert [cell.text for cell in page.iter("td")] == ["map.png", "report.html"]


# ----------------------------------------------------------------------
# `planfly.fly` and `planfly.check`: the chain's own flights and verdicts, of plans, files and logs alike.

MISSION = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t0\t1
1\t0\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t100\t1
2\t0\t0\t16\t0\t0\t0\t0\t46.01\t8.0\t120\t1
"""
FENCE = """QGC WPL 110
0\t1\t0\t5004\t300\t0\t0\t0\t46.005\t8.0\t0\t1
"""


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    (tmp_path / "m.waypoints").write_text(MISSION, encoding="ascii")
    (tmp_path / "keep-out.fence").write_text(FENCE, encoding="ascii")
    return tmp_path / "m.waypoints"


def test_it_flies_a_plan_as_the_command_flies_its_file(
    path: planfly.Plan, flown: planfly.FlownMission, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("plan.json").write_text(plan_json(path))
    assert main(["fly", "plan.json", "--wind", "4,270", "--log", "a.mcap", "--log-hz", "10"]) == 0
    log = planfly.read_log("a.mcap")
    np.testing.assert_array_equal(log.track.position[:, 2], planfly.read_log(str(flown.log)).track.position[:, 2])
    assert verdict_json(planfly.check("a.mcap")) == verdict_json(flown.verdict)


def test_a_flight_without_a_log_leaves_no_file(mission: Path) -> None:
    before = sorted(mission.parent.iterdir())
    flown = planfly.fly(mission)
    assert flown.log is None
    assert flown.ended == "completed"
    assert sorted(mission.parent.iterdir()) == before


@pytest.mark.parametrize("kind", [str, Path])
def test_files_are_named_as_text_or_path(kind: type, mission: Path) -> None:
    (mission.parent / "field.toml").write_text(FIELD)
    flown = planfly.fly(
        kind(mission),
        scenario=kind(mission.parent / "field.toml"),
        log=kind(mission.parent / "a.mcap"),
        fence=kind(mission.parent / "keep-out.fence"),
        log_hz=10,
    )
    assert flown.log == mission.parent / "a.mcap"
    assert flown.setup.scenario.name == "field"
    assert [finding.rule for finding in flown.verdict.failed if finding.rule == "fence"]
    assert planfly.check(kind(flown.log)) == flown.verdict


def test_weather_is_the_scripts(mission: Path) -> None:
    setup = planfly.fly(mission, wind=(5, 180), turbulence="light", airspeed=28, seed=7, max_hours=0.001).setup
    assert (setup.scenario.wind.speed, setup.scenario.wind.turbulence, setup.airspeed, setup.seed) == (
        5,
        "light",
        28,
        7,
    )


def test_a_flight_ends_where_it_is_limited(mission: Path) -> None:
    assert planfly.fly(mission, max_hours=0.001).track.time[-1] == pytest.approx(3.6, abs=0.1)


def test_a_plan_goes_into_another_scenario_as_a_mission(path: planfly.Plan) -> None:
    verdict = planfly.check(path, scenario="paper-15", geometry=True)
    assert verdict.level == "geometric"
    assert verdict != planfly.check(path, geometry=True)


def test_a_plan_and_its_file_are_judged_alike(path: planfly.Plan, tmp_path: Path) -> None:
    (tmp_path / "plan.json").write_text(plan_json(path))
    assert planfly.check(path) == planfly.check(tmp_path / "plan.json")


def test_a_flight_is_judged_as_it_was_flown(flown: planfly.FlownMission) -> None:
    assert flown.log is not None
    log = planfly.read_log(flown.log)
    assert planfly.check(log) == planfly.check(flown.log) == flown.verdict
    assert planfly.check(flown) is flown.verdict
    for source in (log, flown):
        with pytest.raises(
            planfly.ScenarioError, match="wind: not allowed with a log, which is judged with the aircraft"
        ) as caught:
            planfly.check(source, wind=(3, 0))
        assert (caught.value.field, caught.value.value) == ("wind", (3, 0))


def test_a_flight_is_judged_by_another_fence(flown: planfly.FlownMission, tmp_path: Path) -> None:
    assert flown.log is not None
    home = flown.mission.items[1]
    (tmp_path / "a.fence").write_text(FENCE.replace("46.005", f"{home.lat_deg}").replace("8.0", f"{home.lon_deg}"))
    for source in (flown, flown.log):
        verdict = planfly.check(source, fence=[tmp_path / "a.fence"])
        assert not verdict.flyable
        assert {finding.rule for finding in verdict.failed} == {"fence"}


@pytest.mark.parametrize("verb", [planfly.fly, planfly.check])
def test_a_file_that_is_not_there_is_one_line(verb: object, tmp_path: Path) -> None:
    with pytest.raises(planfly.PlanflyError) as caught:
        verb(tmp_path / "no.waypoints")  # type: ignore[operator]
    assert caught.value.file == str(tmp_path / "no.waypoints")


def test_a_program_that_is_none_is_refused_before_anything_flies(mission: Path) -> None:
    with pytest.raises(planfly.FlightError, match="no such file"):
        planfly.fly(mission, sitl=mission.parent / "arduplane")


def test_a_scenario_made_in_python_is_planned_and_flown() -> None:
    made = planfly.plan(small_scenario(), seed=1)
    assert planfly.fly(made, max_hours=0.002).plan is made


# ----------------------------------------------------------------------
# `planfly.plan_then_fly` and winds.


def test_both_at_once_are_the_one_after_the_other(tmp_path: Path) -> None:
    (tmp_path / "field.toml").write_text(f"{FIELD}[planner]\npopulation = 20\ngenerations = 5\n")
    field = str(tmp_path / "field.toml")
    flown_with = {"wind": (4.0, 90.0), "turbulence": "light", "airspeed": 27.0}
    both = planfly.plan_then_fly(field, seed=2, log=tmp_path / "f.mcap", **flown_with)
    plan = planfly.plan(field, seed=2, **flown_with)
    assert plan_json(both.plan) == plan_json(plan)
    assert verdict_json(both.verdict) == verdict_json(planfly.fly(plan, seed=2).verdict)
    assert planfly.read_log(tmp_path / "f.mcap").setup.scenario.wind.speed == 4.0


@pytest.mark.parametrize("wind", ["8,270", "8", 8, (8,), (8, 270, 1), ("a", "b"), {"speed": 8}])
def test_a_wind_that_is_none_is_refused_by_its_name_in_python(wind: object) -> None:
    with pytest.raises(
        planfly.PlanflyError, match=r"^wind .*: expected a speed, m/s, and the direction .* as \(8, 270\)$"
    ) as found:
        planfly.plan("paper-07", wind=wind)  # type: ignore[arg-type]
    assert (found.value.field, found.value.value) == ("wind", wind)


def test_a_wind_may_be_any_two_numbers() -> None:
    winds = ((4, 90), [4.0, 90.0], np.array([4.0, 90.0]))
    assert len({plan_json(planfly.plan("paper-07", seed=1, wind=wind)) for wind in winds}) == 1  # type: ignore[arg-type]


def test_a_scenario_has_to_be_planned_first(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(FIELD)
    for mission in (tmp_path / "mine.toml", "tight"):
        with pytest.raises(planfly.PlanflyError, match=r"a scenario, which has to be planned first: .*plan_then_fly"):
            planfly.fly(mission)
    with pytest.raises(planfly.ArgumentError, match=r"expected a Plan, text or a path; planfly.plan makes a plan"):
        planfly.fly(small_scenario())  # type: ignore[arg-type]


def test_an_export_of_a_plan_names_no_temporary_file(path: planfly.Plan, tmp_path: Path) -> None:
    with pytest.raises(planfly.PlanflyError) as of_flight:
        planfly.export(path, tmp_path / "p.csv")
    assert str(of_flight.value) == (
        f"{tmp_path / 'p.csv'}: only a flight log (.mcap) can be exported as .csv, not a plan or a mission"
    )
