"""`planfly.figures`, `report`, `compare` and `export`: pictures as figures, and the commands' own files."""

import re
from dataclasses import replace
from itertools import chain
from pathlib import Path
from xml.etree import ElementTree

import pytest
from matplotlib.figure import Figure

import planfly
from flight.mission_files.formats import read_mission
from planfly.cli import main
from tests.logs.blank_pictures import draw_nothing
from tests.soak import SOAK
from world.scenario import with_flight

PLANNED = ["map", "profile", "scene", "turns", "envelope"]
FLOWN = ["map", "profile", "scene", "turns", "time", "exposure", "controls", "energy", "envelope"]


def test_figures_are_matplotlibs_by_name(
    flown: planfly.FlownMission, path: planfly.Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a log and of a plan; README's lines draw those of a flight.  A figure is the script's own to save."""
    assert flown.log is not None
    drawn = planfly.figures(str(flown.log))
    assert list(drawn) == FLOWN
    assert all(isinstance(figure, Figure) for figure in drawn.values())
    drawn["map"].savefig(tmp_path / "map.pdf")
    assert (tmp_path / "map.pdf").read_bytes().startswith(b"%PDF")
    if not SOAK:
        monkeypatch.setattr("logs.views.figures.draw", lambda *_: Figure())
    assert list(planfly.figures(path)) == PLANNED


def test_a_report_of_a_log_is_the_commands(
    flown: planfly.FlownMission, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw_nothing(monkeypatch)
    assert flown.log is not None
    ours = planfly.report(str(flown.log), tmp_path / "ours")
    assert main(["report", str(flown.log), "--out", str(tmp_path / "theirs")]) == 0
    pages = [(tmp_path / whose / "report.html").read_text() for whose in ("ours", "theirs")]
    assert pages[0] == pages[1].replace(f"planfly report {flown.log}", "planfly.report")
    assert {file.name for file in ours.files} == {file.name for file in (tmp_path / "theirs").iterdir()}


def test_results_are_replaced_where_the_script_says_so_alone(
    flown: planfly.FlownMission, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not SOAK:
        draw_nothing(monkeypatch)
    (tmp_path / "map.png").write_text("old")
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(planfly.PlanflyError, match="not empty; overwrite=True replaces"):
        planfly.report(flown, tmp_path)
    assert (tmp_path / "map.png").read_text() == "old"
    written = planfly.report(flown, str(tmp_path), svg=SOAK, overwrite=True)
    assert written.page == tmp_path / "report.html"
    assert {*written.files, tmp_path / "notes.txt"} == set(tmp_path.iterdir())
    assert not SOAK or "map.svg" in {file.name for file in written.files}
    assert flown.verdict.headline.split(":")[0] in written.page.read_text()


@pytest.mark.usefixtures("unrendered")
def test_two_flights_are_compared_and_drawn(flown: planfly.FlownMission, tmp_path: Path) -> None:
    assert flown.log is not None
    found = planfly.compare(flown.log, planfly.read_log(flown.log), tmp_path / "out")
    assert found.differences[0].name == "time in the air"
    assert found.differences[0].first == found.differences[0].second
    assert (tmp_path / "out" / "compare.html").is_file()
    assert repr(found).startswith("<Comparison flight.mcap (first) and flight.mcap (second): ")
    assert len(repr(found)) < 200
    rows = [[cell.text for cell in row] for row in ElementTree.fromstring(found._repr_html_()).iter("tr")]
    assert rows[2][0] == "time in the air"
    assert rows[2][4] == "0.00"


def test_a_plan_a_flight_and_files_are_exported(
    path: planfly.Plan, flown: planfly.FlownMission, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    written = planfly.export(path, tmp_path / "a.waypoints", str(tmp_path / "a.plan"))
    assert written.files == (tmp_path / "a.waypoints", tmp_path / "a.plan")
    places = list(chain.from_iterable((item.lat_deg, item.lon_deg) for item in flown.mission.items))
    for file in written.files:
        read = chain.from_iterable((item.lat_deg, item.lon_deg) for item in read_mission(file).items)
        assert list(read) == pytest.approx(places)
    planfly.export(flown, tmp_path / "a.kml")
    assert len(re.findall("<LineString>", (tmp_path / "a.kml").read_text())) >= 2
    planfly.export(tmp_path / "a.waypoints", tmp_path / "b.plan")
    # What the command says on a terminal is the result's here.
    assert capfd.readouterr() == ("", "")


def test_what_a_file_does_not_hold_is_told(tmp_path: Path) -> None:
    gap = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t46\t8\t0\t1\n2\t0\t3\t16\t0\t0\t0\t0\t46.1\t8\t90\t1\n"
    (tmp_path / "a.waypoints").write_text(gap)
    gap_note, autopilot_note = planfly.export(tmp_path / "a.waypoints", tmp_path / "a.plan").notes
    assert "names no autopilot" in autopilot_note
    assert "the sequence numbers have a gap before 2" in gap_note


def test_a_plan_for_px4_without_a_landing_is_exported_with_a_word(path: planfly.Plan, tmp_path: Path) -> None:
    for_px4 = replace(path, scenario=with_flight(path.scenario, autopilot="px4"))
    said = "PX4's fixed-wing default refuses a mission without a landing: add one, or set MIS_TKO_LAND_REQ 0"
    assert said in planfly.export(for_px4, tmp_path / "a.plan").notes
    assert said not in planfly.export(path, tmp_path / "b.plan").notes
    assert said not in planfly.export(for_px4, tmp_path / "c.plan", autopilot="ardupilot").notes


def test_a_mission_that_becomes_one_for_px4_is_exported_with_a_word(path: planfly.Plan, tmp_path: Path) -> None:
    said = "PX4's fixed-wing default refuses a mission without a landing: add one, or set MIS_TKO_LAND_REQ 0"
    for name in ("a.plan", "a.waypoints"):
        assert said in planfly.export(path, tmp_path / name, autopilot="px4").notes
    # The requirement that a parameter file states applies, without the word default.
    for value, found in ((0, ()), (2, ("MIS_TKO_LAND_REQ 2 requires a landing",))):
        params = tmp_path / "px4.params"
        params.write_text(f"# Stack: PX4 Pro\n1\t1\tMIS_TKO_LAND_REQ\t{value}\t6\n", encoding="ascii")
        notes = planfly.export(path, tmp_path / f"b{value}.plan", params=params).notes
        assert tuple(note.partition(", but")[0] for note in notes if "LAND_REQ" in note) == found
    # A mission file, too; a file without its items does not say so.
    assert said in planfly.export(tmp_path / "a.plan", tmp_path / "d.plan").notes
    assert said not in planfly.export(tmp_path / "a.plan", tmp_path / "d.kml").notes


def test_bad_exports_write_nothing(path: planfly.Plan, tmp_path: Path) -> None:
    with pytest.raises(planfly.MissionError, match="suffix"):
        planfly.export(path, tmp_path / "a.waypoints", tmp_path / "a.doc")
    with pytest.raises(planfly.PlanflyError, match="expected at least one file"):
        planfly.export(path)
    assert list(tmp_path.iterdir()) == []
    planfly.export(path, tmp_path / "a.plan")
    with pytest.raises(planfly.PlanflyError, match="overwrite=True replaces it"):
        planfly.export(path, tmp_path / "a.plan")
    planfly.export(path, tmp_path / "a.plan", overwrite=True)


def test_a_flight_without_a_log_has_none_to_export(flown: planfly.FlownMission, tmp_path: Path) -> None:
    bare = planfly.FlownMission(flown.setup, flown.track, flown.verdict, flown.ended)
    with pytest.raises(planfly.PlanflyError, match="the flight has no log"):
        planfly.export(bare, tmp_path / "a.kml")
