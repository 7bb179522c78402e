"""Recover the whole rows of a damaged table of flights, each known by its checksum."""

import contextlib
import hashlib
import math
import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

# What SQLite says of a file that another process holds.
HELD = (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED)
# Numbers that a line lists.
_LISTED = 8


def stored(value: Any, kind: str) -> Any:
    """Return a value as SQLite gives it back from a column of a kind: numpy's numbers are plain ones, and NaN is NULL.

    >>> stored(3, "REAL NOT NULL"), stored(math.nan, "REAL"), stored(True, "INTEGER")
    (3.0, None, 1)
    """
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return None
    types: dict[str, type] = {"INTEGER": int, "REAL": float, "TEXT": str, "BLOB": bytes}
    return types[kind.split()[0]](value)


def checksum(values: Iterable[Any]) -> str:
    """16 hexadecimal digits of values as SQLite gives them back: another value, or one of another type, gives others.

    >>> checksum([1, 0.5, "flyable", None]) == checksum([1, 0.5, "flyable", 0])
    False
    """
    # SQLite does not keep the sign of a zero.
    plain = [value + 0.0 if isinstance(value, float) else value for value in values]
    return hashlib.blake2b(repr(plain).encode("utf-8", "surrogatepass"), digest_size=8).hexdigest()


class Examined(NamedTuple):
    """The numbers of flights that are whole, and of those that are not; both rise.

    sound: whether SQLite finds nothing wrong with the file, whatever its rows hold.
    after: of a file that is not, the last flight that is known of, if fewer are known of than were asked for: others
        may have been lost behind it, all of them behind -1; None where that is not so.
    """

    whole: list[int]
    damaged: list[int]
    sound: bool = True
    after: int | None = None

    def text(self) -> str:
        """Return what is damaged, and what becomes of it, in words.

        >>> Examined([0, 1, 3], [2]).text()
        'flight 2 is damaged and was taken out: 3 flights are whole and stay; --resume flies what is missing'
        """
        stay = f"{len(self.whole)} flights are whole and stay; --resume flies what is missing"
        behind = ""
        if self.after is not None:
            behind = f", and any after flight {self.after} were lost" if self.after >= 0 else ", and no flight is found"
        if not self.damaged:
            return f"is damaged{behind}: {stay}"
        listed = ", ".join(map(str, self.damaged[:_LISTED]))
        more = f" and {len(self.damaged) - _LISTED} more" if len(self.damaged) > _LISTED else ""
        several = len(self.damaged) > 1
        damaged = f"flight{'s' if several else ''} {listed}{more} {'are' if several else 'is'} damaged"
        taken = f"{'were' if several else 'was'} taken out"
        return f"{damaged} and {taken}{behind}: {stay}"


def examine(connection: sqlite3.Connection, columns: Sequence[str], asked: int, most: int) -> Examined:
    """Return which rows of the table ``flights`` are whole, whatever has happened to its file.

    columns: that the checksum is of, in order, the flight's number first.  asked: flights that were asked for.  most:
    flights that it may hold, where that has to be tried number by number.
    Raises sqlite3.Error for a file that another process holds.
    """
    # Bytes that are no UTF-8 end no reading: they make another checksum.
    connection.text_factory = lambda data: data.decode("utf-8", "surrogateescape")
    query = f"SELECT {', '.join(columns)}, checksum FROM flights"
    try:
        if connection.execute("PRAGMA quick_check(1)").fetchone() == ("ok",):
            return _by_checksum(connection.execute(f"{query} ORDER BY flight"))
    except sqlite3.Error as error:
        _refuse_held(error)
    rows = (row for number in range(most) if (row := _row_of(connection, query, number)) is not None)
    whole, damaged = _by_checksum(rows)[:2]
    # Of a broken file a row that is not found may have been lost with its page.  A number that no checksum vouches for
    # is believed where it was asked for: flights are numbered from 0 on.
    numbers = (number for number in (*damaged, *_seen(connection)) if isinstance(number, int) and number < asked)
    last = max([-1, *whole, *numbers])
    missing = set(range(last + 1)) - set(whole)
    return Examined(whole, sorted(missing), sound=False, after=last if last + 1 < asked else None)


def _seen(connection: sqlite3.Connection) -> list[Any]:
    """Numbers of flights, or what became of them, that can be read one after the other, up to where the file breaks."""
    seen: list[Any] = []
    with contextlib.suppress(sqlite3.Error):
        for (number,) in connection.execute("SELECT flight FROM flights"):
            seen.append(number)
    return seen


def _by_checksum(rows: Iterable[tuple[Any, ...]]) -> Examined:
    found = Examined([], [])
    for *values, kept in rows:
        (found.whole if kept == checksum(values) else found.damaged).append(values[0])
    return found


def _row_of(connection: sqlite3.Connection, query: str, number: int) -> tuple[Any, ...] | None:
    """Return a row by its number; one that cannot be read has no checksum."""
    try:
        found: tuple[Any, ...] | None = connection.execute(f"{query} WHERE flight = ?", (number,)).fetchone()
    except sqlite3.Error as error:
        _refuse_held(error)
        return number, None
    return found


def _refuse_held(error: sqlite3.Error) -> None:
    if getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF in HELD:
        raise error


def copy_whole(
    connection: sqlite3.Connection, target: Path, create: Sequence[str], numbers: Sequence[int], kept: Mapping[str, str]
) -> None:
    """Write a new file with some rows of a table, and with what its table ``campaign`` is to hold.

    create: statements that make both tables.
    """
    target.unlink(missing_ok=True)
    with closing(sqlite3.connect(target, isolation_level=None)) as copy:
        copy.execute("BEGIN")
        for statement in create:
            copy.execute(statement)
        for number in numbers:
            row = connection.execute("SELECT * FROM flights WHERE flight = ?", (number,)).fetchone()
            copy.execute(f"INSERT INTO flights VALUES ({', '.join('?' * len(row))})", row)
        copy.executemany("INSERT INTO campaign VALUES (?, ?)", kept.items())
        copy.execute("COMMIT")
