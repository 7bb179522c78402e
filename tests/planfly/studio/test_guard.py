"""Who is let in: pages of this machine by its own names, and nobody else."""

import itertools

import pytest

from planfly.studio.guard import request_refusal

PORT = 8790
OWN, ORIGIN = "127.0.0.1:8790", "http://127.0.0.1:8790"


def asked(kind: str = "http", method: str = "GET", path: str = "/", **headers: str | list[str]) -> int:
    rows = []
    for name, value in headers.items():
        values = [value] if isinstance(value, str) else value
        rows += [(name.replace("_", "-").encode(), one.encode("latin-1")) for one in values]
    return request_refusal({"type": kind, "method": method, "path": path, "headers": rows}, PORT)[0]


@pytest.mark.parametrize("host", [OWN, "localhost:8790", "[::1]:8790", "LOCALHOST:8790"])
def test_own_pages_are_let_in(host: str) -> None:
    assert asked(host=host) == 0
    assert asked(host=host, origin=f"http://{host.lower()}", sec_fetch_site="same-origin") == 0
    assert asked("websocket", path="/session", host=host, origin=f"http://{host}") == 0
    assert asked(method="HEAD", host=host, sec_fetch_site="none") == 0


def test_a_person_may_walk_in_from_a_file() -> None:
    walk = {"sec_fetch_site": "cross-site", "sec_fetch_mode": "navigate", "sec_fetch_dest": "document"}
    assert asked(host=OWN, **walk) == 0
    assert asked(host=OWN, path="/studio.js", **walk) == 403
    assert asked(host=OWN, **(walk | {"sec_fetch_dest": "iframe"})) == 403


# Each of these is refused, asked for a page or for the websocket: 200 in all.
HOSTS = [
    "",
    "127.0.0.1",
    "127.0.0.1:8791",
    "evil.test:8790",
    "127.0.0.1.evil.test:8790",
    "0.0.0.0:8790",
    "127.0.0.1:8790@x",
]
ORIGINS = ["null", "http://evil.test", "https://127.0.0.1:8790", "http://127.0.0.1", "http://127.0.0.1:8791"]
ORIGINS += ["http://127.0.0.1:8790/", "file://", "http://127.0.0.1:8790.evil.test", "", "http://localhost:8790"]
METHODS = ["POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "CONNECT", "get"]
PATHS = ["/", "/session", "/studio.js", "/../etc/passwd"]
REFUSED = [
    *({"kind": kind, "path": path, "host": host} for kind in ("http", "websocket") for path in PATHS for host in HOSTS),
    *(
        {"kind": kind, "path": path, "host": OWN, "origin": origin}
        for kind in ("http", "websocket")
        for path in PATHS
        for origin in ORIGINS
    ),
    *({"method": method, "path": path, "host": OWN} for method in METHODS for path in PATHS),
    *({"path": path, "host": [OWN, "evil.test"]} for path in PATHS),
    *({"path": path, "host": OWN, "origin": [ORIGIN, "http://evil.test"]} for path in PATHS),
    *({"kind": "websocket", "path": path, "host": OWN} for path in PATHS),
    *({"path": path, "host": OWN, "content_length": str(2**30)} for path in PATHS),
    *({"path": path, "host": OWN, "transfer_encoding": "chunked"} for path in PATHS),
    *(
        {"path": path, "host": OWN, "sec_fetch_site": site}
        for path, site in itertools.product(PATHS, ["cross-site", "same-site", "other"])
    ),
    {"kind": "websocket", "path": "/session", "host": OWN, "origin": ORIGIN.replace("http", "ws")},
]


def test_two_hundred_others_are_refused() -> None:
    through = [case for case in REFUSED if asked(**case) == 0]  # type: ignore[arg-type]
    assert not through
    assert len(REFUSED) >= 200
