"""Small text files that a person names: missions, parameters, scenarios."""

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from world.errors import PlanflyError


class TextLine(NamedTuple):
    """A line of a file, as messages name it.  number: from 1.

    >>> print(TextLine("a.waypoints", 4))
    a.waypoints:4
    """

    file: str
    number: int

    def __str__(self) -> str:
        return f"{self.file}:{self.number}"


def read_small_file(path: Path, most: int, kind: str, error: type[PlanflyError]) -> bytes:
    """Bytes of a file of this kind, of ``most`` bytes at most.

    Raises ``error``, in one line, for a file that is missing, larger, or not to be read.

    >>> from world.errors import MissionError
    >>> read_small_file(Path("missing.plan"), 100, "mission", MissionError)
    Traceback (most recent call last):
    world.errors.MissionError: missing.plan: cannot be read: No such file or directory
    """
    try:
        size = path.stat().st_size
        if size > most:
            raise error(f"{path}: {size:,} bytes: a {kind} file has at most {most:,}", file=path)
        return path.read_bytes()
    except OSError as problem:
        raise error(f"{path}: cannot be read: {problem.strerror}", file=path) from problem


def utf8_text(data: bytes, path: Path, error: type[PlanflyError]) -> str:
    r"""A file's bytes as text, without a byte order mark; raises ``error`` with line and byte where they are none.

    >>> from world.errors import MissionError
    >>> utf8_text("\ufeffWind 3 m/s".encode(), Path("a.txt"), MissionError)
    'Wind 3 m/s'
    >>> utf8_text(b"one\ntwo\xff", Path("a.txt"), MissionError)
    Traceback (most recent call last):
    world.errors.MissionError: a.txt:2: not a text file in UTF-8 (byte 7)
    """
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as problem:
        line = data.count(b"\n", 0, problem.start) + 1
        raise error(f"{path}:{line}: not a text file in UTF-8 (byte {problem.start})", file=path) from problem


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """What a message says after a name or key that is not known: the nearest that is, "" where none is near.

    >>> did_you_mean("jaksboro", ["jacksboro", "tight"]), did_you_mean("valley", ["jacksboro", "tight"])
    (": did you mean 'jacksboro'?", '')
    """
    # Imported here: most runs have no fault to tell.
    from difflib import get_close_matches

    by_folded = {one.casefold(): one for one in known}
    near = get_close_matches(name.casefold(), by_folded, n=1)
    return f": did you mean {by_folded[near[0]]!r}?" if near else ""
