"""Limit connections to the studio that have not given a token.

Their number, lifetime and message size are limited.
"""

import asyncio
import itertools
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from planfly.studio.messages import MAX_FIRST_MESSAGE_CHARACTERS

# Lifetime of an HTTP connection, s.  The files of the page are read much faster; its websocket lasts as long as the
# page.
HTTP_LIFETIME_S = 10.0
# Maximum number of connections that have not given a token; a page has a few.
MAX_UNKNOWN_CONNECTIONS = 32
# Key in a websocket's scope of the function that allows messages of full size, called when the token has been given.
ALLOW_FULL_SIZE = "planfly.welcome"
# Counter that numbers connections in the order in which they were made.
_numbers = itertools.count()


class _UnknownConnection:
    """Connection that is unknown until it gives a token.

    If more than `MAX_UNKNOWN_CONNECTIONS` connections are unknown, the oldest is closed.

    number: position in the order of connections, or None if the connection has given a token or is ending.
    """

    connections: set[Any]
    transport: Any
    number: int | None = None

    def _register(self) -> None:
        """Register this connection as unknown; close the oldest if too many are unknown."""
        self.number = next(_numbers)
        unknown = [connection for connection in self.connections if getattr(connection, "number", None) is not None]
        if len(unknown) > MAX_UNKNOWN_CONNECTIONS:
            oldest = min(unknown, key=lambda connection: connection.number)
            oldest.number = None
            oldest.transport.abort()


class ShortLivedHttpProtocol(_UnknownConnection, H11Protocol):
    """HTTP protocol that closes its connection after `HTTP_LIFETIME_S`.

    Idle connections then do not accumulate.
    """

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Register the connection, and schedule its closing in case no websocket replaces HTTP by then."""
        super().connection_made(transport)
        self._register()
        asyncio.get_running_loop().call_later(HTTP_LIFETIME_S, self._close_if_http, transport)

    def _close_if_http(self, transport: asyncio.Transport) -> None:
        """Close the connection, unless a websocket has replaced HTTP."""
        if transport.get_protocol() is self:
            transport.abort()


class BoundedWebSocketProtocol(_UnknownConnection, WebSocketsSansIOProtocol):
    """Websocket protocol that limits the size of messages until the token is given.

    The limit is `MAX_FIRST_MESSAGE_CHARACTERS`.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._limit_messages(MAX_FIRST_MESSAGE_CHARACTERS)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Register the connection."""
        super().connection_made(transport)
        self._register()

    def handle_connect(self, event: Any) -> None:
        """Start a websocket, and add the function that allows messages of full size to its scope."""
        super().handle_connect(event)
        scope: Any = getattr(self, "scope", {})
        scope[ALLOW_FULL_SIZE] = self._allow_full_size

    def _allow_full_size(self) -> None:
        """Make the connection known, and allow messages of full size, because it has given the token."""
        self.number = None
        self._limit_messages(self.config.ws_max_size)

    def _limit_messages(self, max_size: int) -> None:
        """Set the maximum size of a received message, bytes."""
        # websockets 16 and later use the first name, earlier versions the second.
        for name in ("max_message_size", "max_size"):
            if hasattr(self.conn, name):
                setattr(self.conn, name, max_size)
