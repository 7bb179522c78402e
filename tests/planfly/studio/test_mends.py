"""What an edit must not touch: landings, zones, certificates, files, and what another change has made of the sheet."""

import asyncio
import json
import pickle
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import planfly
from flight.mission import edits
from flight.mission.items import Command, Frame, Mission, MissionItem
from flight.mission_files.formats import mission_text
from logs.recording.example_log import write_example_log
from planfly.flight_options import MissionOptions
from planfly.studio import documents, messages
from planfly.studio.documents import open_document, open_dropped, straight_plan
from planfly.studio.jobs import LONG_WORKER, Jobs
from planfly.studio.server import NO_TOKEN, Page, Server
from planfly.studio.session import Session, StaleEdit, open_session
from planfly.studio.view_model import mission_json
from planfly.studio.worker_process import Answer, Task
from planner.plan import read_plan
from tests.planfly.made_plans import default_run
from tests.planfly.studio.drafts import drawn_session, session_of, world_of
from world.errors import MissionError, PlanflyError
from world.frames import to_geo


def flight_to_the_ground() -> Mission:
    """A take-off, four waypoints, the second with a photo and a servo behind it, and a landing; all above sea level."""
    scenario, _ = world_of("jacksboro")
    assert scenario.terrain is not None
    ground = float(scenario.terrain.height(0.0, 0.0))
    kinds = (22, 16, 16, 206, 183, 16, 16, 189, 21)
    items = []
    for seq, kind in enumerate(kinds, 1):
        east, north = 700.0 * seq - 3000.0, 300.0 * seq - 1000.0
        lat, lon = (float(one) for one in to_geo(scenario.origin, east, north))
        placed = kind in (16, 21, 22)
        up = float(scenario.terrain.height(east, north)) + 2.0 if kind == 21 else ground + 400.0
        frame = Frame.GLOBAL if placed else Frame.MISSION
        place = (round(lat, 7), round(lon, 7), round(up, 3)) if placed else (0.0, 0.0, 0.0)
        items.append(MissionItem(seq, kind, int(frame), (0.0,) * 4, *place))
    return Mission(drawn_session(5, 12).mission.home, tuple(items), source="ground.waypoints")


# ----------------------------------------------------------------------
# Items.


def test_all_are_raised_but_the_landing_and_its_height_is_its_touchdowns() -> None:
    session = session_of(flight_to_the_ground())
    landing = session.mission.items[-1]
    assert session.item_position(8)[2] == landing.alt
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=25.0))
    assert session.mission.items[-1] == landing
    assert session.mission.items[1].alt == flight_to_the_ground().items[1].alt + 25.0
    session.edit(messages.Move(kind="move", rev=session.rev, k=8, up=landing.alt + 1.0))
    assert session.mission.items[-1].alt == pytest.approx(landing.alt + 1.0)
    # The page draws the touchdown, not the end of the route, which is at the altitude of the waypoint before it.
    shown = mission_json(session.context, session.judged)
    assert [item["k"] for item in shown["items"] if item["touchdown"]] == [8]
    assert shown["items"][-1]["at"][2] == pytest.approx(landing.alt + 1.0, abs=0.05)
    assert shown["route"][-1][2] == pytest.approx(session.item_position(6)[2], abs=0.05)


def test_a_waypoint_before_a_landing_is_not_halfway_to_the_ground() -> None:
    session = session_of(flight_to_the_ground())
    session.edit(messages.Insert(kind="insert", rev=session.rev, after=6, east=2500.0, north=1200.0))
    assert [one.command for one in session.mission.items[6:]] == [16, 16, 189, 21]
    assert session.mission.items[7].alt == session.mission.items[6].alt


def test_a_waypoint_stands_behind_what_is_done_at_the_one_before() -> None:
    session = session_of(flight_to_the_ground())
    session.edit(messages.Insert(kind="insert", rev=session.rev, after=2, east=500.0, north=300.0))
    assert [one.command for one in session.mission.items] == [22, 16, 16, 206, 183, 16, 16, 16, 189, 21]
    assert [one.seq for one in session.mission.items] == list(range(1, 11))


def test_an_item_that_no_flight_comes_to_has_a_height_and_says_so() -> None:
    mission = flight_to_the_ground()
    jump = MissionItem(4, int(Command.DO_JUMP), int(Frame.MISSION), (6.0, -1.0, 0.0, 0.0), 0.0, 0.0, 0.0)
    passed = replace(mission.items[1], seq=5, lat_deg=mission.items[1].lat_deg + 0.001)
    end = replace(mission.items[2], seq=6, lat_deg=mission.items[2].lat_deg + 0.01)
    session = session_of(replace(mission, items=(*mission.items[:3], jump, passed, end)))
    found = {one["seq"]: one for one in session.mission_message()["items"]}
    assert (found[5]["state"], found[6]["state"]) == ("not flown", "")
    assert found[5]["at"][2] == pytest.approx(passed.alt, abs=0.06)


def test_a_failed_undo_leaves_what_is_shown() -> None:
    session = drawn_session(5, 12)
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=10.0))
    shown, rev = session.mission, session.rev
    session.history.first = replace(shown, items=shown.items[:1])
    with pytest.raises(PlanflyError):
        session.step_history("undo")
    assert session.mission is shown
    assert session.rev == rev


# ----------------------------------------------------------------------
# Plans.


def planned_session() -> Session:
    document = open_document("jacksboro", MissionOptions())
    return Session.from_document(document, MissionOptions())


def test_what_a_plan_of_waypoints_would_drop_is_refused() -> None:
    session = session_of(flight_to_the_ground())
    with pytest.raises(MissionError, match="take-off"):
        session.save("plan.json")
    items = flight_to_the_ground().items
    session = session_of(Mission(session.mission.home, (*items[1:3], *items[7:]), source="l"))
    with pytest.raises(MissionError, match="landing"):
        session.save("plan.json")
    speed = MissionItem(4, 178, 2, (0.0, 20.0, -1.0, 0.0), 0.0, 0.0, 0.0)
    way = (*items[1:3], speed, replace(items[5], seq=5))
    session = session_of(Mission(session.mission.home, way, source="s"))
    with pytest.raises(MissionError, match="change of speed"):
        session.save("plan.json")


def test_an_edited_plan_keeps_its_ways_to_the_ground_while_the_legs_next_to_them_stay(tmp_path: Path) -> None:
    file, again = tmp_path / "plan.json", tmp_path / "again.json"
    file.write_bytes(default_run()[2]["plan.json"])
    base = read_plan(file)
    assert base.procedures is not None
    session, _ = open_session(str(file), MissionOptions())
    places = edits.movable_indices(session.mission)
    first = next(
        n
        for n, k in enumerate(places)
        if np.allclose(session.context.item_positions(session.mission)[n], base.waypoints[0], atol=0.02)
    )
    middle = places[first + len(base.waypoints) // 2]
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=-2.0, ks=[middle]))
    saved = session.save("plan.json")
    again.write_bytes(saved.data)
    made = read_plan(again)
    raised = made.waypoints - base.waypoints
    assert raised[len(raised) // 2] == pytest.approx([0.0, 0.0, -2.0], abs=0.02)
    assert np.abs(np.delete(raised, len(raised) // 2, axis=0)).max() < 0.02
    assert (made.certificate.problems, made.certificate == base.certificate) == ((), False)
    reopened, _ = open_session(str(again), MissionOptions())
    kinds = [item.command for item in reopened.mission.items]
    assert kinds == [item.command for item in session.mission.items]
    assert kinds[-1] == Command.NAV_LAND
    here, there = (one.context.item_positions(one.mission) for one in (session, reopened))
    assert np.abs(here - there).max() < 0.02
    # The turn at the first waypoint is the climb-out's, too.
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=1.0, ks=[places[first + 1]]))
    with pytest.raises(MissionError, match="or a leg next to them"):
        session.save("plan.json")


def test_a_planned_path_is_taken_of_the_sheet_that_it_is_of_alone() -> None:
    session = planned_session()
    plan = straight_plan(session.context.scenario, 3)
    session.plans = ([plan], None)
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=5.0))
    mission = session.mission
    with pytest.raises(StaleEdit):
        session.replace_plan(messages.Choose(kind="choose", rev=session.rev - 1, which=0))
    with pytest.raises(PlanflyError, match="plan again"):
        session.replace_plan(messages.Choose(kind="choose", rev=session.rev, which=0))
    session.plans = ([plan], None)
    session.change_settings(messages.Settings(kind="settings", wind_speed=3.0))
    with pytest.raises(PlanflyError, match="plan again"):
        session.replace_plan(messages.Choose(kind="choose", rev=session.rev, which=0))
    assert session.mission is mission


def test_a_path_that_was_searched_for_an_older_sheet_is_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    session, asked = planned_session(), []
    monkeypatch.setattr("planfly.studio.jobs.WorkerProcess.submit", lambda self, work: asked.append(work))
    monkeypatch.setattr("planfly.studio.jobs.WorkerProcess.start", lambda self: None)
    jobs = Jobs(lambda name, answer: None)
    jobs.start_first_task(session)
    assert [work.function for work in asked] == ["planfly.studio.worker_tasks.plan"]
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=5.0))
    answers = jobs.handle_answer(
        LONG_WORKER, Answer(asked[0].number, "done", [straight_plan(session.context.scenario, 3)]), session
    )
    assert [one["kind"] for one in answers] == ["stopped", "fault"]
    assert not jobs.take_initial_plan(session)
    # What was restored is flown, not planned anew.
    again = Jobs(lambda name, answer: None)
    again.start_first_task(session)
    assert asked[-1].function == "planfly.studio.worker_tasks.try_planned_suggestions"


def test_a_certificate_does_not_outlive_settings() -> None:
    session = planned_session()
    session.plans = ([straight_plan(session.context.scenario, 3)], None)
    session.replace_plan(messages.Choose(kind="choose", rev=session.rev, which=0))
    assert session.mission_message()["planned"]
    session.change_settings(messages.Settings(kind="settings", wind_speed=9.0))
    assert not session.mission_message()["planned"]
    saved = json.loads(session.save("plan.json").data)
    assert saved["certificate"]["problems"] != ["not planned yet"]
    assert any("wind" in line for line in session.save("waypoints").losses)


# ----------------------------------------------------------------------
# Files and worlds.


def test_a_log_that_names_other_files_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = write_example_log(tmp_path / "l.mcap").read_bytes()
    open_dropped("l.mcap", data, MissionOptions())
    seen: list[bytes] = []
    monkeypatch.setattr(documents, "_check_plan_names_no_files", lambda name, text: seen.append(text))
    open_dropped("l.waypoints", data, MissionOptions())
    monkeypatch.undo()
    scenario = json.loads(seen[0])
    scenario["scenario"].setdefault("flight", {})["params"] = "/etc/passwd"
    with pytest.raises(MissionError, match="names other files"):
        documents._check_plan_names_no_files("l.mcap", json.dumps(scenario).encode())


def test_only_the_commands_file_is_written_over_and_not_if_it_was_changed(tmp_path: Path) -> None:
    file, other = tmp_path / "m.waypoints", tmp_path / "other.waypoints"
    for one, seed in ((file, 8), (other, 9)):
        one.write_text(mission_text(drawn_session(seed, 8).mission, "waypoints"), encoding="utf-8")
    session, _ = open_session(str(file), MissionOptions(scenario="jacksboro"))
    session.open(open_document(str(other), session.options))
    assert session.mission_message()["over"] == ""
    with pytest.raises(PlanflyError, match="started without a mission file"):
        session.overwrite_file()
    session.open(open_document(str(file), session.options))
    for _ in range(2):
        session.edit(messages.Raise(kind="raise", rev=session.rev, by=10.0))
        session.overwrite_file()
    file.write_text(other.read_text(encoding="utf-8"), encoding="utf-8")
    with pytest.raises(PlanflyError, match="changed by another program"):
        session.overwrite_file()
    assert file.read_bytes() == other.read_bytes()


def test_an_opening_is_undone_and_each_document_is_kept_for_itself(tmp_path: Path) -> None:
    file, other = tmp_path / "m.waypoints", tmp_path / "other.waypoints"
    for one, seed in ((file, 8), (other, 9)):
        one.write_text(mission_text(drawn_session(seed, 8).mission, "waypoints"), encoding="utf-8")
    kept = tmp_path / "kept.json"
    session, _ = open_session(str(file), MissionOptions(scenario="jacksboro"), kept)
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=10.0))
    mine = session.mission
    session.autosave(kept)
    number = session.mission_message()["document"]
    session.open(open_document(str(other), session.options))
    assert session.mission_message()["document"] > number
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=20.0))
    theirs = session.mission
    session.autosave(kept)
    assert open_session(str(file), MissionOptions(scenario="jacksboro"), kept)[0].mission.items == mine.items
    session.step_history("undo")
    assert session.mission_message()["undo"] == "open other.waypoints"
    session.step_history("undo")
    assert session.mission is mine
    assert session.mission_message()["name"] == "m.waypoints"
    assert session.mission_message()["over"] == "waypoints"
    session.step_history("redo")
    session.step_history("redo")
    assert session.mission is theirs
    session.step_history("undo")
    session.step_history("undo")
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=1.0))
    assert session.redo_text == ""


def test_the_zones_of_a_named_fence_stand_in_the_next_world(tmp_path: Path) -> None:
    mission = drawn_session(8, 6).mission
    lat, lon = mission.items[0].lat_deg, mission.items[0].lon_deg
    ring = [[lon + a, lat + b] for a, b in ((-0.01, -0.01), (0.01, -0.01), (0.01, 0.01), (-0.01, 0.01), (-0.01, -0.01))]
    shape = {"type": "Feature", "properties": {"name": "Z"}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
    fence = tmp_path / "z.geojson"
    fence.write_text(json.dumps({"type": "FeatureCollection", "features": [shape]}), encoding="utf-8")
    world = MissionOptions(terrain="jacksboro", fence=(str(fence),))
    session = Session.from_document(
        open_dropped("m.waypoints", mission_text(mission, "waypoints").encode(), world), world
    )
    assert len(session.context.scenario.zones) == 1
    k = edits.movable_indices(session.mission)[-1]
    east, north, _ = session.item_position(k)
    before = session.world_rev
    session.edit(messages.Move(kind="move", rev=session.rev, k=k, east=east + 2500.0, north=north))
    assert session.world_rev == before + 1
    assert [zone["name"] for zone in session.world_message()["zones"]] != []
    assert len(session.context.scenario.zones) == 1


# ----------------------------------------------------------------------
# The server.


class NoSocket:
    """A page that takes nothing."""

    def __init__(self) -> None:
        self.closed: list[int] = []
        self.scope: dict[str, Any] = {}


def server_of(session: Session, kept: Path | None = None) -> Server:
    return Server(session, "token", kept, None)


def sent(page: Page) -> list[dict[str, Any]]:
    found = []
    while not page.frames.empty():
        found.append(json.loads(page.frames.get_nowait()))
    return found


class ByWhom:
    """Becomes the name of the thread that pickles it."""

    def __reduce__(self) -> tuple[Any, ...]:
        return str, (threading.current_thread().name,)


def test_works_are_pickled_where_missions_are_judged() -> None:
    """Judging fills caches of the mission: pickled beside it, a flight was lost, and every one after it."""
    server = server_of(drawn_session(5, 12))
    work = pickle.loads(server._pack_task(Task(1, "works.fly", ByWhom())))
    assert work.payload.startswith("studio-judge")


def test_a_stale_drag_is_answered() -> None:
    session = drawn_session(5, 12)

    async def run() -> list[dict[str, Any]]:
        server, page = server_of(session), Page(NoSocket(), dark=False)  # type: ignore[arg-type]
        drag = {"kind": "drag", "rev": session.rev + 1, "n": 7, "k": 2, "east": 0.0, "north": 0.0}
        await server._handle_message(page, json.dumps(drag))
        task = asyncio.create_task(server._judge_drags(page))
        while page.frames.empty():
            await asyncio.sleep(0.01)
        task.cancel()
        return sent(page)

    assert asyncio.run(asyncio.wait_for(run(), 20.0)) == [{"kind": "preview", "n": 7, "stale": True}]


def test_a_value_out_of_range_is_a_fault_and_no_message_is_the_end() -> None:
    session = drawn_session(5, 12)

    async def run() -> list[dict[str, Any]]:
        server, page = server_of(session), Page(NoSocket(), dark=False)  # type: ignore[arg-type]
        await server._handle_message(page, '{"kind": "raise", "rev": 1, "by": 1e9}')
        for text in ('{"kind": "x"}', "[", "{}"):
            with pytest.raises(ValueError, match="1 validation error"):
                await server._handle_message(page, text)
        return sent(page)

    (fault,) = asyncio.run(run())
    assert fault["kind"] == "fault"
    assert fault["text"].startswith("raise: by: ")


def test_a_full_disk_is_said_once(tmp_path: Path) -> None:
    session = drawn_session(5, 12)
    session.edit(messages.Raise(kind="raise", rev=session.rev, by=10.0))
    (tmp_path / "file").write_text("x", encoding="utf-8")

    async def run() -> list[dict[str, Any]]:
        server = server_of(session, tmp_path / "file" / "kept.json")
        page = Page(NoSocket(), dark=False)  # type: ignore[arg-type]
        server._pages.add(page)
        await server._autosave_session()
        await server._autosave_session()
        return sent(page)

    (fault,) = asyncio.run(run())
    assert "edits are not being saved: " in fault["text"]


def test_a_page_that_missed_a_frame_is_closed() -> None:
    async def run() -> bool:
        page = Page(NoSocket(), dark=False)  # type: ignore[arg-type]
        for _ in range(64):
            page.send({})
        assert not page.has_overflowed.is_set()
        page.send({})
        return page.has_overflowed.is_set()

    assert asyncio.run(run())


def test_a_fault_of_the_server_ends_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def broken(self: Server) -> None:
        raise RuntimeError("broken")

    monkeypatch.setattr(Server, "run", broken)
    file = tmp_path / "m.waypoints"
    file.write_text(mission_text(drawn_session(8, 8).mission, "waypoints"), encoding="utf-8")
    with pytest.raises(RuntimeError, match="broken"):
        planfly.open_studio(
            file, scenario="jacksboro", port=0, browser=False, keep=tmp_path, on_message=lambda line: None
        )


class TalkingSocket(NoSocket):
    """A socket of which messages are always there."""

    def __init__(self, *texts: str) -> None:
        super().__init__()
        self.texts = list(texts)
        self.read = 0

    async def accept(self) -> None:
        pass

    async def receive(self) -> dict[str, str]:
        self.read += 1
        if self.read > len(self.texts):
            return {"type": "websocket.disconnect"}
        return {"type": "websocket.receive", "text": self.texts[self.read - 1]}

    async def send_text(self, text: str) -> None:
        pass

    async def send_bytes(self, data: bytes) -> None:
        pass

    async def close(self, code: int) -> None:
        self.closed.append(code)


HELLO = json.dumps({"kind": "hello", "token": "token"})


def test_a_first_message_is_short() -> None:
    long = TalkingSocket(HELLO + " " * 2_000)
    asyncio.run(server_of(drawn_session(5, 12)).serve(long))  # type: ignore[arg-type]
    assert long.closed == [NO_TOKEN]


def test_a_page_that_floods_the_server_leaves_time_to_others() -> None:
    async def run() -> int:
        flood = TalkingSocket(HELLO, *['{"kind": "stop"}'] * 100_000)
        serving = asyncio.create_task(server_of(drawn_session(5, 12)).serve(flood))  # type: ignore[arg-type]
        while not flood.read:
            await asyncio.sleep(0.001)
        await asyncio.sleep(0.1)
        serving.cancel()
        return flood.read

    assert asyncio.run(run()) < 1_000
