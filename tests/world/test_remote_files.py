"""A server that sends its answer byte by byte, without an end, costs a line within a bounded time."""

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import pytest

from world import remote_files
from world.errors import TerrainError
from world.remote_files import RemoteFile, find_remote

SIZE = 100_000
HEAD = f"HTTP/1.1 206 Partial Content\r\nContent-Length: {SIZE}\r\nContent-Range: bytes 0-{SIZE - 1}/{SIZE}\r\n\r\n"


@contextmanager
def dripping(head: bytes) -> Iterator[str]:
    """A server that answers with a head at once, and then with a byte each 0.02 s; the address of a file on it."""
    over = threading.Event()

    def answer(link: socket.socket) -> None:
        with closing(link), suppress(OSError):
            link.recv(4096)
            link.sendall(head)
            while not over.wait(0.02):
                link.sendall(b"x")

    def serve() -> None:
        with suppress(OSError):
            while True:
                threading.Thread(target=answer, args=(listener.accept()[0],), daemon=True).start()

    with closing(socket.create_server(("127.0.0.1", 0))) as listener:
        threading.Thread(target=serve, daemon=True).start()
        yield f"http://127.0.0.1:{listener.getsockname()[1]}/tile.tif"
        over.set()


@pytest.fixture(autouse=True)
def _short_times(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(remote_files, "_ANSWER_TIMEOUT_S", 0.3)
    monkeypatch.setattr(remote_files, "_SLOW_AFTER_S", 0.2)
    monkeypatch.setattr(remote_files, "_PAUSE", 0.0)


def test_a_body_that_drips(tmp_path: Path) -> None:
    with dripping(HEAD.encode()) as url:
        file = RemoteFile(url, SIZE, "", tmp_path / "tile.tif")
        file.copy.write_bytes(bytes(SIZE))
        begun = time.monotonic()
        with pytest.raises(TerrainError, match=r"the server sends fewer than 10,000 bytes a second$"):
            file.fetch(0, SIZE)
    assert time.monotonic() - begun < 10.0
    # What has come is kept.
    assert file.missing_parts(0, SIZE)[0][0] > 0


@pytest.mark.parametrize("head", [b"", b"HTTP/1.1 200 OK\r\nX-Long: "])
def test_a_head_that_drips(head: bytes, tmp_path: Path) -> None:
    with dripping(head) as url:
        begun = time.monotonic()
        with pytest.raises(TerrainError, match=r"cannot be reached: timed out$"):
            find_remote(url, tmp_path)
    assert time.monotonic() - begun < 10.0
