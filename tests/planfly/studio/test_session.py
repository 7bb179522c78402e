"""A session: what is done to a mission and undone, judged as the API judges it, saved without loss, and kept."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import planfly
from flight.mission import edits
from flight.mission.items import Command, Frame, Mission, MissionItem, renumber_items
from flight.mission_files.formats import mission_text, parse_mission
from logs.verdict.places import Change, Place
from logs.verdict.verdict import verdict_json
from planfly.flight_options import MissionOptions
from planfly.studio import autosave, messages
from planfly.studio.autosave import mission_data, mission_from_data
from planfly.studio.documents import Document, open_document, open_dropped, straight_plan
from planfly.studio.session import Session, StaleEdit, TriedChanges, open_session
from planfly.workflow import suggestion_trials
from planfly.workflow.open_flight import make_setup
from planfly.workflow.suggestion_trials import SuggestionTrials, with_tried_suggestions
from planfly.workflow.uav import load_uav
from tests.mission_lines import setup_of, wp
from tests.own_aircraft import copy_aerosonde, write_mission, write_scenario
from tests.planfly.studio.drafts import drawn_session, session_of, try_planned, world_of
from tests.soak import note, scaled
from world.errors import MissionError, PlanflyError
from world.frames import to_geo

EDITS = scaled(1000, 12)


def draw_edit(session: Session, rng: np.random.Generator) -> None:
    """One edit at random, or an undo or a redo; one that no mission may have is refused and changes nothing."""
    kind = rng.choice(["move", "up", "insert", "delete", "raise", "undo", "redo", "apply"])
    k = int(rng.choice(edits.movable_indices(session.mission)))
    east, north, up = session.item_position(k)
    east, north = (float(np.clip(v + rng.normal(0.0, 200.0), -9000.0, 9000.0)) for v in (east, north))
    rev = session.rev
    match kind:
        case "move":
            session.edit(messages.Move(kind="move", rev=rev, k=k, east=east, north=north))
        case "up":
            session.edit(messages.Move(kind="move", rev=rev, k=k, up=up + float(rng.normal(0.0, 40.0))))
        case "insert":
            session.edit(messages.Insert(kind="insert", rev=rev, after=k, east=east, north=north))
        case "delete":
            session.edit(messages.Delete(kind="delete", rev=rev, ks=[k]))
        case "raise":
            session.edit(messages.Raise(kind="raise", rev=rev, by=float(rng.integers(-20, 30))))
        case "apply":
            try_planned(session)
            ready = list(session.tried["geometric"].changes)
            if ready:
                finding, which = ready[int(rng.integers(len(ready)))]
                session.edit(messages.Apply(kind="apply", rev=rev, finding=finding, which=which))
        case _:
            session.step_history(str(kind))


def test_edits_and_undos_come_to_the_verdict_of_the_api(tmp_path: Path) -> None:
    session = drawn_session(5, 12)
    rng = np.random.default_rng(38)
    refused = compared = 0
    for number in range(EDITS):
        before, rev = session.mission, session.rev
        try:
            draw_edit(session, rng)
        except MissionError:
            refused += 1
            assert session.mission is before
            assert session.rev == rev
            continue
        if EDITS < 100 and number % 4:
            continue
        file = tmp_path / "edited.waypoints"
        file.write_text(mission_text(session.mission, "waypoints"), encoding="utf-8")
        asked = planfly.judge(file, scenario="jacksboro", geometry=True).verdict
        # The API tries the suggestions, too.
        assert verdict_json(with_tried_suggestions(session.judged)) == verdict_json(asked), f"after edit {number}"
        compared += 1
    assert refused < EDITS // 2
    note("studio: edits against the API", edits=EDITS, compared=compared, refused=refused, differing=0)


def test_undo_goes_back_to_the_first_mission_itself() -> None:
    session = drawn_session(5, 12)
    first, verdict = session.mission, session.judged.verdict
    k = edits.movable_indices(first)[2]
    for step in range(3):
        session.edit(messages.Move(kind="move", rev=session.rev, k=k, up=900.0 + step))
    for _ in range(4):
        session.step_history("undo")
    assert session.mission is first
    assert session.judged.verdict == verdict
    assert session.mission_message()["redo"]
    session.step_history("redo")
    assert session.is_changed


def test_an_edit_of_an_older_sheet_is_refused() -> None:
    session = drawn_session(5, 12)
    k, rev = edits.movable_indices(session.mission)[2], session.rev
    session.edit(messages.Move(kind="move", rev=rev, k=k, up=900.0))
    with pytest.raises(StaleEdit):
        session.edit(messages.Delete(kind="delete", rev=rev, ks=[k]))
    with pytest.raises(StaleEdit):
        session.judge_drag(messages.Drag(kind="drag", rev=rev, n=1, k=k, east=0.0, north=0.0))


def test_a_preview_changes_nothing_and_is_what_the_move_comes_to() -> None:
    session = drawn_session(6, 14)
    k, before = edits.movable_indices(session.mission)[5], session.mission
    east, north, _ = session.item_position(k)
    asked = messages.Drag(kind="drag", rev=session.rev, n=1, k=k, east=east + 300.0, north=north, whole=True)
    shown = session.judge_drag(asked)["sheet"]
    assert session.mission is before
    session.edit(messages.Move(kind="move", rev=session.rev, k=k, east=east + 300.0, north=north))
    assert {name: session.mission_message()[name] for name in shown} == shown


# ----------------------------------------------------------------------
# Files.


@pytest.mark.parametrize("name", ["by_hand.waypoints", "mission_planner.waypoints", "qgc_amsl.plan", "mavproxy.txt"])
def test_an_unmoved_mission_saved_is_the_file(name: str) -> None:
    file = Path(__file__).parents[2] / "flight" / "missions" / name
    session, _ = open_session(str(file), MissionOptions(terrain=None))
    assert session.save(session.document.kind).data == file.read_bytes()


def test_a_moved_mission_saved_is_read_as_it_is() -> None:
    session = drawn_session(7, 14)
    k = edits.movable_indices(session.mission)[3]
    session.edit(messages.Move(kind="move", rev=session.rev, k=k, east=100.0, north=200.0))
    session.save("kml")
    assert session.mission_message()["unsaved"] is True
    for form in ("waypoints", "plan"):
        saved = session.save(form)
        assert (session.mission_message()["unsaved"], session.is_changed) == (False, True)
        assert parse_mission(saved.data.decode(), saved.name).items == session.mission.items
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=10.0))
    assert session.mission_message()["unsaved"] is True


def test_the_unsaved_mark_compares_with_what_the_file_holds(tmp_path: Path) -> None:
    """Saved 10 m higher, the opened mission is the unsaved one, and a revert returns to the file."""
    file = tmp_path / "m.waypoints"
    file.write_text(mission_text(drawn_session(8, 6).mission, "waypoints"), encoding="utf-8")
    session, _ = open_session(str(file), MissionOptions(scenario="jacksboro"))
    opened = session.mission
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=10.0))
    session.overwrite_file()
    saved = session.mission
    assert not session.is_unsaved
    session.step_history("undo")
    assert (session.mission, session.mission_message()["unsaved"]) == (opened, True)
    # The same content is saved, however it was made.
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=4.0))
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=6.0))
    assert (session.mission == saved, session.is_unsaved) == (True, False)
    session.step_history("undo")
    session.step_history("revert")
    assert (session.mission, session.is_unsaved) == (saved, False)


def test_what_a_form_does_not_hold_is_said() -> None:
    session = drawn_session(7, 14)
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=10.0))
    assert any("threats" in line for line in session.save("waypoints").losses)
    assert "only a map" in session.save("kml").losses[0]
    with pytest.raises(MissionError, match="plain waypoints"):
        session.save("plan.json")


def test_what_one_threat_and_a_map_lack_is_said_in_the_singular(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_scenario('[[threats]]\nname = "col"\neast_m = 3000\nnorth_m = 3000\nkill_radius_m = 100\nkill_scale_m = 50\n')
    write_mission(1000.0, 1000.0, 1000.0)
    session, _ = open_session("m.waypoints", MissionOptions(scenario="s.toml"))
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=10.0))
    losses = session.save("waypoints").losses
    assert losses == ("the scenario's 1 threat: planfly export writes them as a fence",)
    assert session.save("kml").losses == (
        "the commands, speeds and frames of the items, because the file is only a map",
    )


def test_a_download_leaves_the_file_unsaved(tmp_path: Path) -> None:
    file = tmp_path / "m.waypoints"
    file.write_text(mission_text(drawn_session(8, 10).mission, "waypoints"), encoding="utf-8")
    session, _ = open_session(str(file), MissionOptions(scenario="jacksboro"))
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=10.0))
    session.save("waypoints")
    session.save("plan")
    assert session.is_unsaved
    session.overwrite_file()
    assert not session.is_unsaved
    # Without a file of its own, a mission is saved by its download.
    other = drawn_session(8, 10)
    other.edit(messages.Raise(kind="raise", rev=other.rev, by=10.0))
    other.change_settings(messages.Settings(kind="settings", parameter="WP_RADIUS=55"))
    other.save("parm")
    assert other.is_unsaved
    other.save("plan")
    assert not other.is_unsaved


def test_a_plan_file_has_the_speed_at_which_the_mission_starts() -> None:
    """It is set to 19 m/s in the studio, and 17 m/s is commanded later."""
    mission = drawn_session(8, 10).mission
    after = edits.movable_indices(mission)[3]
    speed = MissionItem(0, Command.DO_CHANGE_SPEED, Frame.MISSION, (0.0, 17.0, -1.0, 0.0), 0.0, 0.0, 0.0)
    items = (*mission.items[: after + 1], speed, *mission.items[after + 1 :])
    session = session_of(renumber_items(replace(mission, items=items)))
    session.change_settings(messages.Settings(kind="settings", airspeed=19.0))
    assert json.loads(session.save("plan").data)["mission"]["cruiseSpeed"] == 19
    # A file that is not of the studio does not take the later speed for the first, either.
    assert json.loads(mission_text(session.mission, "plan"))["mission"]["cruiseSpeed"] != 17


def test_only_the_named_file_is_written_over(tmp_path: Path) -> None:
    file = tmp_path / "m.waypoints"
    file.write_text(mission_text(drawn_session(8, 10).mission, "waypoints"), encoding="utf-8")
    session, _ = open_session(str(file), MissionOptions(scenario="jacksboro"))
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=10.0))
    session.overwrite_file()
    assert parse_mission(file.read_text(encoding="utf-8"), "m").items == session.mission.items
    session.open(open_dropped("other.waypoints", file.read_bytes(), session.options))
    with pytest.raises(PlanflyError, match="started without a mission file"):
        session.overwrite_file()


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("x.exe", b"", "suffix"),
        ("../../etc/passwd", b"", "suffix"),
        ("m.waypoints", b"not a mission", "m.waypoints"),
        ("p.json", b'{"scenario": {"terrain": {"path": "/etc/passwd"}}}', "names other files"),
        ("p.json", b'{"scenario": {"flight": {"params": "/etc/passwd"}}}', "names other files"),
        ("p.json", b'{"scenario": {"flight": {"aircraft": "../x"}}}', "names other files"),
        ("p.json", b'{"scenario": {"zones_file": ["/etc/passwd"]}}', "names other files"),
        ("p.json", b"[" * 100_000, "p.json"),
    ],
)
def test_a_dropped_file_is_refused_in_a_line(name: str, data: bytes, words: str) -> None:
    with pytest.raises(PlanflyError, match=words) as refused:
        open_dropped(name, data, MissionOptions())
    assert "planfly-studio-" not in str(refused.value)
    assert "\n" not in str(refused.value)


# ----------------------------------------------------------------------
# Kept, and settings.


def test_what_was_done_is_there_after_the_server_died(tmp_path: Path) -> None:
    file, kept = tmp_path / "m.waypoints", tmp_path / "kept" / "m.json"
    file.write_text(mission_text(drawn_session(8, 10).mission, "waypoints"), encoding="utf-8")
    session, restored = open_session(str(file), MissionOptions(scenario="jacksboro"), kept)
    assert not restored
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=10.0))
    session.autosave(kept)
    again, restored = open_session(str(file), MissionOptions(scenario="jacksboro"), kept)
    assert restored
    assert again.mission.items == session.mission.items
    again.step_history("undo")
    assert again.mission is again.history.first
    file.write_text(mission_text(drawn_session(9, 10).mission, "waypoints"), encoding="utf-8")
    other, restored = open_session(str(file), MissionOptions(scenario="jacksboro"), kept)
    assert not restored
    kept.write_text("{", encoding="utf-8")
    assert not open_session(str(file), MissionOptions(scenario="jacksboro"), kept)[1]
    assert not other.is_changed


def test_edits_of_a_file_that_has_changed_since_are_set_aside_and_this_is_said(tmp_path: Path) -> None:
    file, kept, world = tmp_path / "m.waypoints", tmp_path / "m.json", MissionOptions(scenario="jacksboro")
    file.write_text(mission_text(drawn_session(8, 6).mission, "waypoints"), encoding="utf-8")
    session, _ = open_session(str(file), world, kept)
    session.change_settings(messages.Settings(kind="settings", wind_speed=9.0, parameter="WP_RADIUS=55"))
    for by in (10.0, 20.0):
        session.edit(messages.Raise(kind="raise", rev=session.rev, by=by))
    session.autosave(kept)
    edited = kept.read_bytes()
    opened = file.read_bytes()
    file.write_text(mission_text(drawn_session(9, 6).mission, "waypoints"), encoding="utf-8")
    again, restored = open_session(str(file), world, kept)
    assert (restored, again.is_edited, kept.exists()) == (False, False, False)
    (aside,) = tmp_path.glob("m-earlier-*.json")
    assert aside.read_bytes() == edited
    said = f"the mission file has changed since its last edit in the studio; 2 earlier edits were set aside in {aside}"
    assert again.unused_text == said
    assert said in again.mission_message()["notes"]
    # The settings do not depend on the file's content.
    assert again.settings_json() == session.settings_json()
    assert again.needs_autosave
    again.autosave(kept)
    third, _ = open_session(str(file), world, kept)
    assert (third.unused_text, third.settings_json()) == ("", session.settings_json())
    # The file as it was, with the session as it was.
    file.write_bytes(opened)
    aside.replace(kept)
    assert open_session(str(file), world, kept)[0].mission.items == session.mission.items


def test_a_file_opened_from_the_page_keeps_the_settings_and_its_kept_session(tmp_path: Path) -> None:
    file, other, kept = tmp_path / "m.waypoints", tmp_path / "other.waypoints", tmp_path / "m.json"
    for path, seed in ((file, 8), (other, 9)):
        path.write_text(mission_text(drawn_session(seed, 6).mission, "waypoints"), encoding="utf-8")
    (tmp_path / "my.parm").write_text("WP_RADIUS 60\n", encoding="utf-8")
    named = MissionOptions(terrain="jacksboro", wind=(3.0, 90.0), params=tmp_path / "my.parm")
    session, _ = open_session(str(file), named, kept)
    session.change_settings(
        messages.Settings(kind="settings", aircraft="x8", airspeed=17.0, wind_speed=6.0, parameter="NAVL1_PERIOD=21")
    )
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=10.0))
    edited, settings = session.mission, session.settings_json()
    for path in (other, file):
        session.autosave(kept)
        session.open(open_document(str(path), session.options), kept)
        assert session.settings_json() == settings
        assert session.context.uav.autopilot.stated_value("WP_RADIUS") == 60.0
    # The file has its edits, and one kept session whichever way it was opened.
    assert session.mission.items == edited.items
    session.change_settings(messages.Settings(kind="settings", wind_speed=7.0))
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=20.0))
    session.autosave(kept)
    again, _ = open_session(str(file), MissionOptions(terrain="jacksboro"), kept)
    assert again.mission.items == session.mission.items
    assert again.settings_json() == session.settings_json()
    # The settings of the session, not those that were kept with the other file.
    again.open(open_document(str(other), again.options), kept)
    assert again.settings_json() == session.settings_json()


def test_an_opened_plan_of_another_autopilot_is_flown_by_it(tmp_path: Path) -> None:
    file, plan, mission = tmp_path / "m.waypoints", tmp_path / "m.plan", drawn_session(8, 6).mission
    file.write_text(mission_text(mission, "waypoints"), encoding="utf-8")
    plan.write_text(mission_text(replace(mission, autopilot="px4"), "plan"), encoding="utf-8")
    session, _ = open_session(str(file), MissionOptions(terrain="jacksboro"))
    session.change_settings(messages.Settings(kind="settings", wind_speed=6.0))
    session.open(open_document(str(plan), session.options))
    assert (session.settings_json()["autopilot"], session.settings_json()["wind_speed"]) == ("px4", 6.0)
    assert "autosaved settings not used: autopilot ardupilot \u2192 px4" in "\n".join(
        session.mission_message()["notes"]
    )


def test_a_revert_reads_the_file_that_another_program_has_changed(tmp_path: Path) -> None:
    file, world = tmp_path / "m.waypoints", MissionOptions(scenario="jacksboro")
    file.write_text(mission_text(drawn_session(8, 6).mission, "waypoints"), encoding="utf-8")
    session, _ = open_session(str(file), world)
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=10.0))
    text = mission_text(drawn_session(9, 6).mission, "waypoints")
    file.write_text(text, encoding="utf-8")
    session.step_history("revert")
    assert session.mission.items == parse_mission(text, "m.waypoints").items
    assert (session.is_unsaved, session.undo_text) == (False, "revert to the file")
    session.step_history("undo")
    session.overwrite_file()
    assert parse_mission(file.read_text(encoding="utf-8"), "m.waypoints").items == session.mission.items
    # Without a file nothing is changed, and this is said.
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=5.0))
    file.unlink()
    mission = session.mission
    with pytest.raises(PlanflyError, match=r"m\.waypoints"):
        session.step_history("revert")
    assert session.mission is mission


def test_settings_and_a_planned_path_are_there_after_the_server_died(tmp_path: Path) -> None:
    file, kept, world = tmp_path / "m.waypoints", tmp_path / "m.json", MissionOptions(scenario="jacksboro-air")
    file.write_text(mission_text(drawn_session(8, 10).mission, "waypoints"), encoding="utf-8")
    session, _ = open_session(str(file), world, kept)
    assert not session.needs_autosave
    session.change_settings(messages.Settings(kind="settings", wind_speed=9.0, limits={"min_clearance_m": 33.0}))
    session.change_settings(messages.Settings(kind="settings", parameter="WP_RADIUS=55"))
    session.autosave(kept)
    again, restored = open_session(str(file), world, kept)
    assert restored
    assert again.mission is again.history.first
    assert not again.undo_text
    assert again.settings_json() == session.settings_json()
    assert verdict_json(again.judged.verdict) == verdict_json(session.judged.verdict)
    # A path that was planned there, with its certificate; and then without, when it was edited.
    again.plans = ([straight_plan(again.context.scenario, 3)], None)
    again.replace_plan(messages.Choose(kind="choose", rev=again.rev, which=0))
    again.autosave(kept)
    third, _ = open_session(str(file), world, kept)
    assert third.mission_message()["planned"]
    assert third.save("plan.json").data == again.save("plan.json").data
    third.edit(messages.Raise(kind="raise", rev=third.rev, by=5.0))
    third.autosave(kept)
    fourth, _ = open_session(str(file), world, kept)
    assert (fourth.mission_message()["planned"], fourth.context.planned) == (False, True)
    assert fourth.settings_json() == session.settings_json()
    assert fourth.mission.items == third.mission.items


def test_parameters_are_there_after_the_mission_was_saved_over_its_file(tmp_path: Path) -> None:
    file, kept, world = tmp_path / "m.waypoints", tmp_path / "m.json", MissionOptions(scenario="jacksboro-air")
    file.write_text(mission_text(drawn_session(8, 10).mission, "waypoints"), encoding="utf-8")
    session, _ = open_session(str(file), world, kept)
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=10.0 / 3.0))
    session.change_settings(messages.Settings(kind="settings", parameter="RTL_ALTITUDE=700"))
    session.autosave(kept)
    session.overwrite_file()
    session.autosave(kept)
    again, restored = open_session(str(file), world, kept)
    assert restored
    assert again.settings_json() == session.settings_json()
    assert "RTL_ALTITUDE" in json.dumps(again.settings_json())
    # Its mission is that of the file, so there is nothing to save or undo.
    assert (again.is_unsaved, again.undo_text) == (False, "")
    # An edit after that is restored as one, once; a file that another program wrote is another mission.
    again.edit(messages.Raise(kind="raise", rev=again.rev, by=5.0))
    again.autosave(kept)
    third, _ = open_session(str(file), world, kept)
    assert third.mission.items == again.mission.items
    assert third.undo_text
    file.write_text(mission_text(drawn_session(9, 10).mission, "waypoints"), encoding="utf-8")
    assert not open_session(str(file), world, kept)[1]


def test_what_cannot_be_set_any_more_leaves_the_edits(tmp_path: Path) -> None:
    session = drawn_session(8, 10)
    session.change_settings(messages.Settings(kind="settings", wind_speed=9.0))
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=10.0))
    kept = tmp_path / "m.json"
    session.autosave(kept)
    data = json.loads(kept.read_text(encoding="utf-8"))
    data["settings"]["flight"]["aircraft"] = "gone"
    kept.write_text(json.dumps(data), encoding="utf-8")
    again = drawn_session(8, 10)
    assert again.restore(kept)
    assert again.mission.items == session.mission.items
    assert again.context.scenario.wind.speed != 9.0


def test_an_option_of_the_command_replaces_a_kept_setting_and_this_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, kept = tmp_path / "m.waypoints", tmp_path / "m.json"
    file.write_text(mission_text(drawn_session(8, 10).mission, "waypoints"), encoding="utf-8")
    world = MissionOptions(scenario="jacksboro-air")
    session, _ = open_session(str(file), world, kept)
    asked = {"wind_speed": 9.0, "wind_from": 90.0, "turbulence": "light", "airspeed": 26.0, "parameter": "WP_RADIUS=55"}
    session.change_settings(messages.Settings.model_validate({"kind": "settings", **asked}))
    session.autosave(kept)
    windy, restored = open_session(str(file), world | MissionOptions(wind=(3.0, 90.0), turbulence="none"), kept)
    shown = windy.settings_json()
    assert restored
    assert (shown["wind_speed"], shown["wind_from"], shown["turbulence"]) == (3.0, 90.0, "none")
    # What no option sets is kept.
    assert (shown["airspeed"], shown["parameters"]) == (26.0, {"WP_RADIUS": 55.0})
    said = "autosaved settings replaced by options of the command: wind 9 \u2192 3; turbulence light \u2192 none"
    assert said in windy.mission_message()["notes"]
    # Another aircraft has another airspeed, another file of parameters replaces those that were set.
    (tmp_path / "mine.parm").write_text("WP_RADIUS 70\n", encoding="utf-8")
    copy_aerosonde(tmp_path)
    named = MissionOptions(aircraft=tmp_path / "own", params=tmp_path / "mine.parm")
    other, _ = open_session(str(file), world | named, kept)
    assert other.settings_json()["aircraft"] == "own"
    assert other.settings_json()["parameters"] == {}
    assert other.context.uav.autopilot.stated_value("WP_RADIUS") == 70.0
    for part in ("aircraft aerosonde \u2192 own", "airspeed 26 \u2192 25", "parameter WP_RADIUS 55"):
        assert part in other.replaced_text
    assert other.settings_json()["wind_speed"] == 9.0
    # The same folder by another path is the same aircraft, whose airspeed is kept.
    other.change_settings(messages.Settings.model_validate({"kind": "settings", "airspeed": 24.0}))
    other.autosave(kept)
    monkeypatch.chdir(tmp_path)
    again, _ = open_session(
        str(file), world | MissionOptions(aircraft=Path("own"), params=tmp_path / "mine.parm"), kept
    )
    assert again.settings_json()["airspeed"] == 24.0
    assert again.replaced_text == ""
    # The settings of one scenario are not those of another.
    third, restored = open_session(str(file), MissionOptions(scenario="jacksboro"), kept)
    assert not restored
    assert third.replaced_text == "autosaved settings not used: all of them, which belong to jacksboro-air"
    assert not open_session(str(file), world, kept)[0].replaced_text


@pytest.mark.parametrize("wind", [3.0, 5.0])
def test_what_a_command_replaced_stays_replaced_without_an_edit(wind: float, tmp_path: Path) -> None:
    """Also by the value of the scenario itself, whose wind is 5 m/s from 250 degrees."""
    file, kept = tmp_path / "m.waypoints", tmp_path / "m.json"
    file.write_text(mission_text(drawn_session(8, 10).mission, "waypoints"), encoding="utf-8")
    world = MissionOptions(scenario="jacksboro-air")
    session, _ = open_session(str(file), world, kept)
    session.change_settings(messages.Settings(kind="settings", wind_speed=9.0, wind_from=250.0))
    session.autosave(kept)
    windy, _ = open_session(str(file), world | MissionOptions(wind=(wind, 250.0)), kept)
    assert windy.needs_autosave
    windy.autosave(kept)
    again, _ = open_session(str(file), world, kept)
    assert again.settings_json()["wind_speed"] == wind
    assert again.replaced_text == ""


def test_undone_edits_can_be_redone_after_the_server_died(tmp_path: Path) -> None:
    file, kept = tmp_path / "m.waypoints", tmp_path / "m.json"
    file.write_text(mission_text(drawn_session(8, 10).mission, "waypoints"), encoding="utf-8")
    world = MissionOptions(scenario="jacksboro")
    session, _ = open_session(str(file), world, kept)
    for by in (10.0, 20.0, 30.0):
        session.edit(messages.Raise(kind="raise", rev=session.rev, by=by))
    results = [step.mission.items for step in session.history.steps]
    session.step_history("undo")
    session.step_history("undo")
    session.autosave(kept)
    again, _ = open_session(str(file), world, kept)
    assert again.mission.items == results[0]
    assert again.redo_text == "raise all items by 20 m"
    again.step_history("redo")
    again.step_history("redo")
    assert again.mission.items == results[2]
    assert again.redo_text == ""
    for _ in range(3):
        again.step_history("undo")
    assert again.mission is again.history.first
    # Undone to the file itself.
    again.autosave(kept)
    unedited, _ = open_session(str(file), world, kept)
    assert not unedited.is_changed
    assert unedited.needs_autosave
    unedited.step_history("redo")
    assert unedited.mission.items == results[0]


def test_each_edit_can_be_undone_after_the_server_died(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, kept, world = tmp_path / "m.waypoints", tmp_path / "m.json", MissionOptions(scenario="jacksboro")
    file.write_text(mission_text(drawn_session(8, 10).mission, "waypoints"), encoding="utf-8")
    session, _ = open_session(str(file), world, kept)

    def raise_all(session: Session, *heights: float) -> list[Mission]:
        for by in heights:
            session.edit(messages.Raise(kind="raise", rev=session.rev, by=by))
        return [step.mission for step in session.history.steps]

    def undone(session: Session) -> list[str]:
        """Undo all, and return what was undone."""
        texts = []
        while text := session.undo_text:
            texts.append(text)
            session.step_history("undo")
        assert session.mission is session.history.first
        return texts

    first, second, _ = raise_all(session, 10.0, 20.0, 30.0)
    session.autosave(kept)
    again, _ = open_session(str(file), world, kept)
    again.step_history("undo")
    assert again.mission.items == second.items
    again.step_history("undo")
    assert again.mission.items == first.items
    assert undone(again) == ["raise all items by 10 m"]
    # What was saved over the file is where undo ends; what came after it can be undone.
    session.overwrite_file()
    raise_all(session, 1.0, 2.0)
    session.autosave(kept)
    again, _ = open_session(str(file), world, kept)
    assert undone(again) == ["raise all items by 2 m", "raise all items by 1 m"]
    # Of edits with more items than are kept, the newest are there; the last one always is.
    for most, count in ((2 * len(first.items), 2), (0, 1)):
        monkeypatch.setattr(autosave, "_MAX_SAVED_ITEMS", most)
        again, _ = open_session(str(file), world, kept)
        raise_all(again, 3.0)
        again.autosave(tmp_path / "other.json")
        fewer, _ = open_session(str(file), world, tmp_path / "other.json")
        assert fewer.mission.items == again.mission.items
        assert undone(fewer) == ["raise all items by 3 m", "raise all items by 2 m"][:count]


def test_speeds_and_jumps_are_shown_and_stay_through_edits() -> None:
    lines = (wp(0, 0), "0 178 0 21 -1 0 0 0 0", wp(0, 1500), wp(1500, 1500), "0 177 3 2 0 0 0 0 0", wp(1500, 0))
    document = Document("m.waypoints", "m", setup_of(*lines, home="36.5 -84.2 100"), "waypoints")
    session = Session.from_document(document, MissionOptions())

    def shown() -> list[tuple[int, str]]:
        return [(one["seq"], one["text"]) for one in session.mission_message()["commands"]]

    assert shown() == [(2, "change speed: airspeed 21 m/s"), (5, "jump to item 3, 2 times")]
    session.edit(messages.Move(kind="move", rev=session.rev, k=2, east=100.0, north=1600.0))
    assert shown() == [(2, "change speed: airspeed 21 m/s"), (5, "jump to item 3, 2 times")]
    # An item inserted before the target renumbers both.
    session.edit(messages.Insert(kind="insert", rev=session.rev, after=0, east=0.0, north=700.0))
    assert [text for _, text in shown()] == ["change speed: airspeed 21 m/s", "jump to item 4, 2 times"]


# Changes of a kept session: whole texts, and values of keys.
SHAPES: dict[str, Any] = {
    "nothing": "",
    "a list": "[]",
    "a number": "1e999",
    "no text": b"\xff\xfe",
    "nested lists": "[" * 100_000,
    "a mission that is a number": {"mission": 3},
    "items that are numbers": {"mission": {"home": None, "items": [3]}},
    "a latitude beyond the pole": {"mission": {"home": None, "items": [[0, 16, 3, 0, 0, 0, 0, 1e300, 8.0, 90.0, 1]]}},
    "an infinite number": {"mission": {"home": None, "items": [[float("inf")] * 11]}},
    "a home that is a word": {"mission": {"home": "here", "items": []}},
}


@pytest.mark.parametrize("shape", SHAPES)
def test_an_altered_kept_session_is_left_alone(shape: str, tmp_path: Path) -> None:
    kept, session = tmp_path / "m.json", drawn_session(8, 10)
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=10.0))
    session.autosave(kept)
    changed = SHAPES[shape]
    if isinstance(changed, dict):
        changed = json.dumps(json.loads(kept.read_text(encoding="utf-8")) | changed)
    kept.write_bytes(changed if isinstance(changed, bytes) else changed.encode())
    altered = kept.read_bytes()
    again = drawn_session(8, 10)
    before = again.mission, again.judged, again.rev
    assert not again.restore(kept)
    assert again.unreadable == [kept]
    assert (again.mission, again.judged) == before[:2]
    again.edit(messages.Raise(kind="raise", rev=again.rev, by=10.0))
    again.autosave(kept)
    assert kept.read_bytes() == altered


def test_a_mission_comes_back_from_its_data() -> None:
    mission = drawn_session(9, 20).mission
    assert mission_from_data(mission_data(mission), mission) == mission


@pytest.mark.parametrize(
    ("rule", "by", "seed", "items"), [("clearance", -90.0, 5, 12), ("threat", 120.0, 7, 12), ("threat", 120.0, 1, 20)]
)
def test_a_suggestion_applied_mends_its_finding(rule: str, by: float, seed: int, items: int) -> None:
    """At once, though a path that goes round a corner moves by less than its waypoint."""
    session = drawn_session(seed, items)
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=by))
    findings = session.judged.verdict.findings
    try_planned(session)
    number, item = next((n, findings[n]) for n, _ in session.tried["geometric"].changes if findings[n].rule == rule)
    session.edit(messages.Apply(kind="apply", rev=session.rev, finding=number, which=0))
    after = [one for one in session.judged.verdict.findings if (one.rule, one.place) == (item.rule, item.place)]
    assert not [one for one in after if one.ok is False]


def test_a_suggestion_that_fails_its_trial_is_not_offered(monkeypatch: pytest.MonkeyPatch) -> None:
    """The path would remain inside the missile's range."""
    monkeypatch.setattr(suggestion_trials, "MAX_TRIED_FINDINGS", 3)
    session = drawn_session(4, 12)
    findings = session.judged.verdict.findings
    number = next(n for n, one in enumerate(findings) if one.rule == "threat" and one.suggestions)

    def offered() -> list[int]:
        return [one["number"] for one in session.mission_message()["findings"] if one["ok"] is False and one["offers"]]

    assert offered() == []
    assert SuggestionTrials(session.context, session.judged).try_suggestion(findings[number], 0) is None
    try_planned(session)
    assert number not in offered()
    with pytest.raises(MissionError, match="no longer exists"):
        session.edit(messages.Apply(kind="apply", rev=session.rev, finding=number, which=0))
    # Each that is offered is applied, and as few fail or fewer.
    failed = len(session.judged.verdict.failed)
    tried = session.tried["geometric"]
    assert {number for number, _ in tried.changes} <= set(offered())
    for number, which in tried.changes:
        session.edit(messages.Apply(kind="apply", rev=session.rev, finding=number, which=which))
        assert len(session.judged.verdict.failed) < failed
        session.step_history("undo")
        session.tried["geometric"] = tried._replace(rev=session.rev)


def test_a_suggested_speed_is_named_by_its_undo() -> None:
    session = drawn_session(5, 12)
    slower = (Change("airspeed", Place("leg", 2, to_item=4), 25.0, 20.5, "m/s", not_flown=True),)
    changes = {(0, 0): (replace(session.mission, source="slower"), slower)}
    session.tried["geometric"] = TriedChanges(session.rev, [], changes)
    session.edit(messages.Apply(kind="apply", rev=session.rev, finding=0, which=0))
    assert session.undo_text.endswith(": fly leg 2 (to item 4) at 20.5 m/s instead of 25 m/s")


def test_a_suggested_parameter_is_set_and_undone(tmp_path: Path) -> None:
    """A return from 150 m over a top of 100 m, down to RTL_ALTITUDE 100: half way it is 5 m lower than required."""
    setup = setup_of(
        wp(0, 0, 150.0),
        wp(0, 4000, 150.0),
        "3 20 0 0 0 0 0 0 0",
        home="36.5 -84.2 0",
        terrain={"kind": "peaks", "peak": [{"east_m": 0.0, "north_m": 2000.0, "height_m": 100.0, "sigma_m": 600.0}]},
        limits={"min_clearance_m": 30.0},
        flight={"autopilot": "ardupilot"},
    )
    setup = make_setup(setup.scenario, load_uav(setup.scenario), setup.mission, 1)
    session = Session.from_document(Document("low.waypoints", "low", setup, "waypoints"), MissionOptions())
    try_planned(session)
    findings = session.mission_message()["findings"]
    (finding,) = [one for one in findings if any("RTL_ALTITUDE" in way["text"] for way in one["offers"])]
    (which,) = [k for k, way in enumerate(finding["offers"]) if "RTL_ALTITUDE" in way["text"]]
    assert finding["offers"][which]["apply"]
    world, items = session.world_rev, session.mission.items
    session.edit(messages.Apply(kind="apply", rev=session.rev, finding=finding["number"], which=which))
    (wanted,) = session.settings_json()["parameters"].values()
    assert wanted in (112.0, 113.0)
    assert session.undo_text == f"apply a suggestion of clearance: set RTL_ALTITUDE to {wanted:g} m instead of 100 m"
    # The pages are sent the settings, and the flight is made with them.
    assert session.world_rev == world + 1
    assert session.judged.setup.autopilot.model.returns.rules.height == wanted
    assert session.judged.verdict.flyable is not False
    assert session.mission.items == items
    # Another parameter that is set by hand stays, and the undo is kept for the next session.
    session.change_settings(messages.Settings(kind="settings", parameter="WP_RADIUS=40"))
    session.autosave(tmp_path / "low.json")
    again = Session.from_document(session.document, MissionOptions())
    assert again.restore(tmp_path / "low.json")
    for one in (session, again):
        one.step_history("undo")
        assert one.settings_json()["parameters"] == {"WP_RADIUS": 40.0}
        assert not one.judged.verdict.flyable
        one.step_history("redo")
        assert one.settings_json()["parameters"] == {"WP_RADIUS": 40.0, "RTL_ALTITUDE": wanted}
    # Another autopilot does not have it: the mission's part of the edit is undone all the same.
    session.change_settings(messages.Settings(kind="settings", autopilot="px4"))
    session.step_history("undo")
    assert (session.undo_text, session.settings_json()["parameters"]) == ("", {})


def test_a_sphere_is_passed_with_what_navigation_may_be_off_to_spare() -> None:
    """Three standard deviations of 1.5 m, where the way passed 100 m inside the sphere, along a chord."""
    scenario, _ = world_of("jacksboro")
    threats = scenario.threats
    m = int(np.flatnonzero(threats.kill_radius > 0.0)[0])
    centre, radius = threats.position[m], float(threats.kill_radius[m])
    near = centre[:2] + (radius - 100.0) * np.array([1.0, 0.0])
    places = [(near[0], near[1] + along, centre[2] + 5.0) for along in (-3000.0, 0.0, 3000.0)]
    items = []
    for seq, (east, north, up) in enumerate(places, 1):
        lat, lon = (float(one) for one in to_geo(scenario.origin, east, north))
        items.append(
            MissionItem(seq, 16, int(Frame.GLOBAL), (0.0,) * 4, round(lat, 7), round(lon, 7), round(float(up), 3))
        )
    session = session_of(Mission(drawn_session(5, 12).mission.home, tuple(items), source="chord"))
    findings = session.judged.verdict.findings
    number = next(n for n, one in enumerate(findings) if (one.place.kind, one.place.index) == ("missile", m))
    try_planned(session)
    session.edit(messages.Apply(kind="apply", rev=session.rev, finding=number, which=0))
    points = np.asarray(session.judged.requirements.path.points)
    assert np.linalg.norm(points - centre, axis=1).min() - radius > 4.5


def test_a_scenario_opens_with_its_straight_line() -> None:
    document = open_document("jacksboro", MissionOptions())
    assert document.to_plan
    session = Session.from_document(document, MissionOptions())
    assert len(edits.movable_indices(session.mission)) == 2
    assert session.mission_message()["verdict"]["state"] == "fail"


def test_a_mission_without_a_scenario_takes_its_world_along() -> None:
    mission = drawn_session(8, 6).mission
    document = open_dropped(
        "m.waypoints", mission_text(mission, "waypoints").encode(), MissionOptions(terrain="jacksboro")
    )
    session = Session.from_document(document, MissionOptions(terrain="jacksboro"))
    k = edits.movable_indices(session.mission)[-1]
    east, north, _ = session.item_position(k)
    world = session.world_rev
    session.edit(messages.Move(kind="move", rev=session.rev, k=k, east=east + 2500.0, north=north))
    assert session.world_rev == world + 1
    assert session.context.scenario.bounds[0, 1] >= session.item_position(k)[0]


def test_the_world_names_what_findings_number() -> None:
    session = session_of(drawn_session(6, 14).mission)
    world = session.world_message()
    assert [one["name"] for one in world["threats"]] == list(session.context.scenario.threats.names)
