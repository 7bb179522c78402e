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
LOCKED_CODES = (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED)
# Maximum number of flights listed in a line.
_MAX_LISTED = 8


def stored_value(value: Any, kind: str) -> Any:
    """Convert a value to what SQLite will read back from a column.

    Numpy numbers become Python numbers, and NaN becomes None.

    kind: SQL type of the column.

    >>> stored_value(3, "REAL NOT NULL"), stored_value(math.nan, "REAL"), stored_value(True, "INTEGER")
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
    plain_values = [value + 0.0 if isinstance(value, float) else value for value in values]
    return hashlib.blake2b(repr(plain_values).encode("utf-8", "surrogatepass"), digest_size=8).hexdigest()


class Examination(NamedTuple):
    """Result of an examination of a table.

    undamaged, damaged: numbers of the flights with an undamaged and with a damaged row, ascending.
    is_sound: True if SQLite finds no error in the file, even if some rows are damaged.
    last_known: number of the last known flight of a broken file, if flights after it may have been lost; -1 if no
        flight is known; None if no later flight can be missing.
    """

    undamaged: list[int]
    damaged: list[int]
    is_sound: bool = True
    last_known: int | None = None

    def describe(self) -> str:
        """Return a clause on the damage of a table and on its consequence.

        >>> Examination([0, 1, 3], [2]).describe()
        'flight 2 is damaged and was removed; intact flights: 3; --resume flies the missing ones'
        """
        intact_text = f"intact flights: {len(self.undamaged)}; --resume flies the missing ones"
        later_text = ""
        if self.last_known is not None:
            later_text = (
                f", and any flights after flight {self.last_known} are lost"
                if self.last_known >= 0
                else ", and no flight was found"
            )
        if not self.damaged:
            return f"is damaged{later_text}; {intact_text}"
        numbers_text = ", ".join(map(str, self.damaged[:_MAX_LISTED]))
        more_text = f" and {len(self.damaged) - _MAX_LISTED} more" if len(self.damaged) > _MAX_LISTED else ""
        has_several = len(self.damaged) > 1
        damaged_text = (
            f"flight{'s' if has_several else ''} {numbers_text}{more_text} {'are' if has_several else 'is'} damaged"
        )
        removed_text = f"{'were' if has_several else 'was'} removed"
        return f"{damaged_text} and {removed_text}{later_text}; {intact_text}"


def examine_table(
    connection: sqlite3.Connection, columns: Sequence[str], requested_count: int, max_number: int
) -> Examination:
    """Determine which rows of the table ``flights`` are undamaged, even in a broken file.

    columns: columns of the checksum, in order, with the flight's number first.
    requested_count: number of requested flights.
    max_number: in a broken file, the flights with the numbers 0 to ``max_number - 1`` are read one by one.
    Raises sqlite3.Error for a file that another process has locked.
    """
    # Invalid UTF-8 must not stop the reading, because it changes the checksum anyway.
    connection.text_factory = lambda data: data.decode("utf-8", "surrogateescape")
    query = f"SELECT {', '.join(columns)}, checksum FROM flights"
    try:
        if connection.execute("PRAGMA quick_check(1)").fetchone() == ("ok",):
            return _check_rows(connection.execute(f"{query} ORDER BY flight"))
    except sqlite3.Error as error:
        _raise_if_locked(error)
    # Read the flights one by one; a flight that cannot be read is damaged.
    undamaged: list[int] = []
    damaged: list[int] = []
    for number in range(max_number):
        try:
            rows = connection.execute(f"{query} WHERE flight = ?", (number,)).fetchmany(1)
        except sqlite3.Error as error:
            _raise_if_locked(error)
            damaged.append(number)
        else:
            examination = _check_rows(rows)
            undamaged += examination.undamaged
            damaged += examination.damaged
    # In a broken file, a missing row may have been lost with its page.  A number without a valid checksum is accepted
    # if it is in the range of requested flights, which are numbered from 0.
    readable_numbers: list[Any] = []
    with contextlib.suppress(sqlite3.Error):
        for (number,) in connection.execute("SELECT flight FROM flights"):
            readable_numbers.append(number)
    numbers = (
        number for number in (*damaged, *readable_numbers) if isinstance(number, int) and number < requested_count
    )
    last_number = max([-1, *undamaged, *numbers])
    missing = set(range(last_number + 1)) - set(undamaged)
    return Examination(
        undamaged,
        sorted(missing),
        is_sound=False,
        last_known=last_number if last_number + 1 < requested_count else None,
    )


def _check_rows(rows: Iterable[tuple[Any, ...]]) -> Examination:
    """Return the numbers of the flights whose row agrees with its checksum, and of the other flights.

    rows: values of each row; the first is the number of the flight, the last is the checksum.
    """
    examination = Examination([], [])
    for *values, stored_checksum in rows:
        (examination.undamaged if stored_checksum == checksum(values) else examination.damaged).append(values[0])
    return examination


def _raise_if_locked(error: sqlite3.Error) -> None:
    """Re-raise an error if it means that another process has locked the file."""
    if getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF in LOCKED_CODES:
        raise error


def copy_undamaged_rows(
    connection: sqlite3.Connection,
    target: Path,
    statements: Sequence[str],
    numbers: Sequence[int],
    entries: Mapping[str, str],
) -> None:
    """Write a new database file with the undamaged rows of a campaign's table.

    target: the new file; an existing file is replaced.
    statements: SQL statements that create both tables.
    numbers: flight numbers of the rows to copy.
    entries: keys and values of the table ``campaign``.
    """
    target.unlink(missing_ok=True)
    with closing(sqlite3.connect(target, isolation_level=None)) as copy:
        copy.execute("BEGIN")
        for statement in statements:
            copy.execute(statement)
        for number in numbers:
            row = connection.execute("SELECT * FROM flights WHERE flight = ?", (number,)).fetchone()
            copy.execute(f"INSERT INTO flights VALUES ({', '.join('?' * len(row))})", row)
        copy.executemany("INSERT INTO campaign VALUES (?, ?)", entries.items())
        copy.execute("COMMIT")
