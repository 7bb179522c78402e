"""The gate before a WebSocket server: who is let in, and that what is let in goes through byte by byte."""

import contextlib
import os
import socket
import ssl
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from planfly.replays.certificates import make_temporary_certificate
from planfly.replays.origin_gate import VIEWERS, OriginGate, find_refusal_reason


def asked(*headers: str) -> bytes:
    return "\r\n".join(["GET / HTTP/1.1", *headers, "", ""]).encode("latin-1")


LOCAL = "Host: 127.0.0.1:8765"


@pytest.mark.parametrize(
    "headers",
    [
        (LOCAL,),
        ("Host: localhost:8765",),
        ("host: LOCALHOST:8765 ",),
        (LOCAL, "Origin: https://app.foxglove.dev"),
        (LOCAL, "origin: file://"),
    ],
)
def test_viewers_and_programs_are_let_in(headers: tuple[str, ...]) -> None:
    assert find_refusal_reason(asked(*headers), 8765, VIEWERS) == ""


@pytest.mark.parametrize(
    ("headers", "why"),
    [
        ((), "a request to no host"),
        (("Host: 127.0.0.1",), "a request to 127.0.0.1"),
        (("Host: 127.0.0.1:8766",), "a request to 127.0.0.1:8766"),
        (("Host: evil.example:8765",), "a request to evil.example:8765"),
        ((LOCAL, "Host: evil.example"), "a request to 127.0.0.1:8765, evil.example"),
        ((LOCAL, "Origin: https://evil.example"), "a page of https://evil.example"),
        ((LOCAL, "Origin: http://app.foxglove.dev"), "a page of http://app.foxglove.dev"),
        ((LOCAL, "Origin: https://app.foxglove.dev:444"), "a page of https://app.foxglove.dev:444"),
        ((LOCAL, "Origin: null"), "a page of null"),
        ((LOCAL, "Origin: file://", "Origin: https://evil.example"), "a page of file://, https://evil.example"),
        # Nothing that a terminal would take for an order.
        ((LOCAL, "Origin: \x1b[2J"), "a page of \\x1b[2J"),
        ((LOCAL, "Origin: " + "x" * 500), "a page of " + "x" * 80),
        (("X: y",) * 500, "not a valid request"),
    ],
)
def test_pages_of_others_and_other_hosts_are_refused(headers: tuple[str, ...], why: str) -> None:
    assert find_refusal_reason(asked(*headers), 8765, VIEWERS) == why


@contextlib.contextmanager
def gated(folder: Path) -> Iterator[tuple[OriginGate, list[str]]]:
    """A gate before a server that sends back, through TLS, all that comes to it."""
    certificate = make_temporary_certificate()
    (folder / "cert").write_text(certificate.certificate)
    (folder / "key").write_text(certificate.key)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(folder / "cert", folder / "key")

    def echo(plain: socket.socket) -> None:
        with contextlib.suppress(OSError), context.wrap_socket(plain, server_side=True) as stream:
            while data := stream.recv(4096):
                stream.sendall(data)

    def serve() -> None:
        with contextlib.suppress(OSError):
            while True:
                threading.Thread(target=echo, args=(behind.accept()[0],), daemon=True).start()

    refused: list[str] = []
    with socket.create_server(("127.0.0.1", 0)) as behind:
        threading.Thread(target=serve, daemon=True).start()
        gate = OriginGate(0, VIEWERS, refused.append)
        gate.start_forwarding(behind.getsockname()[1], certificate)
        try:
            yield gate, refused
        finally:
            gate.close()


def heard(stream: socket.socket, count: int) -> bytes:
    """So many bytes of a stream, or fewer where it ends before."""
    stream.settimeout(120.0)
    data = b""
    while len(data) < count and (piece := stream.recv(65_536)):
        data += piece
    return data


def test_what_is_let_in_goes_through_both_ways_byte_by_byte(tmp_path: Path) -> None:
    with gated(tmp_path) as (gate, refused):
        said = asked(f"Host: 127.0.0.1:{gate.port}") + os.urandom(2_000_000)
        with socket.create_connection(("127.0.0.1", gate.port)) as stream:
            sender = threading.Thread(target=stream.sendall, args=(said,))
            sender.start()
            assert heard(stream, len(said)) == said
            sender.join()
        assert refused == []


def test_who_is_refused_hears_403_and_reaches_nothing(tmp_path: Path) -> None:
    with gated(tmp_path) as (gate, refused):
        for _ in range(3):
            with socket.create_connection(("127.0.0.1", gate.port)) as stream:
                stream.sendall(asked(f"Host: 127.0.0.1:{gate.port}", "Origin: https://evil.example"))
                assert heard(stream, 10_000).startswith(b"HTTP/1.1 403 ")
        assert refused == ["a page of https://evil.example"]


def test_noise_and_crowds_end_nothing(tmp_path: Path) -> None:
    """A head without end, half a request, and more connections at a time than are taken."""
    with gated(tmp_path) as (gate, refused):
        for noise in (b"x" * 100_000, b"\0" * 10 + b"\r\n\r\n", b"GET / HT"):
            with socket.create_connection(("127.0.0.1", gate.port)) as stream, contextlib.suppress(OSError):
                stream.sendall(noise)
                stream.shutdown(socket.SHUT_WR)
                assert not heard(stream, 10_000).startswith(b"HTTP/1.1 1")
        with contextlib.ExitStack() as crowd:
            for _ in range(200):
                crowd.enter_context(socket.create_connection(("127.0.0.1", gate.port)))
        said = asked(f"Host: localhost:{gate.port}")
        for _ in range(100):
            # Until those that have gone are noticed.
            with socket.create_connection(("127.0.0.1", gate.port)) as stream, contextlib.suppress(ConnectionError):
                stream.sendall(said)
                if heard(stream, len(said)) == said:
                    break
        else:
            raise AssertionError("nobody is let in any more")
        assert refused == ["a request to no host"]


def test_a_port_in_use_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(OSError, match=r"in use.*127\.0\.0\.1:" + str(port)):
            OriginGate(port, (), lambda _: None)
