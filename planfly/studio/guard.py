"""Accept only requests from pages that the studio served, on this machine, at the printed address.

A page of any site may send requests to 127.0.0.1, and a site may point its own host name to this address. Browsers
send the site as Origin, the host name as Host, and the source of a request as Sec-Fetch-Site; no page can change these
headers. The guard precedes the whole application, including websockets.
"""

from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from typing import Any

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]
Headers = Iterable[tuple[bytes, bytes]]

HOST_NAMES = ("127.0.0.1", "localhost", "[::1]")
CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' blob: data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
# Headers that announce the body of a request.
_BODY_HEADERS = (b"content-length", b"transfer-encoding")
# Headers of every answer, including refusals.
HEADERS = (
    (b"content-security-policy", CONTENT_SECURITY_POLICY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"x-frame-options", b"DENY"),
    (b"cache-control", b"no-store"),
)


def request_refusal(scope: Scope, port: int) -> tuple[int, str]:
    """Return the HTTP status and the text with which to refuse a request; (0, "") to accept it.

    scope: description of the request by ASGI: type, method, path and headers.
    port: port of the studio.

    >>> scope = {"type": "http", "method": "GET", "path": "/", "headers": [(b"host", b"evil.test:80")]}
    >>> request_refusal(scope, 80)
    (421, 'this host is not served here')
    """
    headers = [(name.lower(), value.decode("latin-1").strip().lower()) for name, value in scope["headers"]]
    hosts, origins, sites = (
        [value for name, value in headers if name == header] for header in (b"host", b"origin", b"sec-fetch-site")
    )
    allowed_hosts = {f"{name}:{port}" for name in HOST_NAMES}
    if len(hosts) != 1 or hosts[0] not in allowed_hosts:
        return 421, "this host is not served here"
    if origins and (len(origins) > 1 or origins[0] != f"http://{hosts[0]}"):
        return 403, "requests from another page are refused"
    if scope["type"] == "websocket":
        return (0, "") if origins else (403, "a page must state its origin")
    if scope.get("method") not in ("GET", "HEAD") or any(
        name in _BODY_HEADERS and value != "0" for name, value in headers
    ):
        return 405, "only GET and HEAD without a body are answered"
    # A browser may open the page itself from any site, because the page has no data without a token.
    header_values = dict(headers)
    is_document = (
        header_values.get(b"sec-fetch-mode") == "navigate" and header_values.get(b"sec-fetch-dest") == "document"
    )
    is_page_visit = scope["path"] == "/" and is_document
    if sites and sites != ["same-origin"] and sites != ["none"] and not is_page_visit:
        return 403, "requests from another page are refused"
    return 0, ""


class Guard:
    """ASGI application that refuses a request, or forwards it to another application.

    All answers get `HEADERS`.
    """

    def __init__(self, app: App, port: int) -> None:
        """Guard an application that listens on `port`."""
        self._app, self._port = app, port

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request or websocket, or refuse it with the reason of `request_refusal`."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        status, reason = request_refusal(scope, self._port)
        if status and scope["type"] == "websocket":
            await receive()
            # Code 1008 is a policy violation (RFC 6455).
            await send({"type": "websocket.close", "code": 1008})
            return

        async def send_with_headers(message: MutableMapping[str, Any]) -> None:
            """Add the security headers to the start of a response, and send the message."""
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), *HEADERS]
            await send(message)

        if status:
            text = reason.encode()
            response_headers = [
                (b"content-type", b"text/plain; charset=utf-8"),
                (b"content-length", str(len(text)).encode()),
            ]
            # Close the connection, because the rest of a refused request is not read.
            response_headers.append((b"connection", b"close"))
            await send_with_headers({"type": "http.response.start", "status": status, "headers": response_headers})
            await send_with_headers({"type": "http.response.body", "body": text})
            return
        await self._app(scope, receive, send_with_headers)
