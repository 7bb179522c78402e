"""Parts of a file on a web server, kept on this machine: what was fetched once is not fetched again.

The copy has the file's full size and holes where nothing was fetched yet; which bytes it holds stands in a file beside
it.  A part counts when as many bytes have come as were asked for, of the version of the file that was met first.
"""

import http.client
import json
import os
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path

from world.errors import TerrainError
from world.files import write_whole

# s without an answer; tries of a request, and the pause before the second, which doubles.
_PATIENCE, _TRIES, _PAUSE = 30.0, 3, 0.5
# Bytes that are written at a time.
_AT_ONCE = 2**18
# Answers of a server that say that there is no such file; Amazon's storage says 403 to those who may not list it.
_ABSENT = (403, 404, 410)
# Of these a server may have recovered the next time.
_PASSING = (408, 425, 429, 500, 502, 503, 504)

Fetched = Callable[[int], None]


class _Unfinished(Exception):
    """An answer that is not what was asked for; the text says how."""


@dataclass(slots=True)
class RemoteFile:
    """A file on a server, and its copy.

    size: bytes.  version: its ETag, or when it was changed; "" where the server says neither.
    held: parts of the copy that are there, [begin, end), in order and apart.
    """

    url: str
    size: int
    version: str
    copy: Path
    held: list[tuple[int, int]] = field(default_factory=list)

    def missing(self, begin: int, end: int) -> list[tuple[int, int]]:
        """Parts of [begin, end) that are not there yet.

        >>> RemoteFile("", 100, "", Path("a"), [(10, 20), (30, 40)]).missing(15, 50)
        [(20, 30), (40, 50)]
        """
        found = []
        for low, high in [*self.held, (end, end)]:
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
                except (_Unfinished, OSError, http.client.HTTPException) as error:
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
                at = begin
                while at < end and (part := answer.read(min(_AT_ONCE, end - at))):
                    file.write(part)
                    at += len(part)
                    fetched(len(part))
            if at < end:
                self._hold(begin, at)
                raise _Unfinished(f"{at - begin:,} of {end - begin:,} bytes came")
        self._hold(begin, end)

    def _hold(self, begin: int, end: int) -> None:
        parts: list[tuple[int, int]] = []
        for low, high in sorted([*self.held, (begin, end)]):
            if parts and low <= parts[-1][1]:
                parts[-1] = (parts[-1][0], max(high, parts[-1][1]))
            elif low < high:
                parts.append((low, high))
        self.held = parts
        write_whole(_notes(self.copy), json.dumps(self.held))


def find_remote(url: str, cache: Path) -> RemoteFile | None:
    """A file on a server and what the cache has of it; None where the server has no such file.

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
        except (OSError, http.client.HTTPException) as error:
            if attempt == _TRIES - 1 or not _may_pass(error):
                raise TerrainError(f"{url}: cannot be reached: {_why(error)}", file=url) from error
        time.sleep(_PAUSE * 2.0**attempt)
    if size <= 0:
        raise TerrainError(f"{url}: the server does not say how large it is", file=url)
    key = sha256(f"{url}\0{version}\0{size}".encode()).hexdigest()[:16]
    copy = cache / key / url.rpartition("/")[2]
    copy.parent.mkdir(parents=True, exist_ok=True)
    found = RemoteFile(url, size, version, copy)
    if copy.is_file() and copy.stat().st_size == size:
        found.held = _read_notes(copy, size)
    else:
        with copy.open("wb") as file:
            os.truncate(file.fileno(), size)
    return found


def _open(url: str, headers: dict[str, str], method: str = "GET") -> http.client.HTTPResponse:
    request = urllib.request.Request(url, headers={"User-Agent": "planfly"} | headers, method=method)
    answer: http.client.HTTPResponse = urllib.request.urlopen(request, timeout=_PATIENCE)
    return answer


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


def _read_notes(copy: Path, size: int) -> list[tuple[int, int]]:
    """Parts that a copy is known to hold; none where the note of them is damaged."""
    try:
        parts = [(int(low), int(high)) for low, high in json.loads(_notes(copy).read_text(encoding="ascii"))]
    except (OSError, ValueError, TypeError):
        return []
    ordered = all(low < high <= size for low, high in parts) and parts == sorted(parts)
    return parts if ordered and all(low >= 0 for low, _ in parts) else []
