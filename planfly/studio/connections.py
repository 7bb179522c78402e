"""Connections to the studio: one that is no page's websocket lasts a few seconds, whatever it sends or does not."""

import asyncio

from uvicorn.protocols.http.h11_impl import H11Protocol

# s.  The page's files are read in far less, and its websocket lasts as long as the page.
LIFETIME = 10.0


class ShortLived(H11Protocol):
    """HTTP on a connection that ends after `LIFETIME`, so that silent ones leave their places to others."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin, and end in time."""
        super().connection_made(transport)
        asyncio.get_running_loop().call_later(LIFETIME, self._end, transport)

    def _end(self, transport: asyncio.Transport) -> None:
        # A websocket has another protocol.
        if transport.get_protocol() is self:
            transport.abort()
