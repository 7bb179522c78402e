"""Connections to the studio: all except websockets of pages are closed after a few seconds."""

import asyncio

from uvicorn.protocols.http.h11_impl import H11Protocol

# Lifetime of a connection, s.  The files of the page are read in far less; its websocket lasts as long as the page.
LIFETIME = 10.0


class ShortLived(H11Protocol):
    """HTTP on a connection that ends after `LIFETIME`, so that silent ones leave their places to others."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin a connection, and schedule its end."""
        super().connection_made(transport)
        asyncio.get_running_loop().call_later(LIFETIME, self._end, transport)

    def _end(self, transport: asyncio.Transport) -> None:
        # A websocket has replaced the protocol, and stays.
        if transport.get_protocol() is self:
            transport.abort()
