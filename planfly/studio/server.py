"""Serve the studio, with pages on websockets, one session, a judging thread and two worker processes.

Drags are judged one at a time, the newest first. Edits are applied in order, and every page is sent the result.
"""

import asyncio
import base64
import binascii
import contextlib
import functools
import hmac
import json
import pickle
import struct
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np
from pydantic import ValidationError
from starlette.websockets import WebSocket, WebSocketDisconnect

from planfly.studio import messages
from planfly.studio.connections import ALLOW_FULL_SIZE
from planfly.studio.documents import open_document, open_dropped
from planfly.studio.folder import find_file_in_folder, folder_message, home_relative_text
from planfly.studio.ground_picture import draw_ground, sample_ground_grid
from planfly.studio.jobs import Jobs
from planfly.studio.messages import read_message
from planfly.studio.session import Session, StaleEdit
from planfly.studio.settings import PARAMETER_FILES
from planfly.studio.view_model import Json
from planfly.studio.worker_process import INTERNAL, Answer, Task, internal_text
from world.errors import MissionError, PlanflyError
from world.files import read_small_file, utf8_text

Result = TypeVar("Result")

# Maximum number of pages.
MAX_PAGES = 4
# Maximum time until a page sends its token, s.
TOKEN_TIMEOUT_S = 5.0
# Interval between two autosaves, s.
AUTOSAVE_INTERVAL_S = 3.0
# Pause after each message of a page, s, so that a page that floods the server leaves time for other pages.
MESSAGE_PAUSE_S = 0.002
# Maximum number of frames that wait for a slow page.
_MAX_WAITING_FRAMES = 64
# Pause in which an answer is sent before the next position of a drag is judged, s.
_SEND_PAUSE_S = 0.001
# Interval at which the server checks whether a page has gone, s.
_SLOT_CHECK_INTERVAL_S = 0.05
# Code that closes a websocket without a token.
NO_TOKEN = 4403
# Code that closes a websocket if there are too many pages.
TOO_MANY = 4429
# Code that closes the websocket of a page that is too slow.
TOO_SLOW = 1013
# Code that closes a websocket after a message that is not understood.
NOT_UNDERSTOOD = 1007


@dataclass(eq=False)
class Page:
    """Connected page that has sent its token.

    socket: websocket of the page.
    dark: True if the page has dark colours.
    frames: queue of frames to send.
    drag: newest position of a drag that is not judged yet, or None.
    drag_received: event that is set when a position arrives.
    sent_ground: hash of the terrain that was sent last, and True if it was drawn for a dark page.
    has_overflowed: event that is set when the queue of frames has overflowed.
    """

    socket: WebSocket
    dark: bool
    frames: asyncio.Queue[str | bytes] = field(default_factory=lambda: asyncio.Queue(_MAX_WAITING_FRAMES))
    drag: messages.Drag | None = None
    drag_received: asyncio.Event = field(default_factory=asyncio.Event)
    sent_ground: tuple[int, bool] = (0, False)
    has_overflowed: asyncio.Event = field(default_factory=asyncio.Event)

    def send(self, message: Json | bytes) -> None:
        """Queue a message for the page; if its queue is full, set `has_overflowed`, which closes the page."""
        frame = message if isinstance(message, bytes) else json.dumps(message, separators=(",", ":"), allow_nan=False)
        try:
            self.frames.put_nowait(frame)
        except asyncio.QueueFull:
            # A page that has missed a frame shows a wrong state and has to reconnect.
            self.has_overflowed.set()


class Server:
    """Server of the studio, which connects pages, session and worker processes.

    uvicorn serves the sockets.
    """

    def __init__(self, session: Session, token: str, autosave_file: Path | None, folder: Path | None) -> None:
        """Prepare the server.

        token: token that a page must send first.
        autosave_file: autosave path of the first document; None to save nothing automatically.
        folder: folder of the files that the page may open, or None.
        """
        self.session, self._token, self._autosave_file = session, token, autosave_file
        self._folder = folder
        self._pages: set[Page] = set()
        self._judge_thread = ThreadPoolExecutor(1, "studio-judge")
        self._draw_thread = ThreadPoolExecutor(1, "studio-draw")
        self._change_lock = asyncio.Lock()
        self._ground_frames: dict[tuple[int, bool], tuple[bytes, ...]] = {}
        self.jobs = Jobs(self._forward_answer, self._pack_task)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._initial_plan_task: asyncio.Future[None] | None = None
        self._autosave_error = ""
        self.first_page_served = threading.Event()

    # ------------------------------------------------------------------
    # Start and end.

    async def run(self) -> None:
        """Start the first task, then autosave every `AUTOSAVE_INTERVAL_S` until cancelled."""
        self._loop = asyncio.get_running_loop()
        self.jobs.start_first_task(self.session)
        while True:
            await asyncio.sleep(AUTOSAVE_INTERVAL_S)
            await self._autosave_session()

    async def _autosave_session(self) -> None:
        """Autosave the session if it has changed; report an error to the pages, but not again until a success."""
        if self._autosave_file is not None and (self.session.needs_autosave or self.session.autosaved_rev):
            # On a full disk the studio goes on without autosave, and reports the error once.
            try:
                await self._run_judging(lambda: self.session.autosave(self._autosave_file or Path()))
            except (OSError, PlanflyError) as error:
                if not self._autosave_error:
                    self._broadcast({"kind": "fault", "job": "keep", "text": f"edits are not being saved: {error}"})
                self._autosave_error = str(error)
            else:
                self._autosave_error = ""

    async def close(self) -> None:
        """Autosave, and end the processes."""
        await self._autosave_session()
        self.jobs.close()
        self._judge_thread.shutdown(wait=False, cancel_futures=True)
        self._draw_thread.shutdown(wait=False, cancel_futures=True)

    async def _run_judging(self, function: Callable[[], Result]) -> Result:
        """Call a function in the judging thread, and return its result."""
        return await asyncio.get_running_loop().run_in_executor(self._judge_thread, function)

    def _pack_task(self, task: Task | None) -> bytes:
        """Pickle a task in the judging thread.

        Judging cannot change caches of the pickled objects there meanwhile.
        """
        return self._judge_thread.submit(pickle.dumps, task).result()

    # ------------------------------------------------------------------
    # One page.

    async def serve(self, socket: WebSocket) -> None:
        """Accept a websocket; if it sends the token, serve its page until it disconnects or is too slow."""
        await socket.accept()
        page = await self._authenticate(socket)
        if page is None:
            return
        self._pages.add(page)
        self.first_page_served.set()
        tasks = [asyncio.create_task(self._write_frames(page)), asyncio.create_task(self._judge_drags(page))]
        messages_task = asyncio.create_task(self._handle_messages(page))
        overflow_task = asyncio.create_task(page.has_overflowed.wait())
        try:
            await asyncio.wait((messages_task, overflow_task), return_when=asyncio.FIRST_COMPLETED)
            if overflow_task.done():
                with contextlib.suppress(RuntimeError, WebSocketDisconnect, asyncio.TimeoutError):
                    await asyncio.wait_for(socket.close(TOO_SLOW), TOKEN_TIMEOUT_S)
            else:
                messages_task.result()
        except WebSocketDisconnect:
            pass
        except ValueError:
            with contextlib.suppress(RuntimeError):
                await socket.close(NOT_UNDERSTOOD)
        finally:
            self._pages.discard(page)
            for task in (*tasks, messages_task, overflow_task):
                task.cancel()
            await asyncio.gather(*tasks, messages_task, overflow_task, return_exceptions=True)

    async def _handle_messages(self, page: Page) -> None:
        """Send the initial messages to a page, then handle its messages until it disconnects."""
        page.send({"kind": "choices", **self.jobs.choices(), **folder_message(self._folder)})
        page.send(self.session.world_message())
        for message in (*self.jobs.progress_messages(), self._mission_message_for_page(), *self.jobs.result_messages()):
            page.send(message)
        await self._send_ground(page)
        while True:
            await self._handle_message(page, await _receive_text(page.socket))
            await asyncio.sleep(MESSAGE_PAUSE_S)

    async def _authenticate(self, socket: WebSocket) -> Page | None:
        """Return the page if its first message has the token; otherwise close the websocket and return None.

        The websocket is also closed if `MAX_PAGES` other pages stay connected for `TOKEN_TIMEOUT_S`.
        """
        code = NO_TOKEN
        with contextlib.suppress(ValueError, asyncio.TimeoutError, WebSocketDisconnect):
            text = await asyncio.wait_for(_receive_text(socket), TOKEN_TIMEOUT_S)
            if len(text) > messages.MAX_FIRST_MESSAGE_CHARACTERS:
                raise ValueError("a first message that is too long")
            message = read_message(text)
            has_token = isinstance(message, messages.Hello) and hmac.compare_digest(
                message.token.encode(), self._token.encode()
            )
            if has_token and isinstance(message, messages.Hello):
                socket.scope.get(ALLOW_FULL_SIZE, lambda: None)()
                code = TOO_MANY
                # A page that has gone occupies a slot until the server notices this, which may take some time. The
                # server polls, because pages may disconnect without notice.
                async with asyncio.timeout(TOKEN_TIMEOUT_S):
                    while len(self._pages) >= MAX_PAGES:
                        await asyncio.sleep(_SLOT_CHECK_INTERVAL_S)
                return Page(socket, message.dark)
        with contextlib.suppress(RuntimeError):
            await socket.close(code)
        return None

    async def _write_frames(self, page: Page) -> None:
        """Send the queued frames of a page, until cancelled.

        Errors of a page that has disconnected are ignored.
        """
        while True:
            frame = await page.frames.get()
            with contextlib.suppress(WebSocketDisconnect, RuntimeError):
                await (page.socket.send_bytes(frame) if isinstance(frame, bytes) else page.socket.send_text(frame))

    async def _judge_drags(self, page: Page) -> None:
        """Judge the newest position of a page's drag and send the result, until cancelled.

        One position is judged at a time.
        """
        while True:
            await page.drag_received.wait()
            page.drag_received.clear()
            drag, page.drag = page.drag, None
            if drag is None:
                continue
            try:
                result = await self._run_judging(functools.partial(self.session.judge_drag, drag))
            except StaleEdit:
                # The page waits for an answer before it sends another drag.
                page.send({"kind": "preview", "n": drag.n, "stale": True})
                continue
            except PlanflyError as error:
                result = {"fault": str(error)}
            except INTERNAL as error:
                result = {"fault": internal_text(error)}
            page.send({"kind": "preview", "rev": drag.rev, "n": drag.n, "k": drag.k, **result})
            # Let the answer be sent before the next position is judged, which keeps the interpreter busy.
            await asyncio.sleep(_SEND_PAUSE_S)

    def _mission_message_for_page(self) -> Json:
        """Return the message with the mission; "planning" is true while its first path is being planned."""
        return {**self.session.mission_message(), "planning": self.jobs.is_planning_first_path(self.session)}

    async def _send_ground(self, page: Page) -> None:
        """Send the terrain of the current world to a page, once for each world and each color scheme.

        Nothing is sent for a world without terrain.
        """
        terrain, world_message = self.session.context.scenario.terrain, self.session.world_message()
        key = (hash(json.dumps(world_message["shown"])), page.dark)
        if terrain is None or page.sent_ground == key:
            return
        page.sent_ground = key
        east, north = world_message["shown"]
        if key not in self._ground_frames:
            self._ground_frames.clear()

            def draw() -> tuple[bytes, ...]:
                """Draw the terrain, and return the frames with its heights and its picture."""
                grid = sample_ground_grid(terrain, tuple(east), tuple(north))
                header = {"east": east, "north": north, "rows": grid.heights.shape[0], "columns": grid.heights.shape[1]}
                picture = draw_ground(terrain, tuple(east), tuple(north), dark=page.dark)
                heights = np.ascontiguousarray(grid.heights, dtype="<f4").tobytes()
                return _make_frame("H", header, heights), _make_frame("G", {"east": east, "north": north}, picture)

            self._ground_frames[key] = await asyncio.get_running_loop().run_in_executor(self._draw_thread, draw)
        for frame in self._ground_frames[key]:
            page.send(frame)

    # ------------------------------------------------------------------
    # Messages of a page.

    async def _handle_message(self, page: Page, text: str) -> None:
        """Handle a message of a page.

        Errors are sent to the page as a fault. An edit of an older revision is not made; the page is sent the current
        mission instead. Raises ValueError for a message that is not understood.
        """
        try:
            message = read_message(text)
        except ValidationError as error:
            description = messages.describe_error(error)
            if not description:
                raise
            page.send({"kind": "fault", "text": description})
            return
        if isinstance(message, messages.Drag):
            page.drag = message
            page.drag_received.set()
            return
        if isinstance(message, messages.Look):
            page.dark = message.dark
            await self._send_ground(page)
            return
        session = self.session
        try:
            match message:
                case messages.Ask(kind="stop"):
                    self.jobs.stop()
                case messages.Ask() | messages.Plan():
                    if isinstance(message, messages.Plan):
                        self.jobs.plan(message, session)
                    else:
                        self.jobs.start_task(message.kind, session)
                    # A process that starts for the task takes seconds to report progress.
                    for progress_message in self.jobs.progress_messages():
                        self._broadcast(progress_message)
                case messages.Save():
                    save_mission = session.overwrite_file if message.over else lambda: session.save(message.form)
                    async with self._change_lock:
                        saved = await self._run_judging(save_mission)
                    content = "" if message.over else base64.b64encode(saved.data).decode()
                    path = session.document.path
                    folder = home_relative_text(path.parent) if message.over and path else ""
                    answer = {"name": saved.name, "losses": list(saved.losses), "where": folder, "data": content}
                    page.send({"kind": "saved", **answer})
                    self._broadcast({"kind": "unsaved", "unsaved": session.is_unsaved})
                case messages.Hello():
                    raise ValueError("a page must send its token only once")
                case _:
                    await self._change_session(message)
        except StaleEdit:
            page.send({"kind": "stale"})
            page.send(self._mission_message_for_page())
        except PlanflyError as error:
            page.send({"kind": "fault", "text": str(error)})
        except INTERNAL as error:
            page.send({"kind": "fault", "text": internal_text(error)})

    async def _change_session(self, message: messages.Message) -> None:
        """Change the session as a message requests.

        The changed mission is sent to every page, and its flight is started.

        If the message changes nothing, nothing is sent or started.
        """
        session = self.session
        async with self._change_lock:
            rev, world_rev = session.rev, session.world_rev
            await self._run_judging(lambda: self._apply_change(message))
            if session.rev == rev:
                return
            mission_message = await self._run_judging(self._mission_message_for_page)
        if session.world_rev != world_rev:
            self._broadcast(session.world_message())
        self._broadcast(mission_message)
        self.jobs.fly(session)
        if session.world_rev != world_rev:
            for page in list(self._pages):
                await self._send_ground(page)

    def _apply_change(self, message: messages.Message) -> None:
        """Change the session as a message requests; called in the judging thread.

        A file that is opened replaces the document, which is autosaved first if needed. Opening, undo and redo discard
        the results of jobs. A parameter file from the folder only changes the settings.
        """
        session = self.session
        match message:
            case messages.Move() | messages.Insert() | messages.Delete() | messages.Raise() | messages.Apply():
                session.edit(message)
            case messages.Step():
                previous_history = session.history
                session.step_history(message.kind)
                if session.history is not previous_history:
                    self.jobs.discard_results()
            case messages.Settings():
                session.change_settings(message)
            case messages.Choose():
                session.replace_plan(message)
            case messages.Open() if message.data is None and message.name.lower().endswith(PARAMETER_FILES):
                path = find_file_in_folder(self._folder, message.name)
                data = read_small_file(path, messages.MAX_MESSAGE_CHARACTERS, "parameter", PlanflyError)
                text = utf8_text(data, path, PlanflyError)
                session.change_settings(
                    messages.Settings(kind="settings", parameter_file=path.name, parameter_text=text)
                )
            case messages.Open():
                if message.data is None:
                    document = open_document(str(find_file_in_folder(self._folder, message.name)), session.options)
                else:
                    # A dropped file.
                    try:
                        data = base64.b64decode(message.data, validate=True)
                    except binascii.Error as error:
                        text = f"{message.name[:60]}: the file was not received completely"
                        raise MissionError(text, field="data") from error
                    document = open_dropped(message.name, data, session.options)
                if self._autosave_file is not None and session.needs_autosave:
                    # An error here is reported at the next regular autosave.
                    with contextlib.suppress(OSError, PlanflyError):
                        session.autosave(self._autosave_file)
                session.open(document, self._autosave_file)
                self.jobs.discard_results()

    # ------------------------------------------------------------------
    # Answers of the processes.

    def _forward_answer(self, worker: str, answer: Answer) -> None:
        """Forward an answer from the worker's thread to the event loop; drop it if the loop has ended."""
        if self._loop is not None and not self._loop.is_closed():
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._send_messages_of_answer, worker, answer)

    def _send_messages_of_answer(self, worker: str, answer: Answer) -> None:
        """Handle a worker's answer, and send the resulting messages to the pages.

        If the answer is the first planned path, its change to the mission is scheduled.
        """
        for message in self.jobs.handle_answer(worker, answer, self.session):
            self._broadcast(message)
        if self.jobs.take_initial_plan(self.session):
            choice = messages.Choose(kind="choose", rev=self.session.rev, which=0)
            self._initial_plan_task = asyncio.ensure_future(self._apply_initial_plan(choice))

    async def _apply_initial_plan(self, message: messages.Choose) -> None:
        """Make the path that was planned at the start of the studio the mission.

        If the mission was edited in the meantime, or the path cannot be used, a fault is sent to the pages instead.
        """
        try:
            await self._change_session(message)
        except StaleEdit:
            self._broadcast(
                {
                    "kind": "fault",
                    "job": "plan",
                    "text": "the mission was edited while its first path was planned, so the path is not used",
                }
            )
        except PlanflyError as error:
            self._broadcast({"kind": "fault", "job": "plan", "text": str(error)})
        except INTERNAL as error:
            self._broadcast({"kind": "fault", "job": "plan", "text": internal_text(error)})

    def _broadcast(self, message: Json) -> None:
        """Send a message to every page."""
        for page in self._pages:
            page.send(message)


async def _receive_text(socket: WebSocket) -> str:
    """Return the next text message of a websocket.

    Raises ValueError for a binary message, and WebSocketDisconnect when the page has disconnected.
    """
    event = await socket.receive()
    if event["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(event.get("code", 1000))
    text = event.get("text")
    if text is None:
        raise ValueError("expected a text message")
    return str(text)


def _make_frame(kind: str, header: Json, body: bytes) -> bytes:
    """Return a binary frame: kind (a letter), length of the header (4 bytes), header as JSON, and body."""
    text = json.dumps(header).encode()
    return kind.encode() + struct.pack("<I", len(text)) + text + body
