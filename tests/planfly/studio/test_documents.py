"""What is opened: every form of file that `planfly check` reads, dropped on the page or in the folder."""

import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from flight.mission_files.formats import mission_text
from logs.recording.example_log import write_example_log
from planfly.flight_options import MissionOptions
from planfly.studio.documents import DROPPED_SUFFIXES, open_document, open_dropped, straight_plan
from planfly.studio.folder import find_file_in_folder, folder_message
from planner.plan import plan_json
from tests.logs.importers.written_logs import dataflash, gpx, igc, kml, px4, telemetry
from tests.planfly.studio.drafts import drawn_session, world_of
from world.errors import MissionError, PlanflyError

ROOT = Path(__file__).parents[3]


def zipped_kml(path: Path) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        archive.write(kml(path.with_suffix(".kml")), "doc.kml")
    return path


def written_mission(path: Path) -> Path:
    form = "plan" if path.suffix == ".plan" else "waypoints"
    path.write_text(mission_text(drawn_session(8, 8).mission, form), encoding="utf-8")
    return path


def written_plan(path: Path) -> Path:
    path.write_text(plan_json(straight_plan(world_of("jacksboro-air")[0], 1)), encoding="utf-8")
    return path


# Each suffix with what writes such a file, and how many items its mission has; none for a track alone.
FORMS: dict[str, tuple[Callable[[Path], Path], int]] = {
    ".waypoints": (written_mission, 8),
    ".txt": (written_mission, 8),
    ".plan": (written_mission, 8),
    ".json": (written_plan, 2),
    ".mcap": (write_example_log, 3),
    ".bin": (dataflash, 3),
    ".tlog": (telemetry, 3),
    ".ulg": (px4, 3),
    ".gpx": (gpx, 3),
    ".igc": (igc, 3),
    ".kml": (kml, 0),
    ".kmz": (zipped_kml, 0),
}


def test_each_suffix_is_tried() -> None:
    assert tuple(FORMS) == DROPPED_SUFFIXES


@pytest.mark.parametrize("suffix", FORMS)
def test_a_file_of_each_suffix_is_opened(suffix: str, tmp_path: Path) -> None:
    write, items = FORMS[suffix]
    data = write(tmp_path / f"a{suffix}").read_bytes()
    assert find_file_in_folder(tmp_path, f"a{suffix}") == tmp_path.resolve() / f"a{suffix}"
    # Only what can be opened is listed: a .kml and a .kmz have no mission.
    assert (f"a{suffix}" in folder_message(tmp_path)["files"]) is (items > 0)
    if not items:
        with pytest.raises(PlanflyError, match=f"^A{suffix.upper()}: contains a track but no mission"):
            open_dropped(f"A{suffix.upper()}", data, MissionOptions())
        return
    world = MissionOptions(scenario="jacksboro") if write is written_mission else MissionOptions()
    document = open_dropped(f"A{suffix.upper()}", data, world)
    mission = document.setup.mission
    assert len([item for item in mission.items if item.has_position]) == items
    assert (document.name, document.path) == (f"A{suffix.upper()}", None)


def test_a_map_of_planflys_own_is_not_listed_and_says_that_it_has_no_mission(tmp_path: Path) -> None:
    session = drawn_session(8, 10)
    (tmp_path / "m.kml").write_bytes(session.save("kml").data)
    (tmp_path / "m.waypoints").write_bytes(session.save("waypoints").data)
    assert folder_message(tmp_path)["files"] == ["m.waypoints"]
    with pytest.raises(PlanflyError, match=r"m\.kml: contains a map but no mission: open the mission file"):
        open_document(str(tmp_path / "m.kml"), MissionOptions(scenario="jacksboro"))


def test_only_json_and_text_with_a_mission_is_listed(tmp_path: Path) -> None:
    """A forecast, a kept session, and notes are not offered."""
    written_plan(tmp_path / "p.json")
    written_mission(tmp_path / "m.txt")
    (tmp_path / "forecast.json").write_text((ROOT / "examples" / "jacksboro-forecast.json").read_text())
    (tmp_path / "kept.json").write_text('{"schema": "planfly.studio/1"}')
    (tmp_path / "notes.txt").write_text("a mission for Tuesday")
    assert folder_message(tmp_path)["files"] == ["m.txt", "p.json"]


def test_no_path_leads_out_of_the_folder(tmp_path: Path) -> None:
    inside = tmp_path / "in"
    (inside / "deeper").mkdir(parents=True)
    for place in (tmp_path, inside, inside / "deeper"):
        written_mission(place / "m.plan")
    (inside / "link.plan").symlink_to(tmp_path / "m.plan")
    (inside / "notes.md").write_text("", encoding="utf-8")
    for name in ("m.plan", "deeper/m.plan", str(inside / "m.plan")):
        assert find_file_in_folder(inside, name).is_relative_to(inside.resolve())
    outside = ("../m.plan", "deeper/../../m.plan", "link.plan", str(tmp_path / "m.plan"), "deeper", "../none.plan")
    for name in (*outside, "a\0.plan", "/etc/passwd", "."):
        with pytest.raises(MissionError, match=r"expected a file in .*"):
            find_file_in_folder(inside, name)
    with pytest.raises(MissionError, match=r"name: 'none.plan': no such file in .*/in$"):
        find_file_in_folder(inside, "none.plan")
    with pytest.raises(MissionError, match=r"suffix: '.md': expected one of"):
        find_file_in_folder(inside, "notes.md")
    with pytest.raises(MissionError, match="drop the file here"):
        find_file_in_folder(None, "m.plan")
    assert folder_message(inside)["files"] == ["m.plan"]
