"""Fetch parts of a file on a web server, and keep them on this machine.

Each part is fetched only once.

The copy has the full size of the file, with holes for parts that are not fetched yet; a notes file next to it lists the
bytes that it contains.  A part is complete when all requested bytes have arrived, from the version of the file that was
found first.

GDAL can read such files itself (``/vsicurl``), but cannot replace this module: it keeps nothing for the next
command, does not report that a file has changed, and does not stop on Ctrl-C while a server is silent.
"""

import contextlib
import http.client
import json
import os
import socket
import tempfile
import threading
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
from world.files import write_atomically

# Timeout for an answer, s.
_ANSWER_TIMEOUT_S = 30.0
# Lowest speed of an answer, bytes per second.
_MIN_BYTES_PER_S = 10_000.0
# Time after which the speed is measured, s.
_SLOW_AFTER_S = 10.0
# Number of attempts of a request.
_MAX_ATTEMPTS = 3
# Pause before the second attempt, s; it doubles with each further attempt.
_PAUSE = 0.5
# Number of bytes written in one step.
_CHUNK_BYTES = 2**18
# Largest size of a file, bytes; larger files are rejected.  A GLO-30 tile has about 40 MB.
MAX_BYTES = 2**29
# Status codes that mean that there is no such file; not 403, which proxies and request limits send, too.
_ABSENT_STATUSES = (404, 410)
# Status codes of temporary errors: the next attempt may succeed.
_TEMPORARY_STATUSES = (408, 425, 429, 500, 502, 503, 504)

OnBytes = Callable[[int], None]


class _IncompleteAnswer(Exception):
    """Error for an answer that does not contain the requested bytes; the message states the reason."""


@dataclass(slots=True)
class RemoteFile:
    """File on a server, and its copy on this machine, which may be incomplete.

    size: size in bytes.
    version: its ETag or its time of change; "" if the server states neither.
    copy: path of the copy.
    parts: SHA-256 of each part that the copy contains, keyed by its bytes [begin, end).
    """

    url: str
    size: int
    version: str
    copy: Path
    parts: dict[tuple[int, int], str] = field(default_factory=dict)

    def missing_parts(self, begin: int, end: int) -> list[tuple[int, int]]:
        """Return the parts of [begin, end) that the copy does not contain yet.

        >>> RemoteFile("", 100, "", Path("a"), {(10, 20): "", (30, 40): ""}).missing_parts(15, 50)
        [(20, 30), (40, 50)]
        """
        parts = []
        for part_begin, part_end in [*sorted(self.parts), (end, end)]:
            if part_begin > begin:
                parts.append((begin, min(part_begin, end)))
            begin = max(begin, part_end)
            if begin >= end:
                break
        return [(part_begin, part_end) for part_begin, part_end in parts if part_begin < part_end]

    def fetch(self, begin: int, end: int, on_bytes: OnBytes = lambda _: None) -> None:
        """Fetch the bytes of [begin, end) that the copy does not contain yet.

        on_bytes: function that is called with the size of each received chunk, bytes.

        After a temporary error the request is repeated. Raises TerrainError if the bytes cannot be fetched.
        """
        for part_begin, part_end in self.missing_parts(begin, min(end, self.size)):
            for attempt in range(_MAX_ATTEMPTS):
                try:
                    self._fetch_part(part_begin, part_end, on_bytes)
                    break
                except (_IncompleteAnswer, OSError, ValueError, http.client.HTTPException) as error:
                    if attempt == _MAX_ATTEMPTS - 1 or not _is_temporary(error):
                        raise TerrainError(
                            f"{self.url}: cannot be fetched: {_error_text(error)}", file=self.url
                        ) from error
                    time.sleep(_PAUSE * 2.0**attempt)

    def _fetch_part(self, begin: int, end: int, on_bytes: OnBytes) -> None:
        """Fetch the bytes [begin, end) into the copy.

        The whole file is fetched if the server has no range requests.

        Raises errors of the connection, and _IncompleteAnswer if the server sends other or fewer bytes. The bytes that
        were received are kept in the copy.
        """
        headers = {"Range": f"bytes={begin}-{end - 1}"} | ({"If-Range": self.version} if self.version else {})
        with _open_url(self.url, headers) as answer:
            if answer.status == 200:
                # A server without range requests sends the whole file; so does a server whose file has changed.
                if _content_length(answer) != self.size or _file_version(answer) != self.version:
                    raise _IncompleteAnswer("the file has changed since the fetch began: try again")
                begin, end = 0, self.size
            elif answer.headers.get("Content-Range") != f"bytes {begin}-{end - 1}/{self.size}":
                sent_range = answer.headers.get("Content-Range", "nothing")
                raise _IncompleteAnswer(f"bytes {begin}-{end - 1} were requested, but the server sent {sent_range}")
            with self.copy.open("r+b") as file:
                file.seek(begin)
                position = begin
                digest = sha256()
                start_time = time.monotonic()
                is_slow = False
                # read1 returns the bytes received so far, because read would wait for hours for a slow server.
                while position < end and not is_slow and (chunk := answer.read1(min(_CHUNK_BYTES, end - position))):
                    file.write(chunk)
                    digest.update(chunk)
                    position += len(chunk)
                    on_bytes(len(chunk))
                    elapsed = time.monotonic() - start_time
                    is_slow = elapsed > _SLOW_AFTER_S and position - begin < _MIN_BYTES_PER_S * elapsed
                file.flush()
                # Write the bytes to the disk before the notes list them, in case the power fails.
                os.fsync(file.fileno())
            if position > begin:
                self.parts[begin, position] = digest.hexdigest()
                write_atomically(
                    _notes_path(self.copy), json.dumps([[*chunk, text] for chunk, text in self.parts.items()])
                )
            if is_slow and position < end:
                raise _IncompleteAnswer(f"the server sends fewer than {_MIN_BYTES_PER_S:,.0f} bytes a second")
            if position < end:
                raise _IncompleteAnswer(f"{position - begin:,} of {end - begin:,} bytes were received")

    def clear_copy(self) -> None:
        """Replace the copy by an empty file of the same size, which contains no parts. Raises OSError."""
        _notes_path(self.copy).unlink(missing_ok=True)
        self.parts = {}
        # Make a new file, so that another process can continue to read the old one.
        with tempfile.NamedTemporaryFile(dir=self.copy.parent, delete=False) as file:
            os.truncate(file.fileno(), self.size)
        Path(file.name).replace(self.copy)


def find_remote(url: str, folder: Path) -> RemoteFile | None:
    """Find a file on a server; return it with its local copy, or None if the server does not have it.

    folder: cache folder for the copies.
    Raises TerrainError if the server cannot be reached or states a size that is not allowed, and OSError if the cache
    cannot be written.
    """
    answer: http.client.HTTPResponse | None = None
    for attempt in range(_MAX_ATTEMPTS):
        try:
            with _open_url(url, {}, "HEAD") as answer:
                size, version = _content_length(answer), _file_version(answer)
            break
        except urllib.error.HTTPError as error:
            if error.code in _ABSENT_STATUSES:
                return None
            if attempt == _MAX_ATTEMPTS - 1 or not _is_temporary(error):
                raise TerrainError(f"{url}: cannot be fetched: {_error_text(error)}", file=url) from error
        except (OSError, ValueError, http.client.HTTPException) as error:
            if attempt == _MAX_ATTEMPTS - 1 or not _is_temporary(error):
                raise TerrainError(f"{url}: cannot be reached: {_error_text(error)}", file=url) from error
        time.sleep(_PAUSE * 2.0**attempt)
    if not 0 < size <= MAX_BYTES:
        allowed = f"expected 1 to {MAX_BYTES:,} bytes"
        raise TerrainError.at(url, "Content-Length", size, allowed, shown=f"{size:,}")
    key = sha256(f"{url}\0{version}\0{size}".encode()).hexdigest()[:16]
    copy = folder / key / url.rpartition("/")[2]
    copy.parent.mkdir(parents=True, exist_ok=True)
    remote = RemoteFile(url, size, version, copy)
    if not (copy.is_file() and copy.stat().st_size == size):
        remote.clear_copy()
    remote.parts = _read_notes(copy, size)
    return remote


def _open_url(url: str, headers: dict[str, str], method: str = "GET") -> http.client.HTTPResponse:
    """Send a request for an address with some headers, and return the server's answer.

    Raises OSError, or an HTTP error, if there is no answer in time.
    """
    request = urllib.request.Request(url, headers={"User-Agent": "planfly"} | headers, method=method)
    return _make_opener().open(request, timeout=_ANSWER_TIMEOUT_S)


class _TimedHead(http.client.HTTPConnection):
    """Connection with a time limit for all headers of an answer.

    A socket's own timeout starts again with each byte.
    """

    def getresponse(self) -> http.client.HTTPResponse:
        """Return the server's answer once its headers have arrived.

        Raises OSError if they do not arrive in time.
        """
        is_late = threading.Event()

        def shut_down_connection() -> None:
            """Shut down the connection, because the headers of the answer are late."""
            is_late.set()
            with contextlib.suppress(OSError):
                self.sock.shutdown(socket.SHUT_RDWR)

        timer = threading.Timer(_ANSWER_TIMEOUT_S, shut_down_connection)
        timer.daemon = True
        timer.start()
        try:
            answer = super().getresponse()
        except (OSError, http.client.HTTPException) as error:
            if is_late.is_set():
                raise TimeoutError("timed out") from error
            raise
        finally:
            timer.cancel()
        # A truncated head looks like a complete, shorter head.
        if is_late.is_set():
            answer.close()
            raise TimeoutError("timed out")
        return answer


class _TimedHeadOverTls(_TimedHead, http.client.HTTPSConnection):
    """The same connection over TLS."""


class _HttpHandler(urllib.request.HTTPHandler):
    def http_open(self, req: urllib.request.Request) -> http.client.HTTPResponse:
        """Open an http address with a time limit for the headers of the answer."""
        return self.do_open(_TimedHead, req)


class _HttpsHandler(urllib.request.HTTPSHandler):
    def https_open(self, req: urllib.request.Request) -> http.client.HTTPResponse:
        """Open an https address with a time limit for the headers of the answer."""
        return self.do_open(_TimedHeadOverTls, req)


@cache
def _make_opener() -> urllib.request.OpenerDirector:
    """Make an opener that allows only http and https, also after a redirect."""
    opener = urllib.request.OpenerDirector()
    for handler in (
        urllib.request.ProxyHandler,
        urllib.request.UnknownHandler,
        _HttpHandler,
        _HttpsHandler,
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
        has_host = bool(parts.hostname) and (parts.port is None or parts.port > 0)
        (parts.hostname or "").encode("idna")
    except ValueError:
        return False
    is_plain = text.isascii() and text.isprintable() and " " not in text and "?" not in text and "#" not in text
    return is_plain and has_host and parts.scheme in ("http", "https")


def _content_length(answer: http.client.HTTPResponse) -> int:
    """Return the number of bytes that an answer announces; 0 if it announces none."""
    length_text = answer.headers.get("Content-Length", "")
    return int(length_text) if length_text.isdecimal() else 0


def _file_version(answer: http.client.HTTPResponse) -> str:
    """Return the strong ETag of an answer, or else its date of the last change; "" without both."""
    tag = str(answer.headers.get("ETag") or "")
    # A weak ETag may match different bytes, and is not allowed in range requests.
    return tag if tag and not tag.startswith("W/") else str(answer.headers.get("Last-Modified") or "")


def _is_temporary(error: Exception) -> bool:
    """Return True for an error after which another attempt may succeed."""
    return not isinstance(error, urllib.error.HTTPError) or error.code in _TEMPORARY_STATUSES


def _error_text(error: Exception) -> str:
    """Return the reason why a request failed, as one line of text."""
    if isinstance(error, urllib.error.HTTPError):
        return f"the server answers {error.code} {error.reason}"
    reason = getattr(error, "reason", None) or error
    return " ".join(str(getattr(reason, "strerror", None) or reason).split()) or type(error).__name__


def _notes_path(copy: Path) -> Path:
    """Return the path of the notes file of a local copy, which lists the parts that the copy contains."""
    return copy.with_name(copy.name + ".held")


def _read_notes(copy: Path, size: int) -> dict[tuple[int, int], str]:
    """Return the SHA-256 of each undamaged part [begin, end) of a copy, as its notes file lists them.

    size: size of the copy, bytes. The result is empty if the notes are missing or damaged.
    """
    try:
        entries = json.loads(_notes_path(copy).read_text(encoding="ascii"))
        parts = {(int(part_begin), int(part_end)): str(digest) for part_begin, part_end, digest in entries}
    except (OSError, ValueError, TypeError, OverflowError):
        return {}
    with copy.open("rb") as file:

        def is_intact(part_begin: int, part_end: int, digest: str) -> bool:
            """Return True if the bytes of a part of the copy have this SHA-256."""
            if not 0 <= part_begin < part_end <= size:
                return False
            file.seek(part_begin)
            return sha256(file.read(part_end - part_begin)).hexdigest() == digest

        return {
            (part_begin, part_end): digest
            for (part_begin, part_end), digest in parts.items()
            if is_intact(part_begin, part_end, digest)
        }
