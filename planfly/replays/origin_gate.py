"""Gate before a WebSocket server of this machine: it admits viewers and named web pages.

A page of any site may open a WebSocket to 127.0.0.1, and a site may point its own host name there.  Browsers state
both, as Origin and as Host, and no page can change these headers.
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
_HOST_NAMES = (HOST, "localhost")
# Present and former page of Foxglove, and the desktop programs of Foxglove and Lichtblick, whose pages are files.
VIEWERS = ("https://app.foxglove.dev", "https://studio.foxglove.dev", "file://")
# Longest head of a request, bytes.
_MAX_HEAD_BYTES = 16_384
# Timeout of the head of a request, s.
_HEAD_TIMEOUT_S = 10.0
# Greatest number of connections.
_MAX_CONNECTIONS = 64
# Bytes that are forwarded at a time.
_PIECE_BYTES = 65_536
# Time for pending messages to arrive when the gate closes, s.
_CLOSE_TIMEOUT_S = 0.5
# Greatest number of refusals that are reported.
_MAX_REPORTED = 16
# Greatest number of characters of a reported refusal.
_MAX_REPORTED_LENGTH = 80


def find_refusal_reason(head: bytes, port: int, allowed: Collection[str]) -> str:
    r"""Return the reason why a WebSocket request is refused; "" if it is accepted.

    head: first line and headers of the request.
    port: port at which the request arrived.
    allowed: accepted origins of web pages; a request without an origin is from a program, and is accepted.

    >>> page = b"GET / HTTP/1.1\r\nHost: 127.0.0.1:8765\r\nOrigin: https://example.com\r\n\r\n"
    >>> find_refusal_reason(page, 8765, VIEWERS), find_refusal_reason(page, 8765, ["https://example.com"])
    ('a page of https://example.com', '')
    """
    try:
        headers = http.client.parse_headers(io.BytesIO(head.partition(b"\r\n")[2]))
    except http.client.HTTPException:
        return "not a valid request"
    hosts, origins = headers.get_all("Host", []), headers.get_all("Origin", [])
    if [host.strip().lower() for host in hosts] not in [[f"{name}:{port}"] for name in _HOST_NAMES]:
        return f"a request to {_format_header(hosts)}"
    if origins and [origin.strip() for origin in origins] not in [[allowed_origin] for allowed_origin in allowed]:
        return f"a page of {_format_header(origins)}"
    return ""


def _format_header(values: list[str]) -> str:
    """Return the values of a header as a short text without control characters; "no host" without values."""
    return ascii(", ".join(values))[1:-1][:_MAX_REPORTED_LENGTH] or "no host"


class OriginGate:
    """Listener on a port of this machine that forwards accepted connections to a server behind it."""

    def __init__(self, port: int, allowed: Collection[str], on_refused: Callable[[str], None]) -> None:
        """Open the port of the gate; connections wait until `start_forwarding`.

        port: port number; 0 for any free port.
        allowed: origins of web pages that are accepted.
        on_refused: called, from another thread, with each new `find_refusal_reason`.
        Raises OSError for a port in use.
        """
        try:
            self._socket = socket.create_server((HOST, port))
        except OSError as error:
            raise OSError(error.errno, error.strerror, f"{HOST}:{port}") from error
        self.port = int(self._socket.getsockname()[1])
        self._allowed, self._on_refused = frozenset(allowed), on_refused
        self._reported: set[str] = set()
        self._connections: set[asyncio.Task[None]] = set()
        self._thread = threading.Thread(target=self._run_loop, name="origin gate", daemon=True)
        self._closed = asyncio.Event()

    def start_forwarding(self, port: int, certificate: Certificate) -> None:
        """Start forwarding accepted connections to a TLS server on this machine.

        port: port of the server.
        certificate: certificate of the server, which no browser trusts.
        """
        self._server_port = port
        self._tls = ssl.create_default_context(cadata=certificate.certificate)
        self._loop = asyncio.new_event_loop()
        self._thread.start()

    def close(self) -> None:
        """Forward pending messages, and close all connections; stop the server first."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._closed.set)
            self._thread.join(2.0 * _CLOSE_TIMEOUT_S)
        self._socket.close()

    def _run_loop(self) -> None:
        """Run the event loop in the gate's thread until the gate is closed."""
        with contextlib.closing(self._loop):
            self._loop.run_until_complete(self._serve_until_closed())

    async def _serve_until_closed(self) -> None:
        """Accept connections until the gate is closed, then wait for open connections to end."""
        server = await asyncio.start_server(self._accept_connection, sock=self._socket, limit=_MAX_HEAD_BYTES)
        await self._closed.wait()
        server.close()
        if self._connections:
            _, open_connections = await asyncio.wait(self._connections, timeout=_CLOSE_TIMEOUT_S)
            for connection in open_connections:
                connection.cancel()
            await asyncio.gather(*open_connections, return_exceptions=True)

    def _accept_connection(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve a new connection, or close it if there are too many."""
        if len(self._connections) >= _MAX_CONNECTIONS:
            writer.close()
            return
        connection = self._loop.create_task(self._serve_connection(reader, writer))
        self._connections.add(connection)
        connection.add_done_callback(self._connections.discard)

    async def _serve_connection(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Read the head of a request.

        Refuse the request, or forward all data between the client and the server.
        """
        with contextlib.closing(writer), contextlib.suppress(OSError, asyncio.IncompleteReadError):
            try:
                head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), _HEAD_TIMEOUT_S)
            except asyncio.LimitOverrunError:
                return
            reason = find_refusal_reason(head, self.port, self._allowed)
            if reason:
                # Each reason is reported once.
                if reason not in self._reported and len(self._reported) < _MAX_REPORTED:
                    self._reported.add(reason)
                    self._on_refused(reason)
                writer.write(b"HTTP/1.1 403 Forbidden\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
                await writer.drain()
                return
            server = asyncio.open_connection(HOST, self._server_port, ssl=self._tls, server_hostname="localhost")
            server_reader, server_writer = await server
            server_writer.write(head)
            await asyncio.gather(_forward_data(reader, server_writer), _forward_data(server_reader, writer))


async def _forward_data(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Forward data from a reader to a writer until the end, then close the writer."""
    with contextlib.closing(writer), contextlib.suppress(OSError):
        while piece := await reader.read(_PIECE_BYTES):
            writer.write(piece)
            await writer.drain()
