"""Recover the undamaged rows of a damaged table of flights, verified by their checksums."""

import contextlib
import hashlib
import math
import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

# Error codes of SQLite for a file that another process has locked.
HELD = (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED)
# Maximum number of flights listed in a line.
_LISTED = 8


def stored(value: Any, kind: str) -> Any:
    """Return a value as SQLite reads it from a column; numpy numbers become Python numbers, and NaN becomes None.

    >>> stored(3, "REAL NOT NULL"), stored(math.nan, "REAL"), stored(True, "INTEGER")
    (3.0, None, 1)
    """
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return None
    types: dict[str, type] = {"INTEGER": int, "REAL": float, "TEXT": str, "BLOB": bytes}
    return types[kind.split()[0]](value)


def checksum(values: Iterable[Any]) -> str:
    """Return a checksum of 16 hexadecimal digits of the values and types of a row read from SQLite.

    >>> checksum([1, 0.5, "flyable", None]) == checksum([1, 0.5, "flyable", 0])
    False
    """
    # SQLite does not keep the sign of a zero.
    plain = [value + 0.0 if isinstance(value, float) else value for value in values]
    return hashlib.blake2b(repr(plain).encode("utf-8", "surrogatepass"), digest_size=8).hexdigest()


class Examined(NamedTuple):
    """Numbers of undamaged and damaged flights, both in ascending order.

    sound: True if SQLite finds no error in the file, even if some rows are damaged.
    after: last known flight of an unsound file if fewer flights are known than were requested, because later flights
        may have been lost; -1 if no flight is known; otherwise None.
    """

    whole: list[int]
    damaged: list[int]
    sound: bool = True
    after: int | None = None

    def text(self) -> str:
        """Describe the damage and its consequence.

        >>> Examined([0, 1, 3], [2]).text()
        'flight 2 is damaged and was taken out: 3 flights are intact and stay; --resume flies the missing ones'
        """
        stay = f"{len(self.whole)} flights are intact and stay; --resume flies the missing ones"
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
    """Determine which rows of the table ``flights`` are undamaged, even in a broken file.

    columns: columns of the checksum, in order, with the flight's number first.
    asked: number of requested flights.
    most: number of flights to try one by one in a broken file.
    Raises sqlite3.Error for a file that another process has locked.
    """
    # Invalid UTF-8 must not stop the reading, because it changes the checksum anyway.
    connection.text_factory = lambda data: data.decode("utf-8", "surrogateescape")
    query = f"SELECT {', '.join(columns)}, checksum FROM flights"
    try:
        if connection.execute("PRAGMA quick_check(1)").fetchone() == ("ok",):
            return _check_rows(connection.execute(f"{query} ORDER BY flight"))
    except sqlite3.Error as error:
        _refuse_held(error)
    rows = (row for number in range(most) if (row := _read_row(connection, query, number)) is not None)
    whole, damaged = _check_rows(rows)[:2]
    # In a broken file, a missing row may have been lost with its page.  A number without a valid checksum is accepted
    # if it is in the range of requested flights, which are numbered from 0.
    numbers = (
        number for number in (*damaged, *_readable_numbers(connection)) if isinstance(number, int) and number < asked
    )
    last = max([-1, *whole, *numbers])
    missing = set(range(last + 1)) - set(whole)
    return Examined(whole, sorted(missing), sound=False, after=last if last + 1 < asked else None)


def _readable_numbers(connection: sqlite3.Connection) -> list[Any]:
    """Return the flight numbers that can be read up to the damaged part of the file; some may be corrupt."""
    seen: list[Any] = []
    with contextlib.suppress(sqlite3.Error):
        for (number,) in connection.execute("SELECT flight FROM flights"):
            seen.append(number)
    return seen


def _check_rows(rows: Iterable[tuple[Any, ...]]) -> Examined:
    found = Examined([], [])
    for *values, kept in rows:
        (found.whole if kept == checksum(values) else found.damaged).append(values[0])
    return found


def _read_row(connection: sqlite3.Connection, query: str, number: int) -> tuple[Any, ...] | None:
    """Return a row by its number, with the checksum None if the row cannot be read."""
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
    """Write a new file with the given rows of a table, and with the entries `kept` in its table ``campaign``.

    create: SQL statements that create both tables.
    numbers: numbers of the rows to copy.
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
