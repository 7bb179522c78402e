"""``planfly replay --foxglove``, met by a client that speaks Foxglove's WebSocket protocol."""

import contextlib
import importlib.util
import json
import socket
import ssl
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from flight.simulation.track import Track
from logs.recording.state_channel import EPOCH_NS, state_class
from planfly.cli import build_parser, main
from planfly.replays.foxglove_server import SUBPROTOCOL
from tests.clients import need
from tests.logs.made_flight import make_setup, make_track, record

pytestmark = pytest.mark.client


def needed(package: str, how: str) -> None:
    found = importlib.util.find_spec(package)
    need(None if found is None else Path(str(found.origin)), how, f"pip package {how}")


@pytest.fixture(scope="module")
def track() -> Track:
    return make_track(3.0)


@pytest.fixture(scope="module")
def log_path(tmp_path_factory: pytest.TempPathFactory, track: Track) -> Path:
    return record(tmp_path_factory.mktemp("foxglove") / "a.mcap", make_setup(), track)


class Viewer:
    """A client of the protocol foxglove.sdk.v1: channels by topic, and what came of those subscribed to."""

    def __init__(self, url: str) -> None:
        from websockets.sync.client import connect

        # No proxy stands between us and this machine.
        self.socket = connect(url, subprotocols=["foxglove.sdk.v1"], proxy=None)  # type: ignore[list-item]  # a plain string
        self.channels: dict[str, dict[str, Any]] = {}
        self.topics: dict[int, str] = {}
        self.messages: list[tuple[str, int, bytes]] = []
        self.times: list[int] = []

    def take(self, seconds: float) -> bool:
        """Handle one message; whether one came in time."""
        try:
            data = self.socket.recv(timeout=seconds)
        except TimeoutError:
            return False
        if isinstance(data, str):
            message = json.loads(data)
            for channel in message.get("channels", ()):
                self.channels[channel["topic"]] = channel
        elif data[0] == 1:
            number, stamp = struct.unpack_from("<IQ", data, 1)
            self.messages.append((self.topics[number], stamp, data[13:]))
        elif data[0] == 2:
            self.times.append(struct.unpack_from("<Q", data, 1)[0])
        return True

    def subscribe(self, *topics: str) -> None:
        wanted = [{"id": len(self.topics) + k, "channelId": self.channels[t]["id"]} for k, t in enumerate(topics)]
        self.topics |= {item["id"]: topic for item, topic in zip(wanted, topics, strict=True)}
        self.socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))


@pytest.fixture(scope="module")
def gate(log_path: Path) -> Iterator[tuple[subprocess.Popen[str], Viewer]]:
    """A server that lets two more pages in, and its viewer; the last test that uses it ends it."""
    needed("foxglove", "foxglove-sdk")
    needed("websockets", "websockets")
    with served(str(log_path), "--allow-origin", "https://mine.example,http://localhost:8080") as running:
        yield running


@contextlib.contextmanager
def served(*argv: str) -> Iterator[tuple[subprocess.Popen[str], Viewer]]:
    """The server in a process of its own, and a viewer connected to the address that it prints."""
    command = [sys.executable, "-m", "planfly", "replay", *argv, "--foxglove", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            assert line.startswith("foxglove  ws://127.0.0.1:"), line
            viewer = Viewer(line.split()[1])
            with viewer.socket:
                yield process, viewer
        finally:
            process.kill()


def test_a_viewer_is_given_the_log(log_path: Path, track: Track) -> None:
    needed("foxglove", "foxglove-sdk")
    needed("websockets", "websockets")
    from websockets.exceptions import ConnectionClosed

    with served(str(log_path), "--speed", "3") as (process, viewer):
        deadline = time.monotonic() + 120.0
        while len(viewer.channels) < 15 and time.monotonic() < deadline:
            viewer.take(1.0)
        assert set(viewer.channels) == {
            "/state",
            "/tf",
            "/fix",
            "/log",
            "/scene/terrain",
            "/scene/threats",
            "/scene/zones",
            "/scene/plan",
            "/scene/track",
            "/scene/aircraft",
            *(f"/points/{part}" for part in ("terrain", "threats", "plan", "track", "aircraft")),
        }
        state = viewer.channels["/state"]
        assert (state["encoding"], state["schemaName"], state["schemaEncoding"]) == (
            "protobuf",
            "planfly.State",
            "protobuf",
        )
        # Nothing is played before somebody listens.
        assert viewer.messages == []
        viewer.subscribe("/state", "/scene/terrain", "/log")
        late = False
        try:
            while time.monotonic() < deadline:
                viewer.take(1.0)
                if len(viewer.messages) > 60 and not late:
                    viewer.subscribe("/scene/plan")
                    late = True
        except ConnectionClosed:
            pass
        _, errors = process.communicate(timeout=120.0)
        assert process.returncode == 0, errors
    rows = [(stamp, state_class().FromString(data)) for topic, stamp, data in viewer.messages if topic == "/state"]
    assert [row.row for _, row in rows] == list(range(len(track)))
    assert [row.up_amsl_m for _, row in rows] == track.position[:, 2].tolist()
    assert [stamp for stamp, _ in rows] == [EPOCH_NS + round(t * 1e9) for t in track.time]
    topics = {topic for topic, _, _ in viewer.messages}
    # The plan was sent once, before we asked for it: who comes late is given the scene as it is.
    assert topics == {"/state", "/scene/terrain", "/log", "/scene/plan"}
    assert viewer.times == sorted(viewer.times)
    assert viewer.times[-1] == rows[-1][0]


def test_the_subprotocol_is_the_one_that_is_stated(gate: tuple[subprocess.Popen[str], Viewer]) -> None:
    """In what is printed and in the help; a viewer that asks for the older name alone is refused."""
    from websockets.exceptions import WebSocketException
    from websockets.sync.client import connect

    _, viewer = gate
    assert viewer.socket.subprotocol == SUBPROTOCOL == "foxglove.sdk.v1"
    host, port = viewer.socket.remote_address[:2]
    with pytest.raises(WebSocketException):
        connect(f"ws://{host}:{port}", subprotocols=["foxglove.websocket.v1"], proxy=None)  # type: ignore[list-item]  # a plain string
    commands = next(action for action in build_parser()._actions if hasattr(action, "choices") and action.choices)
    assert SUBPROTOCOL in " ".join(commands.choices["replay"].format_help().split())


def status(url: str, **asked: Any) -> int:
    """HTTP status that a request for a WebSocket gets."""
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    try:
        with connect(url, subprotocols=["foxglove.sdk.v1"], proxy=None, **asked) as socket:
            return int(socket.response.status_code)
    except InvalidStatus as refused:
        return int(refused.response.status_code)


def test_the_server_behind_the_gate_is_one_that_no_browser_opens(gate: tuple[subprocess.Popen[str], Viewer]) -> None:
    """Its port speaks TLS alone, with a certificate that nobody vouches for."""
    process, viewer = gate
    ports = {one.laddr.port for one in psutil.Process(process.pid).net_connections("inet") if one.status == "LISTEN"}
    (behind,) = ports - {viewer.socket.remote_address[1]}
    with socket.create_connection(("127.0.0.1", behind)) as plain:
        plain.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\n\r\n")
        plain.settimeout(60.0)
        assert plain.recv(100)[:4] != b"HTTP"
    with socket.create_connection(("127.0.0.1", behind)) as plain, pytest.raises(ssl.SSLCertVerificationError):
        ssl.create_default_context().wrap_socket(plain, server_hostname="localhost")


def test_a_page_of_another_site_is_refused_and_told_once(gate: tuple[subprocess.Popen[str], Viewer]) -> None:
    """Whatever its Origin and its Host; Foxglove's page, its program and a page that is named are let in."""
    process, viewer = gate
    port = viewer.socket.remote_address[1]
    url = f"ws://127.0.0.1:{port}"
    for origin in ("https://evil.example", "https://app.foxglove.dev.evil.example", "null", "http://127.0.0.1", ""):
        assert status(url, origin=origin) == 403, origin
    assert status(url, origin="https://evil.example") == 403
    for origin in ("https://app.foxglove.dev", "file://", "https://mine.example", "http://localhost:8080", None):
        assert status(url, origin=origin) == 101, origin
    # A name of the site's own that leads to this machine; the address is given apart from it.
    with socket.create_connection(("127.0.0.1", port)) as plain:
        assert status(f"ws://evil.example:{port}", sock=plain) == 403
    with socket.create_connection(("127.0.0.1", port)) as plain:
        assert status(f"ws://localhost:{port}", sock=plain) == 101
    process.kill()
    assert process.stdout is not None
    told = [line for line in process.stdout if line.startswith("foxglove  refused")]
    assert len(told) == len(set(told)) == 6
    assert "foxglove  refused a page of https://evil.example\n" in told
    assert f"foxglove  refused a request to evil.example:{port}\n" in told


@pytest.mark.parametrize("origin", ["example.com", "https://example.com/page", "https://Example.com", "https://", "*"])
def test_what_is_no_origin_is_one_line(log_path: Path, origin: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(log_path), "--foxglove", "--port", "0", "--allow-origin", origin]) == 2
    printed = capsys.readouterr().err
    assert printed.startswith(f"planfly: --allow-origin {origin}: expected the origin of a web page")
    assert printed.count("\n") == 1


def test_only_this_machine_is_served_and_a_port_in_use_is_said(
    log_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    needed("foxglove", "foxglove-sdk")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert main(["replay", str(log_path), "--foxglove", "--port", str(port)]) == 1
    printed = capsys.readouterr().err.strip()
    assert f"127.0.0.1:{port}" in printed
    assert len(printed.splitlines()) == 1
    assert main(["replay", str(log_path), "--foxglove", "--port", "0", "--wait", "0.1"]) == 2
    assert "no viewer has subscribed within 0.1 s" in capsys.readouterr().err


def test_without_the_package_it_is_one_line(
    log_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "foxglove", None)
    assert main(["replay", str(log_path), "--foxglove"]) == 2
    line = "planfly: --foxglove needs the extra 'foxglove': pip install 'planfly[foxglove]'"
    assert capsys.readouterr().err.splitlines() == [line]
