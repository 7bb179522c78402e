"""Small text files that a person names: missions, parameters, scenarios."""

import os
import re
import stat
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from world.errors import PlanflyError

# Names with dots between them, as of tables within tables.
_DOTTED = re.compile(r"""[\w"'-]+(?:[ \t]*\.[ \t]*[\w"'-]+)*""")
_MOST_DOTS = 100


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
        return read_at_most(path, most, kind)
    except OSError as problem:
        raise error(f"{path}: cannot be read: {problem.strerror}", file=path) from problem
    except ValueError as problem:
        raise error(f"{path}: {problem}", file=path) from None


def read_at_most(path: Path, most: int, kind: str) -> bytes:
    """Bytes of a file of this kind, of ``most`` bytes at most.

    Raises OSError, and ValueError for a larger one and for what is none: a named pipe that nobody writes into would be
    waited for, and a device has no end.  A pipe of the shell (``/dev/stdin``, ``/dev/fd/63``) is read to its end.

    >>> read_at_most(Path("/dev/zero"), 100, "mission")
    Traceback (most recent call last):
    ValueError: not a plain file: a mission file is expected
    """
    status = path.stat()
    if stat.S_ISREG(status.st_mode) and status.st_size > most:
        raise ValueError(f"{status.st_size:,} bytes: a {kind} file has at most {most:,}")
    given = stat.S_ISFIFO(status.st_mode) and str(path).startswith(("/dev/fd/", "/dev/stdin", "/proc/self/fd/"))
    if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode) or given):
        raise ValueError(f"not a plain file: a {kind} file is expected")
    with path.open("rb") as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise ValueError(f"more than {most:,} bytes: a {kind} file has no more")
    return data


def whole_path(path: Path) -> str:
    """The absolute path of a file or folder, links followed as far as they lead: one that leads to itself stays.

    >>> whole_path(Path("/usr/../none/"))
    '/none'
    """
    try:
        return os.path.realpath(path)
    except ValueError:  # a NUL character
        return str(path.absolute())


def read_toml(path: Path, kind: str, most: int = 2**20) -> dict[str, Any]:
    """The table of a TOML file of this kind.  Raises OSError, and ValueError as `read_at_most` and `toml_table` do.

    >>> read_toml(Path("/dev/null"), "gains")
    Traceback (most recent call last):
    ValueError: not a plain file: a gains file is expected
    """
    return toml_table(read_at_most(path, most, kind).decode("utf-8"))


def toml_table(text: str) -> dict[str, Any]:
    """The table of a TOML text.

    Raises ValueError for what is none, and for brackets or names within one another without end: the parser takes
    memory by the square of how many there are.

    >>> toml_table("a.b = 1")
    {'a': {'b': 1}}
    """
    if any(name[0].count(".") > _MOST_DOTS for name in _DOTTED.finditer(text)):
        raise ValueError(f"a name of more than {_MOST_DOTS} parts")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("tables or arrays within one another without end") from None


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
