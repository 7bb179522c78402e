"""A studio that serves in a thread of the test, and pages that are programs."""

import contextlib
import json
import queue
import re
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

import planfly

PATIENCE = 60.0


class Served:
    """A running studio. address: of its page, with the token."""

    def __init__(self, address: str) -> None:
        self.address = address
        self.port = int(re.findall(r":(\d+)/", address)[0])
        self.token = address.partition("#t=")[2]

    def socket(self, **more: Any) -> ClientConnection:
        """A websocket that has not said its token."""
        own = f"http://127.0.0.1:{self.port}"
        return connect(f"ws://127.0.0.1:{self.port}/session", **({"origin": own, "max_size": None} | more))

    @contextlib.contextmanager
    def page(self) -> Iterator["PageProgram"]:
        with self.socket() as socket:
            page = PageProgram(socket)
            page.send(kind="hello", token=self.token)
            yield page


class PageProgram:
    """What a page does, by a program."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.rev = 0

    def send(self, **message: Any) -> None:
        self.socket.send(json.dumps(message))

    def until(self, kind: str, **wanted: Any) -> dict[str, Any]:
        """The next message of a kind that has these values."""
        deadline = time.monotonic() + PATIENCE
        while True:
            data = self.socket.recv(timeout=max(0.01, deadline - time.monotonic()))
            if isinstance(data, bytes):
                continue
            message: dict[str, Any] = json.loads(data)
            self.rev = max(self.rev, message.get("rev", 0)) if message["kind"] == "sheet" else self.rev
            if message["kind"] == kind and all(message.get(name) == value for name, value in wanted.items()):
                return message


@contextlib.contextmanager
def served(what: str | Path, **more: Any) -> Iterator[Served]:
    """A studio of a mission, until the block ends."""
    said: queue.SimpleQueue[str] = queue.SimpleQueue()
    ended = threading.Event()
    faults: list[BaseException] = []

    def run() -> None:
        try:
            planfly.open_studio(what, browser=False, stop=ended.is_set, on_message=said.put, **({"port": 0} | more))
        except BaseException as error:  # the test that waits is to see it
            faults.append(error)
            said.put("")

    thread = threading.Thread(target=run)
    thread.start()
    try:
        line = ""
        while "#t=" not in line:
            line = said.get(timeout=PATIENCE)
            if faults:
                raise faults[0]
        yield Served(line.split()[-1])
    finally:
        ended.set()
        thread.join(30.0)
    assert not thread.is_alive()
