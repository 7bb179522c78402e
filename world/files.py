"""Read small text files with one-line errors, and write outputs that appear complete or not at all."""

import contextlib
import errno
import json
import os
import re
import shutil
import stat
import tempfile
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from world import file_locks
from world.errors import PlanflyError
from world.interruption import delay_signals, remove_at_end

# ----------------------------------------------------------------------
# Small text files that the user names: missions, parameters, scenarios.

# A dotted TOML name, as of nested tables.
_DOTTED_NAME = re.compile(r"""[\w"'-]+(?:[ \t]*\.[ \t]*[\w"'-]+)*""")
# Maximum number of dots in a name.
_MAX_DOTS = 100
# A TOML key that needs no quotes.
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


class TextLine(NamedTuple):
    """Position in a file, as messages name it.

    number: number of the line, from 1.

    >>> print(TextLine("a.waypoints", 4))
    a.waypoints:4
    """

    file: str
    number: int

    def __str__(self) -> str:
        """Return the position as text, such as "a.waypoints:4"."""
        return f"{self.file}:{self.number}"


def read_small_file(path: Path, max_bytes: int, kind: str, error: type[PlanflyError]) -> bytes:
    """Return the bytes of a file of at most ``max_bytes`` bytes.

    kind: kind of the file in messages, such as "mission".
    error: class of the error that is raised, in one line, for a file that is missing, too large or not readable.

    >>> from world.errors import MissionError
    >>> read_small_file(Path("missing.plan"), 100, "mission", MissionError)
    Traceback (most recent call last):
    world.errors.MissionError: missing.plan: cannot be read: No such file or directory
    """
    try:
        return read_at_most(path, max_bytes, kind)
    except OSError as problem:
        raise error(f"{path}: cannot be read: {problem.strerror}", file=path) from problem
    except ValueError as problem:
        raise error(f"{path}: {problem}", file=path) from None


# Suffixes of missions and flight logs, which the message on a folder lists.
_LISTED_SUFFIXES = (".waypoints", ".plan", ".mcap")
# Maximum number of files that the message on a folder lists.
_MAX_LISTED_FILES = 4
# Commands for a folder, by the file that it holds.
_FOLDER_COMMANDS = {
    "campaign.sqlite": "a campaign: planfly compare reads it, planfly campaign --resume --out continues it",
    "winds.sqlite": "a search for winds: planfly winds --resume --out continues it",
}


def missing_text(path: Path) -> str:
    """Return the reason why a path is not a plain file.

    The path does not exist, or it is a folder with certain contents.

    >>> missing_text(Path("missing.plan")), missing_text(Path("/proc/self/task"))
    ('no such file', 'is a folder')
    """
    try:
        if not path.is_dir():
            return "not a file" if path.exists() else "no such file"
        names = sorted(entry.name for entry in path.iterdir())
    except OSError:
        names = []
    for name, commands in _FOLDER_COMMANDS.items():
        if name in names:
            return f"is a folder that holds {commands}"
    listed = [name for name in names if name == "plan.json" or name.endswith(_LISTED_SUFFIXES)]
    more = f" and {len(listed) - _MAX_LISTED_FILES} more" if len(listed) > _MAX_LISTED_FILES else ""
    return "is a folder" + (f" that holds {', '.join(listed[:_MAX_LISTED_FILES])}{more}" if listed else "")


def read_at_most(path: Path, max_bytes: int, kind: str) -> bytes:
    """Return the bytes of a file of at most ``max_bytes`` bytes.

    kind: kind of the file in messages, such as "mission".

    Raises OSError, and ValueError for a larger file. Also raises ValueError for anything but a plain file, because a
    named pipe without a writer would block, and a device has no end. A pipe of the shell (``/dev/stdin``,
    ``/dev/fd/63``) is read to its end.

    >>> read_at_most(Path("/dev/zero"), 100, "mission")
    Traceback (most recent call last):
    ValueError: not a plain file; expected a mission file
    """
    status = path.stat()
    file_text = f"{'an' if kind.startswith('a') else 'a'} {kind} file"
    if stat.S_ISREG(status.st_mode) and status.st_size > max_bytes:
        raise ValueError(f"{status.st_size:,} bytes: {file_text} has at most {max_bytes:,} bytes")
    if stat.S_ISDIR(status.st_mode):
        raise ValueError(f"{missing_text(path)}; expected {file_text}")
    is_shell_pipe = stat.S_ISFIFO(status.st_mode) and str(path).startswith(("/dev/fd/", "/dev/stdin", "/proc/self/fd/"))
    if not (stat.S_ISREG(status.st_mode) or is_shell_pipe):
        raise ValueError(f"not a plain file; expected {file_text}")
    with path.open("rb") as file:
        data = file.read(max_bytes + 1)
    if len(data) > max_bytes:
        raise ValueError(f"more than {max_bytes:,} bytes: {file_text} has at most {max_bytes:,} bytes")
    return data


def absolute_path(path: Path) -> str:
    """Return the absolute path of a file or folder, with links resolved.

    A link that refers to itself is not resolved.

    >>> absolute_path(Path("/usr/../none/"))
    '/none'
    """
    try:
        return os.path.realpath(path)
    except ValueError:  # a NUL character
        return str(path.absolute())


def read_toml(path: Path, kind: str, max_bytes: int = 2**20) -> dict[str, Any]:
    """Read a TOML file, and return its table.

    Raises OSError, and ValueError as `read_at_most` and `toml_table` do.

    >>> read_toml(Path("/dev/null"), "gains")
    Traceback (most recent call last):
    ValueError: not a plain file; expected a gains file
    """
    return toml_table(read_at_most(path, max_bytes, kind).decode("utf-8"))


def toml_table(text: str) -> dict[str, Any]:
    """Parse a TOML text, and return its table.

    Raises ValueError for invalid TOML. Also raises ValueError for too many nested brackets or dotted names, because the
    parser's memory grows with the square of their number.

    >>> toml_table("a.b = 1")
    {'a': {'b': 1}}
    """
    if any(name[0].count(".") > _MAX_DOTS for name in _DOTTED_NAME.finditer(text)):
        raise ValueError(f"a name of more than {_MAX_DOTS} parts")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("tables or arrays are nested too deeply") from None


def json_value(text: str | bytes, **options: Any) -> Any:
    """Parse a JSON text with the options of `json.loads`, and return its value.

    Raises ValueError for invalid JSON, and for brackets that are nested too deeply.

    >>> json_value('{"a": [1]}')
    {'a': [1]}
    """
    try:
        return json.loads(text, **options)
    except RecursionError:
        raise ValueError("brackets are nested too deeply") from None


def toml_text(table: Mapping[str, Any]) -> str:
    """Format a table as TOML text, which `toml_table` reads.

    The values are texts, numbers, True, False, lists and tables.

    >>> print(toml_text({"name": "a", "wind": {"speed_mps": 4.0}, "zones": [{"radius_m": 1e3}]}))
    name = "a"
    <BLANKLINE>
    [wind]
    speed_mps = 4.0
    <BLANKLINE>
    [[zones]]
    radius_m = 1000.0
    <BLANKLINE>
    """
    return "".join(f"{line}\n" for line in _toml_lines(table, ()))


def _toml_lines(table: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[str]:
    """Yield the lines of a table in TOML: first its values, then the tables that it contains.

    path: keys that lead to the table; () for the whole text.
    """
    subtables = {
        key: value
        for key, value in table.items()
        if isinstance(value, Mapping) or (isinstance(value, list) and any(isinstance(item, Mapping) for item in value))
    }
    for key, value in table.items():
        if key not in subtables:
            yield f"{_toml_key(key)} = {_toml_value(value)}"
    for key, value in subtables.items():
        keys = (*path, key)
        name = ".".join(map(_toml_key, keys))
        for subtable in [value] if isinstance(value, Mapping) else value:
            yield ""
            yield f"[{name}]" if isinstance(value, Mapping) else f"[[{name}]]"
            yield from _toml_lines(subtable, keys)


def _toml_key(key: str) -> str:
    """Return a key in TOML syntax, in quotes if necessary."""
    return key if _BARE_KEY.fullmatch(key) else _toml_value(key)


def _toml_value(value: Any) -> str:
    """Format a text, a number, True, False or a list of these in TOML syntax."""
    if isinstance(value, list):
        return f"[{', '.join(map(_toml_value, value))}]"
    # JSON and TOML write these values alike, except for one control character that JSON does not escape.
    return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")


def utf8_text(data: bytes, path: Path, error: type[PlanflyError]) -> str:
    r"""Decode a file's bytes to text without a byte order mark.

    error: class of the error that is raised, with line and byte, if the bytes are not UTF-8.

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


def did_you_mean(name: str, known_names: Iterable[str], folder: Path | None = None) -> str:
    """Return a suggestion for an unknown name, as the end of a message; "" if no known name is similar.

    folder: folder of files with these names, for the message.

    >>> did_you_mean("jaksboro", ["jacksboro", "tight"]), did_you_mean("valley", ["jacksboro", "tight"])
    (": did you mean 'jacksboro'?", '')
    >>> did_you_mean("speed", ["seed", "speed_mps"])
    ": did you mean 'speed_mps'?"
    """
    # Imported here, because most runs report no unknown name.
    from difflib import get_close_matches

    names_by_folded_name = {candidate.casefold(): candidate for candidate in known_names}
    # A missing unit, as in "speed" for "speed_mps", is more likely than a typing error.
    matches = [candidate for candidate in names_by_folded_name if candidate.startswith(f"{name.casefold()}_")]
    matches = matches or get_close_matches(name.casefold(), names_by_folded_name, n=1)
    if not matches:
        return ""
    match = names_by_folded_name[matches[0]]
    return f": did you mean {match if folder is None else str(folder / match)!r}?"


# ----------------------------------------------------------------------
# Files that are written whole or not at all, temporary folders, and locks that keep a target to one process.


def write_atomically(path: Path, data: str | bytes) -> None:
    """Write a file completely or not at all, by renaming a temporary file next to it.

    Text is written in UTF-8. If the target is a link, the file to which it leads is replaced. Raises OSError, which
    names the target; the old file then stays unchanged.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     write_atomically(Path(folder) / "plan.json", "{}")
    ...     print((Path(folder) / "plan.json").read_text())
    {}
    """
    content = data.encode("utf-8") if isinstance(data, str) else data
    try:
        target = path
        if path.is_symlink():
            try:
                target = path.resolve()
            except RuntimeError:
                raise OSError(errno.ELOOP, os.strerror(errno.ELOOP)) from None
        # Limit the name by bytes: a file name has at most 255 bytes, and a letter takes up to four.
        name = target.name.encode()[:200].decode("utf-8", "ignore")
        temporary_path = target.with_name(f".{name}.{os.getpid()}-{os.urandom(4).hex()}")
        with delay_signals(), remove_at_end(temporary_path):
            with temporary_path.open("xb") as file:
                file.write(content)
            temporary_path.replace(target)
    except OSError as error:
        if error.errno is None:
            raise
        # The user knows the target, not the temporary name.
        raise OSError(error.errno, error.strerror, str(path)) from error


def write_folder(path: Path, files: Mapping[str, bytes], kept_names: Iterable[str] | None = None) -> None:
    """Make a folder with files, either completely or not at all.

    files: content of each file, by its path within the folder.
    kept_names: entries of an existing folder to keep when the folder is replaced; None to refuse an existing folder.

    Raises OSError, which names the folder; no partly written folder is left.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as home:
    ...     write_folder(Path(home) / "made", {"a.txt": b"1", "b/c.txt": b"2"})
    ...     print((Path(home) / "made" / "b" / "c.txt").read_text())
    2
    """
    temporary_path = path.with_name(f".{path.name[:50]}.{os.getpid()}-{os.urandom(4).hex()}")
    try:
        with delay_signals(), remove_at_end(temporary_path):
            temporary_path.mkdir()
            for name, content in files.items():
                (temporary_path / name).parent.mkdir(parents=True, exist_ok=True)
                (temporary_path / name).write_bytes(content)
            if kept_names is not None and path.is_dir():
                for name in kept_names:
                    (path / name).rename(temporary_path / name)
                replaced_folder = temporary_path.with_name(f"{temporary_path.name}.old")
                path.rename(replaced_folder)
                temporary_path.rename(path)
                shutil.rmtree(replaced_folder)
            else:
                temporary_path.rename(path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


@contextlib.contextmanager
def temporary_folder(prefix: str) -> Iterator[Path]:
    """Make a temporary folder, and remove it with its contents at the end of the block.

    >>> with temporary_folder("planfly-") as folder:
    ...     _ = (folder / "notes").write_text("gone soon")
    >>> folder.exists()
    False
    """
    folder = Path(tempfile.gettempdir()) / f"{prefix}{os.getpid()}-{os.urandom(8).hex()}"
    with remove_at_end(folder):
        folder.mkdir(mode=0o700)
        yield folder


def remove_temporary_folders(process_id: int) -> bool:
    """Remove the folders that a killed process made by `temporary_folder`.

    process_id: number of the killed process.

    Returns True if there was nothing to remove.

    >>> with temporary_folder("planfly-") as folder:
    ...     remove_temporary_folders(os.getpid()), folder.exists()
    (False, False)
    """
    # The name pattern of `temporary_folder`.
    candidates = Path(tempfile.gettempdir()).glob("planfly-*-*")
    remaining = [folder for folder in candidates if folder.name.split("-")[-2] == str(process_id)]
    for folder in remaining:
        shutil.rmtree(folder, ignore_errors=True)
    return not remaining


@contextlib.contextmanager
def lock_path(path: Path) -> Iterator[None]:
    """Lock an existing file or folder for this process until the end of the block.

    The operating system releases the lock when the process ends for any reason. Raises PlanflyError if another process
    holds the lock, and OSError if the file cannot be opened.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder, lock_path(Path(folder)):
    ...     try:
    ...         with lock_path(Path(folder)):
    ...             print("never")
    ...     except PlanflyError:
    ...         print("held")
    held
    """
    lock_file = path if file_locks.LOCKS_FOLDERS else path.with_name(f".{path.name}.planfly-lock")
    handle = os.open(lock_file, os.O_RDONLY if file_locks.LOCKS_FOLDERS else os.O_RDWR | os.O_CREAT)
    try:
        if not file_locks.try_lock(handle):
            raise PlanflyError(
                f"{path}: another planfly process is writing there; wait until it ends, or name another file or folder",
                file=path,
            )
        yield
    finally:
        os.close(handle)
        if not file_locks.LOCKS_FOLDERS:
            with contextlib.suppress(OSError):
                lock_file.unlink()
