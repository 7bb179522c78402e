"""A gate before a WebSocket server of this machine: viewers get through, and web pages that are known by name.

A page of any site may open a WebSocket to 127.0.0.1, and a site may point a name of its own there.  Browsers state
both, as Origin and as Host, and no page can change what they state.
"""

import asyncio
import contextlib
import http.client
import io
import socket
import ssl
import threading
from collections.abc import Callable, Collection

from planfly.replays.certificates import Certificate

HOST = "127.0.0.1"
_NAMES = (HOST, "localhost")
# Foxglove's page, today's and the former; and the desktop programs, Foxglove's and Lichtblick's, whose pages are files.
VIEWERS = ("https://app.foxglove.dev", "https://studio.foxglove.dev", "file://")
# Bytes of a request's head, s until it has come, connections at a time, bytes that are passed on at once.
_LONGEST_HEAD, _PATIENCE, _AT_ONCE, _PIECE = 16_384, 10.0, 64, 65_536
# s.  What is under way when the gate closes has this long to arrive.
_CLOSING = 0.5
# How many refusals are reported, and how many characters of each.
_MAX_REPORTED, _MAX_REPORTED_LENGTH = 16, 80


def refusal(head: bytes, port: int, allowed: Collection[str]) -> str:
    r"""Why a WebSocket request is not let in, in words; "" for one that is.

    head: its first line and headers.  port: where it came in.  allowed: origins of pages; a program that is no browser
    states none, and is let in.

    >>> page = b"GET / HTTP/1.1\r\nHost: 127.0.0.1:8765\r\nOrigin: https://example.com\r\n\r\n"
    >>> refusal(page, 8765, VIEWERS), refusal(page, 8765, ["https://example.com"])
    ('a page of https://example.com', '')
    """
    try:
        headers = http.client.parse_headers(io.BytesIO(head.partition(b"\r\n")[2]))
    except http.client.HTTPException:
        return "a request that is none"
    hosts, origins = headers.get_all("Host", []), headers.get_all("Origin", [])
    if [host.strip().lower() for host in hosts] not in [[f"{name}:{port}"] for name in _NAMES]:
        return f"a request to {_shown(hosts)}"
    if origins and [origin.strip() for origin in origins] not in [[one] for one in allowed]:
        return f"a page of {_shown(origins)}"
    return ""


def _shown(values: list[str]) -> str:
    """Values of a header, for a terminal: nothing in them moves its cursor."""
    return ascii(", ".join(values))[1:-1][:_MAX_REPORTED_LENGTH] or "no host"


class OriginGate:
    """Listens on a port of this machine, and passes who may to a server behind it."""

    def __init__(self, port: int, allowed: Collection[str], on_refused: Callable[[str], None]) -> None:
        """Take the port, 0 for any that is free.

        allowed: origins of pages that are let in.
        on_refused: called, from another thread, with each `refusal` that is new.
        Raises OSError for a port in use.
        """
        try:
            self._socket = socket.create_server((HOST, port))
        except OSError as error:
            raise OSError(error.errno, error.strerror, f"{HOST}:{port}") from error
        self.port = int(self._socket.getsockname()[1])
        self._allowed, self._on_refused = frozenset(allowed), on_refused
        self._told: set[str] = set()
        self._meetings: set[asyncio.Task[None]] = set()
        self._thread = threading.Thread(target=self._run, name="origin gate", daemon=True)
        self._over = asyncio.Event()

    def open(self, port: int, certificate: Certificate) -> None:
        """Begin to pass on to a server that speaks TLS with this certificate: no browser trusts it."""
        self._behind = port
        self._tls = ssl.create_default_context(cadata=certificate.certificate)
        self._loop = asyncio.new_event_loop()
        self._thread.start()

    def close(self) -> None:
        """Pass on what is under way, and end.  The server behind has closed its connections before."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._over.set)
            self._thread.join(2.0 * _CLOSING)
        self._socket.close()

    def _run(self) -> None:
        with contextlib.closing(self._loop):
            self._loop.run_until_complete(self._serve())

    async def _serve(self) -> None:
        server = await asyncio.start_server(self._met, sock=self._socket, limit=_LONGEST_HEAD)
        await self._over.wait()
        server.close()
        if self._meetings:
            _, left = await asyncio.wait(self._meetings, timeout=_CLOSING)
            for meeting in left:
                meeting.cancel()
            await asyncio.gather(*left, return_exceptions=True)

    def _met(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._meetings) >= _AT_ONCE:
            writer.close()
            return
        meeting = self._loop.create_task(self._meet(reader, writer))
        self._meetings.add(meeting)
        meeting.add_done_callback(self._meetings.discard)

    async def _meet(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Hear what somebody asks, and refuse it or pass everything on, both ways."""
        with contextlib.closing(writer), contextlib.suppress(OSError, asyncio.IncompleteReadError):
            try:
                head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), _PATIENCE)
            except asyncio.LimitOverrunError:
                return
            why = refusal(head, self.port, self._allowed)
            if why:
                self._tell(why)
                writer.write(b"HTTP/1.1 403 Forbidden\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
                await writer.drain()
                return
            behind = asyncio.open_connection(HOST, self._behind, ssl=self._tls, server_hostname="localhost")
            inward, outward = await behind
            outward.write(head)
            await asyncio.gather(_pass_on(reader, outward), _pass_on(inward, writer))

    def _tell(self, why: str) -> None:
        if why not in self._told and len(self._told) < _MAX_REPORTED:
            self._told.add(why)
            self._on_refused(why)


async def _pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Pass all that comes to the other end, and tell that when no more does."""
    with contextlib.closing(writer), contextlib.suppress(OSError):
        while piece := await reader.read(_PIECE):
            writer.write(piece)
            await writer.drain()
