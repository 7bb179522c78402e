"""Parts of a file on a web server, kept on this machine: what was fetched once is not fetched again.

The copy has the file's full size and holes where nothing was fetched yet; which bytes it holds stands in a file beside
it.  A part counts when as many bytes have come as were asked for, of the version of the file that was met first.

GDAL can read such files itself (``/vsicurl``), and does not take the place of this: it keeps nothing for the next
command, does not tell that a file has changed, and does not end with Ctrl-C while a server is silent.
"""

import http.client
import json
import os
import tempfile
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from hashlib import sha256
from pathlib import Path

from world.errors import TerrainError
from world.files import write_whole

# s without an answer; tries of a request, and the pause before the second, which doubles.
_PATIENCE = 30.0
_TRIES = 3
_PAUSE = 0.5
# Bytes that are written at a time.
_AT_ONCE = 2**18
# A file is refused beyond this, bytes: a tile of GLO-30 has some 40 MB.
MAX_BYTES = 2**29
# Answers of a server that say that there is no such file.  403 is none: a proxy or a limit of requests says so, too.
_ABSENT = (404, 410)
# Of these a server may have recovered the next time.
_PASSING = (408, 425, 429, 500, 502, 503, 504)

Fetched = Callable[[int], None]


class _Unfinished(Exception):
    """An answer that is not what was asked for; the text says how."""


@dataclass(slots=True)
class RemoteFile:
    """A file on a server, and its copy.

    size: bytes.  version: its ETag, or when it was changed; "" where the server says neither.
    held: parts of the copy that are there, [begin, end), and the SHA-256 of each.
    """

    url: str
    size: int
    version: str
    copy: Path
    held: dict[tuple[int, int], str] = field(default_factory=dict)

    def missing(self, begin: int, end: int) -> list[tuple[int, int]]:
        """Return parts of [begin, end) that are not there yet.

        >>> RemoteFile("", 100, "", Path("a"), {(10, 20): "", (30, 40): ""}).missing(15, 50)
        [(20, 30), (40, 50)]
        """
        found = []
        for low, high in [*sorted(self.held), (end, end)]:
            if low > begin:
                found.append((begin, min(low, end)))
            begin = max(begin, high)
            if begin >= end:
                break
        return [(low, high) for low, high in found if low < high]

    def fetch(self, begin: int, end: int, fetched: Fetched = lambda _: None) -> None:
        """Have [begin, end) in the copy.  fetched: told of bytes as they come.  Raises TerrainError."""
        for low, high in self.missing(begin, min(end, self.size)):
            for attempt in range(_TRIES):
                try:
                    self._get(low, high, fetched)
                    break
                except (_Unfinished, OSError, ValueError, http.client.HTTPException) as error:
                    if attempt == _TRIES - 1 or not _may_pass(error):
                        raise TerrainError(f"{self.url}: cannot be fetched: {_why(error)}", file=self.url) from error
                    time.sleep(_PAUSE * 2.0**attempt)

    def _get(self, begin: int, end: int, fetched: Fetched) -> None:
        headers = {"Range": f"bytes={begin}-{end - 1}"} | ({"If-Range": self.version} if self.version else {})
        with _open(self.url, headers) as answer:
            if answer.status == 200:
                # A server that gives no parts gives all; one whose file has changed, too.
                if _length(answer) != self.size or _version(answer) != self.version:
                    raise _Unfinished("it has changed since it was begun: try again")
                begin, end = 0, self.size
            elif answer.headers.get("Content-Range") != f"bytes {begin}-{end - 1}/{self.size}":
                raise _Unfinished(f"the server answers with {answer.headers.get('Content-Range')!r}")
            with self.copy.open("r+b") as file:
                file.seek(begin)
                at, digest = begin, sha256()
                while at < end and (part := answer.read(min(_AT_ONCE, end - at))):
                    file.write(part)
                    digest.update(part)
                    at += len(part)
                    fetched(len(part))
                file.flush()
                # What is noted as there is there, also after a power cut.
                os.fsync(file.fileno())
            if at > begin:
                self.held[begin, at] = digest.hexdigest()
                write_whole(_notes(self.copy), json.dumps([[*part, text] for part, text in self.held.items()]))
            if at < end:
                raise _Unfinished(f"{at - begin:,} of {end - begin:,} bytes came")

    def forget(self) -> None:
        """Begin again with an empty copy.  Raises OSError."""
        _notes(self.copy).unlink(missing_ok=True)
        self.held = {}
        # A file of its own, so that another process that reads the old one keeps that.
        with tempfile.NamedTemporaryFile(dir=self.copy.parent, delete=False) as file:
            os.truncate(file.fileno(), self.size)
        Path(file.name).replace(self.copy)


def find_remote(url: str, folder: Path) -> RemoteFile | None:
    """Return a file on a server and what the cache has of it; None where the server has no such file.

    Raises TerrainError where the server cannot be reached, and OSError where the cache cannot be written.
    """
    answer: http.client.HTTPResponse | None = None
    for attempt in range(_TRIES):
        try:
            with _open(url, {}, "HEAD") as answer:
                size, version = _length(answer), _version(answer)
            break
        except urllib.error.HTTPError as error:
            if error.code in _ABSENT:
                return None
            if attempt == _TRIES - 1 or not _may_pass(error):
                raise TerrainError(f"{url}: cannot be fetched: {_why(error)}", file=url) from error
        except (OSError, ValueError, http.client.HTTPException) as error:
            if attempt == _TRIES - 1 or not _may_pass(error):
                raise TerrainError(f"{url}: cannot be reached: {_why(error)}", file=url) from error
        time.sleep(_PAUSE * 2.0**attempt)
    if not 0 < size <= MAX_BYTES:
        allowed = f"1 to {MAX_BYTES:,} bytes are expected"
        raise TerrainError.at(url, "Content-Length", size, allowed, shown=f"{size:,}")
    key = sha256(f"{url}\0{version}\0{size}".encode()).hexdigest()[:16]
    copy = folder / key / url.rpartition("/")[2]
    copy.parent.mkdir(parents=True, exist_ok=True)
    found = RemoteFile(url, size, version, copy)
    if not (copy.is_file() and copy.stat().st_size == size):
        found.forget()
    found.held = _read_notes(copy, size)
    return found


def _open(url: str, headers: dict[str, str], method: str = "GET") -> http.client.HTTPResponse:
    request = urllib.request.Request(url, headers={"User-Agent": "planfly"} | headers, method=method)
    return _opener().open(request, timeout=_PATIENCE)


@cache
def _opener() -> urllib.request.OpenerDirector:
    """Return what speaks http and https, wherever it is led, and nothing else."""
    opener = urllib.request.OpenerDirector()
    for handler in (
        urllib.request.ProxyHandler,
        urllib.request.UnknownHandler,
        urllib.request.HTTPHandler,
        urllib.request.HTTPSHandler,
        urllib.request.HTTPRedirectHandler,
        urllib.request.HTTPDefaultErrorHandler,
        urllib.request.HTTPErrorProcessor,
    ):
        opener.add_handler(handler())
    return opener


def is_address(text: str) -> bool:
    """Return True if a text is the http or https address of a folder on a web server.

    >>> is_address("HTTPS://example.com:8443/tiles"), is_address("http://[::1/"), is_address("http://a/?b")
    (True, False, False)
    """
    try:
        parts = urllib.parse.urlsplit(text)
        named = bool(parts.hostname) and (parts.port is None or parts.port > 0)
        (parts.hostname or "").encode("idna")
    except ValueError:
        return False
    plain = text.isascii() and text.isprintable() and " " not in text and "?" not in text and "#" not in text
    return plain and named and parts.scheme in ("http", "https")


def _length(answer: http.client.HTTPResponse) -> int:
    stated = answer.headers.get("Content-Length", "")
    return int(stated) if stated.isdecimal() else 0


def _version(answer: http.client.HTTPResponse) -> str:
    tag = str(answer.headers.get("ETag") or "")
    # A weak tag may stand for other bytes, and does not go with parts.
    return tag if tag and not tag.startswith("W/") else str(answer.headers.get("Last-Modified") or "")


def _may_pass(error: Exception) -> bool:
    return not isinstance(error, urllib.error.HTTPError) or error.code in _PASSING


def _why(error: Exception) -> str:
    if isinstance(error, urllib.error.HTTPError):
        return f"the server answers {error.code} {error.reason}"
    reason = getattr(error, "reason", None) or error
    return " ".join(str(getattr(reason, "strerror", None) or reason).split()) or type(error).__name__


def _notes(copy: Path) -> Path:
    return copy.with_name(copy.name + ".held")


def _read_notes(copy: Path, size: int) -> dict[tuple[int, int], str]:
    """Return parts that a copy holds as they were fetched; none where the note of them is damaged."""
    try:
        noted = json.loads(_notes(copy).read_text(encoding="ascii"))
        parts = {(int(low), int(high)): str(digest) for low, high, digest in noted}
    except (OSError, ValueError, TypeError, OverflowError):
        return {}
    with copy.open("rb") as file:

        def is_whole(low: int, high: int, digest: str) -> bool:
            if not 0 <= low < high <= size:
                return False
            file.seek(low)
            return sha256(file.read(high - low)).hexdigest() == digest

        return {(low, high): digest for (low, high), digest in parts.items() if is_whole(low, high, digest)}
