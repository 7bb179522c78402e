"""The server as pages meet it: who is let in, what is refused, and that two pages agree."""

import base64
import contextlib
import gc
import http.client
import json
import socket
import string
from collections.abc import Iterator

import numpy as np
import psutil
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection

from flight.mission_files.formats import mission_text
from planfly.studio import connections, messages
from planfly.studio.jobs import LONG_WORKER, Jobs
from tests.planfly.studio.drafts import drawn_session
from tests.planfly.studio.served import PageProgram, Served, served
from tests.soak import SOAK, note, only_in_soak, scaled

FUZZED, EDITED = scaled(2000, 12), scaled(1000, 7)
# Edits before memory is looked at; what more it may be, MB.
WARM, MOST_MEMORY = 3, 100.0 if SOAK else 20.0


@pytest.fixture(scope="module")
def studio(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("studio")
    file = folder / "m.waypoints"
    file.write_text(mission_text(drawn_session(8, 8).mission, "waypoints"), encoding="utf-8")
    (folder / "other.waypoints").write_text(mission_text(drawn_session(9, 8).mission, "waypoints"), encoding="utf-8")
    (folder / "outside.waypoints").symlink_to("/etc/passwd")
    with served(file, scenario="jacksboro", keep=folder / "kept") as running:
        yield running


def code_of(socket: ClientConnection, message: str | bytes) -> int:
    """The code that a message is answered with; 0 where it is answered with anything else."""
    try:
        socket.send(message)
        socket.recv(timeout=20)
    except ConnectionClosed as closed:
        return 0 if closed.rcvd is None else closed.rcvd.code
    return 0


def test_a_drag_is_judged_and_a_move_is_flown_and_seen_by_both_pages(studio: Served) -> None:
    with studio.page() as page, studio.page() as other:
        sheet = page.until("sheet")
        other.until("sheet")
        item = sheet["items"][2]
        east, north, _ = item["at"]
        page.send(kind="drag", rev=sheet["rev"], n=1, k=item["k"], east=east + 150.0, north=north)
        seen = page.until("preview", n=1)
        assert "sheet" in seen or seen["windows"]
        page.send(kind="drag", rev=sheet["rev"], n=2, k=item["k"], east=east + 200.0, north=north, whole=True)
        assert page.until("preview", n=2)["sheet"]["verdict"]["level"] == "geometric"
        page.send(kind="move", rev=sheet["rev"], k=item["k"], east=east + 200.0, north=north)
        mine, theirs = page.until("sheet", rev=sheet["rev"] + 1), other.until("sheet", rev=sheet["rev"] + 1)
        assert mine == theirs
        assert mine["items"][2]["at"][0] == pytest.approx(east + 200.0, abs=0.2)
        flown = page.until("flown", rev=mine["rev"])
        assert flown["track"]
        assert flown["seconds"] > 60.0
        # An edit of the sheet before is refused, and the page is shown the sheet as it is.
        other.send(kind="delete", rev=sheet["rev"], ks=[item["k"]])
        other.until("stale")
        # What one page saves is saved for all, and what is edited afterwards is not.
        page.send(kind="save", form="waypoints", over=True)
        assert other.until("unsaved")["unsaved"] is False
        page.send(kind="undo")
        undone = other.until("sheet", rev=mine["rev"] + 1)
        assert (undone["items"], undone["unsaved"]) == (sheet["items"], True)
        page.send(kind="save", form="waypoints", over=True)
        other.until("unsaved")


def test_a_file_of_the_folder_is_opened_and_none_outside(studio: Served) -> None:
    with studio.page() as page:
        assert page.until("choices")["files"] == ["m.waypoints", "other.waypoints"]
        before = page.until("sheet")
        for name in (
            "outside.waypoints",
            "/etc/passwd",
            "../m.waypoints",
            "..",
            "kept",
            "m.waypoints/../other.waypoints",
        ):
            page.send(kind="open", name=name)
            text = page.until("fault")["text"]
            # The folder of kept sessions is made by the first session that is kept.
            assert "expected a file in" in text or (name == "kept" and "no such file in" in text)
        page.send(kind="open", name="missing.waypoints")
        assert "no such file in" in page.until("fault")["text"]
        page.send(kind="open", name="other.waypoints")
        opened = page.until("sheet", name="other.waypoints")
        assert opened["rev"] > before["rev"]
        data = base64.b64encode(mission_text(drawn_session(8, 8).mission, "waypoints").encode()).decode()
        page.send(kind="open", name="dropped.waypoints", data=data)
        assert page.until("sheet", name="dropped.waypoints")["over"] == ""
        page.send(kind="save", form="waypoints")
        assert base64.b64decode(page.until("saved")["data"]) == base64.b64decode(data)
        page.send(kind="open", name="m.waypoints")
        page.until("sheet", name="m.waypoints")


def test_without_the_token_nothing_is_shown(studio: Served) -> None:
    for first in ('{"kind": "hello", "token": "wrong"}', '{"kind": "undo"}', "", "{", f'{{"token": "{studio.token}"}}'):
        with studio.socket() as one:
            assert code_of(one, first) == 4403


@pytest.mark.parametrize("origin", [None, "http://evil.test", "null", "https://127.0.0.1", "http://127.0.0.1:1"])
def test_another_page_reaches_no_websocket(studio: Served, origin: str | None) -> None:
    with pytest.raises(InvalidStatus) as refused, studio.socket(origin=origin):
        pass
    assert refused.value.response.status_code == 403


HANDSHAKE = (
    "GET /session HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nOrigin: http://127.0.0.1:{port}\r\nUpgrade: websocket\r\n"
    "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n\r\n"
)


def asked(studio: Served, method: str, path: str, **headers: str) -> tuple[int, bytes]:
    link = http.client.HTTPConnection("127.0.0.1", studio.port, timeout=20)
    link.putrequest(method, path, skip_host="Host" in headers)
    for name, value in headers.items():
        link.putheader(name.replace("_", "-"), value)
    link.endheaders()
    answer = link.getresponse()
    data = answer.read()
    assert answer.getheader("Content-Security-Policy") or answer.status == 400
    link.close()
    return answer.status, data


def test_only_the_pages_own_files_are_there(studio: Served) -> None:
    assert asked(studio, "GET", "/")[0] == 200
    for path in (
        "/../pyproject.toml",
        "/..%2f..%2fetc/passwd",
        "//etc/passwd",
        "/studio.html",
        "/m.waypoints",
        "/session",
    ):
        assert asked(studio, "GET", path)[0] in (403, 404), path
    assert asked(studio, "POST", "/")[0] == 405
    assert asked(studio, "GET", "/", Host="evil.test")[0] == 421


def test_a_page_holds_no_secret_and_loads_nothing_from_elsewhere(studio: Served) -> None:
    for path in ("/", "/studio.js", "/link.js", "/panel.js", "/studio.css", "/theme.css"):
        _, data = asked(studio, "GET", path)
        assert studio.token.encode() not in data
        assert b"https://" not in data
        assert b"eval(" not in data


def test_a_body_of_a_gigabyte_is_not_read(studio: Served) -> None:
    with socket.create_connection(("127.0.0.1", studio.port), timeout=20) as link:
        head = f"POST / HTTP/1.1\r\nHost: 127.0.0.1:{studio.port}\r\nContent-Length: {2**30}\r\n\r\n"
        link.sendall(head.encode())
        sent = 0
        try:
            while sent < 2**30:
                sent += link.send(b"x" * 2**16)
        except OSError:
            pass
        assert sent < 64 * 2**20
    with studio.socket() as one:
        assert (
            code_of(one, "x" * (messages.MAX_DROPPED_MESSAGE_CHARACTERS + messages.MAX_MESSAGE_CHARACTERS + 1)) == 1009
        )


def test_a_connection_that_asks_for_nothing_ends(studio: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "HTTP_LIFETIME_S", 0.4)
    address = ("127.0.0.1", studio.port)
    with studio.page() as page, contextlib.ExitStack() as links:
        silent, half, kept = (links.enter_context(socket.create_connection(address, timeout=20)) for _ in range(3))
        half.sendall(b"GET / HTTP/1.1\r\nHost: ")
        kept.sendall(f"GET /link.js HTTP/1.1\r\nHost: 127.0.0.1:{studio.port}\r\n\r\n".encode())
        assert kept.recv(15) == b"HTTP/1.1 200 OK"
        for one in (silent, half, kept):
            with contextlib.suppress(ConnectionError):
                while one.recv(2**16):
                    pass
        # The page's own is another matter.
        page.send(kind="save", form="kml")
        page.until("saved")


def test_connections_without_a_token_are_few(studio: Served) -> None:
    """Neither silent connections nor websockets that say nothing, or too much, keep a page out."""
    process, address = psutil.Process(), ("127.0.0.1", studio.port)
    before = process.num_fds()
    with contextlib.ExitStack() as links, studio.page() as earlier:
        earlier.until("sheet")
        count = 3 * connections.MAX_UNKNOWN_CONNECTIONS
        for _ in range(count):
            links.enter_context(contextlib.closing(socket.create_connection(address, timeout=20)))
        for _ in range(count):
            link = links.enter_context(contextlib.closing(socket.create_connection(address, timeout=20)))
            link.sendall(HANDSHAKE.format(port=studio.port).encode())
            assert link.recv(12) == b"HTTP/1.1 101"
        # Both ends are in this process.  The server's: the unknown ones, and those of the pages.
        assert process.num_fds() - before - 2 * count <= connections.MAX_UNKNOWN_CONNECTIONS + 20
        with studio.page() as page:
            page.until("sheet")
        earlier.send(kind="save", form="kml")
        earlier.until("saved")


def test_a_first_message_is_bounded_before_it_is_read(studio: Served) -> None:
    with studio.socket() as one:
        assert code_of(one, "x" * (messages.MAX_FIRST_MESSAGE_CHARACTERS + 1)) == 1009
    with studio.socket() as one:
        assert code_of(one, "x" * messages.MAX_FIRST_MESSAGE_CHARACTERS) == 4403
    with studio.page() as page:
        page.until("sheet")
        assert code_after(page, " " * messages.MAX_FIRST_MESSAGE_CHARACTERS + '{"kind": "stop"}') == 0


def test_four_pages_are_enough(studio: Served) -> None:
    with studio.page() as a, studio.page() as b, studio.page() as c, studio.page() as d:
        for page in (a, b, c, d):
            page.until("sheet")
        with studio.page() as fifth, pytest.raises(ConnectionClosed) as closed:
            fifth.until("sheet")
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 4429


def code_after(page: PageProgram, message: str | bytes) -> int:
    """The code with which a page is closed for a message; 0 for one that it may say, which others follow."""
    try:
        page.socket.send(message)
        page.send(kind="save", form="kml")
        page.until("saved")
    except ConnectionClosed as closed:
        return 0 if closed.rcvd is None else closed.rcvd.code
    return 0


def fuzzed(rng: np.random.Generator) -> str | bytes:
    """A message that is none, or one with something wrong in it."""
    kinds = [
        "hello",
        "drag",
        "move",
        "insert",
        "delete",
        "raise",
        "apply",
        "settings",
        "plan",
        "save",
        "open",
        "fly",
        "x",
    ]
    values = [
        None,
        True,
        -1,
        1e308,
        2**70,
        "x" * 300,
        [],
        {},
        [[[[]]]],
        "../../etc/passwd",
        "NaN",
        0.5,
        "\x00",
        "\ud800",
    ]
    match int(rng.integers(6)):
        case 0:
            return bytes(rng.integers(0, 256, 40, dtype=np.uint8))
        case 1:
            return "[" * int(rng.integers(1, 60_000))
        case 2:
            return "".join(rng.choice(list(string.printable), 60))
        case 3:
            return '{"kind": "move", "rev": 1, "k": 0, "east": NaN, "north": Infinity}'
        case 4:
            return "x" * (messages.MAX_MESSAGE_CHARACTERS + 10)
    data: dict[str, object] = {"kind": str(rng.choice(kinds))}
    for name in rng.choice(
        ["rev", "k", "east", "north", "up", "ks", "by", "form", "name", "data", "token", "which"], 4
    ):
        data[str(name)] = values[int(rng.integers(len(values)))]
    return json.dumps(data)


def test_no_message_ends_the_server(studio: Served) -> None:
    rng = np.random.default_rng(7)
    closed = 0
    for _ in range(FUZZED):
        with studio.page() as page:
            page.until("sheet")
            code = code_after(page, fuzzed(rng))
            assert code in (0, 1007, 1009)
            closed += code > 0
    assert closed > FUZZED // 2
    with studio.page() as page:
        assert page.until("sheet")["name"] == "m.waypoints"
    note("studio: fuzzed messages", messages=FUZZED, closed=closed, servers_ended=0)


@only_in_soak
def test_edits_take_little_memory(studio: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    if not SOAK:
        monkeypatch.setattr("planfly.studio.jobs.Jobs.fly", lambda self, session: None)
    rng, process, taken = np.random.default_rng(3), psutil.Process(), list[float]()
    with studio.page() as page:
        sheet = page.until("sheet")
        items = [one for one in sheet["items"] if one["what"] == "waypoint"]
        for number in range(WARM + EDITED):
            if number in (WARM, WARM + EDITED - 1):
                gc.collect()
                taken.append(process.memory_info().rss / 2**20)
            item = items[int(rng.integers(len(items)))]
            east, north = (np.array(item["at"][:2]) + rng.normal(0.0, 20.0, 2)).tolist()
            page.send(kind="move", rev=sheet["rev"], k=item["k"], east=east, north=north)
            sheet = page.until("sheet")
        # To open it anew would bring back what is kept of it.
        page.send(kind="revert")
        page.until("sheet", changed=False)
    note("studio: memory after edits", edits=EDITED, more_mb=round(taken[1] - taken[0], 1))
    assert taken[1] - taken[0] <= MOST_MEMORY


@only_in_soak
def test_a_long_work_is_stopped(studio: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    if not SOAK:
        # Of a campaign nothing counts here but that it takes long.
        count = "tests.planfly.studio.light_works.count"
        monkeypatch.setattr(
            Jobs,
            "start_task",
            lambda self, kind, session: self._submit_task(LONG_WORKER, kind, count, 10**6, session.rev),
        )
    with studio.page() as page:
        page.until("sheet")
        page.send(kind="campaign")
        page.until("working", job="campaign")
        page.send(kind="stop")
        page.until("stopped", job="campaign")
