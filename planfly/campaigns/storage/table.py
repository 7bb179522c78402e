"""A table of flights in a SQLite file: written as flights come in, held by one process at a time."""

import errno
import json
import math
import sqlite3
from collections.abc import Mapping
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from logs.verdict.places import Place
from logs.verdict.rules.registry import RULES
from planfly.campaigns.flights.flight_row import FlightRow, LeastMargin
from planfly.campaigns.spread.draws import Draw
from planfly.campaigns.spread.spread_file import NAMES
from planfly.campaigns.statistics.decision import Tally
from world.errors import PlanflyError

# ----------------------------------------------------------------------
# A flight's row as values of the table's columns, and back.

# Columns that a second campaign of the same flights may have otherwise.
NOT_THE_SAME = ("seconds", "worker")
# Arrays as bytes, of `planfly.campaigns.flights.flight_row`.
SHAPES = ("clearance", "crossings")
_MARGINS = tuple(f"{kind}_{rule}" for rule in RULES for kind in ("margin", "place"))
# Of a row, but for the flight's index, name and kind of each column.
ROW_COLUMNS: dict[str, str] = {
    "seed": "INTEGER NOT NULL",
    **dict.fromkeys(NAMES, "REAL NOT NULL"),
    "outcome": "TEXT NOT NULL",
    "ended": "TEXT NOT NULL",
    "failed": "TEXT NOT NULL",
    **{name: "REAL" if name.startswith("margin") else "TEXT" for name in _MARGINS},
    "closeness": "REAL",
    "energy_left": "REAL",
    "duration": "REAL NOT NULL",
    "made_of": "TEXT NOT NULL",
    **dict.fromkeys(SHAPES, "BLOB NOT NULL"),
    "seconds": "REAL NOT NULL",
    "worker": "TEXT NOT NULL",
}


def row_values(row: FlightRow, made_of: str) -> dict[str, Any]:
    """A value for each of `ROW_COLUMNS`."""
    margins: dict[str, Any] = dict.fromkeys(_MARGINS)
    for rule, margin in row.margins:
        margins[f"margin_{rule}"] = margin.value
        margins[f"place_{rule}"] = json.dumps({"unit": margin.unit, **asdict(margin.place)})
    return {
        "seed": row.draw.seed,
        **row.draw.values,
        "outcome": row.outcome,
        "ended": row.ended,
        "failed": json.dumps([{"rule": rule, **asdict(place)} for rule, place in row.failed]),
        **margins,
        "closeness": row.closeness if math.isfinite(row.closeness) else None,
        "energy_left": row.energy_left,
        "duration": row.duration,
        "made_of": made_of,
        "clearance": row.clearance,
        "crossings": row.crossings,
        "seconds": row.seconds,
        "worker": row.worker,
    }


def row_of(index: int, known: Mapping[str, Any]) -> FlightRow:
    """The row of a draw's index and its values by column."""
    margins = []
    for rule in RULES:
        if (place := known[f"place_{rule}"]) is not None:
            data = json.loads(place)
            margins.append((rule, LeastMargin(known[f"margin_{rule}"], data.pop("unit"), Place(**data))))
    return FlightRow(
        draw=Draw(index, known["seed"], {name: known[name] for name in NAMES}),
        outcome=known["outcome"],
        ended=known["ended"],
        failed=failed_of(known["failed"]),
        margins=tuple(margins),
        energy_left=known["energy_left"],
        duration=known["duration"],
        clearance=known["clearance"],
        crossings=known["crossings"],
        seconds=known["seconds"],
        worker=known["worker"],
    )


def failed_of(text: str) -> tuple[tuple[str, Place], ...]:
    """Rule and place of each finding that failed, of the column's text.

    >>> failed_of('[{"rule": "slope", "kind": "leg", "index": 3}]')[0][1].index
    3
    """
    entries = json.loads(text)
    return tuple((entry.pop("rule"), Place(**entry)) for entry in entries)


def same_flight(one: FlightRow, other: FlightRow) -> bool:
    """Whether two rows tell of the same flight, whoever flew it and however long that took."""
    mine, theirs = (row_values(row, "") for row in (one, other))
    same = all(mine[name] == theirs[name] for name in ROW_COLUMNS if name not in NOT_THE_SAME)
    return same and one.draw.index == other.draw.index


# What SQLite says of a file that another process holds.
_HELD = (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED)


class StoreError(PlanflyError):
    """The table of a campaign cannot be opened, or is another campaign's."""


@dataclass(frozen=True)
class TableKind:
    """What a file of this kind holds.

    schema: its name, kept in the file.
    columns: of the table of flights, name and kind of each; the first is the key, a flight's number.
    fixed: what of the settings may not be otherwise where it is gone on with.
    """

    schema: str
    columns: Mapping[str, str]
    fixed: tuple[str, ...] = ()


class HeldTable:
    """The table of a campaign or of a search, held until it is left.

    made_of: hash of code, model, mission, scenario, spread and seed: of flights with another one it keeps away.
    """

    def __init__(self, path: Path, kind: TableKind, made_of: str, settings: dict[str, Any], *, resume: bool) -> None:
        """Make the table, or open it to go on.

        settings: what was asked for, kept in the file.
        Raises StoreError for a file that is none of this kind, another campaign's, or held by another process, and
        OSError for a full disk.
        """
        self.path, self.made_of, self._kind = path, made_of, kind
        if resume and not path.is_file():
            raise StoreError(f"{path}: no such campaign to resume", file=path)
        self._connection = sqlite3.connect(path, timeout=1.0, isolation_level=None)
        try:
            with told_errors(path):
                self._prepare(settings)
        except BaseException:
            self._connection.close()
            raise

    def _prepare(self, settings: dict[str, Any]) -> None:
        run = self._connection.execute
        run("PRAGMA locking_mode = EXCLUSIVE")
        run("PRAGMA journal_mode = WAL")
        run("PRAGMA synchronous = NORMAL")
        run("BEGIN EXCLUSIVE")
        columns = ", ".join(f"{name} {kind}" for name, kind in self._kind.columns.items())
        run(f"CREATE TABLE IF NOT EXISTS flights ({columns})")
        run("CREATE TABLE IF NOT EXISTS campaign (key TEXT PRIMARY KEY, value TEXT NOT NULL)")
        known = dict(run("SELECT key, value FROM campaign").fetchall())
        if known:
            self._refuse_other(known, settings)
        values = {
            "schema": self._kind.schema,
            "made_of": self.made_of,
            "settings": json.dumps(settings, sort_keys=True),
        }
        run("DELETE FROM campaign")
        self._connection.executemany("INSERT INTO campaign VALUES (?, ?)", values.items())
        run("COMMIT")

    def _refuse_other(self, known: dict[str, str], settings: dict[str, Any]) -> None:
        schema = self._kind.schema
        if known.get("schema") != schema:
            raise StoreError(f"{self.path}: schema {known.get('schema')!r}: {schema} is expected", file=self.path)
        if known.get("made_of") != self.made_of:
            raise StoreError(
                f"{self.path}: is of another campaign: its code, mission, aircraft, scenario, spread or seed differs"
                f" ({known.get('made_of')}, not {self.made_of})",
                file=self.path,
            )
        before = json.loads(known["settings"])
        for name in self._kind.fixed:
            if before[name] != settings[name]:
                raise StoreError(
                    f"{self.path}: {name} {settings[name]}: the flights there were asked for with {before[name]}",
                    file=self.path,
                )

    def __enter__(self) -> Self:
        """Hold it."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Let it go."""
        self._connection.close()

    def insert(self, values: Mapping[str, Any]) -> None:
        """Write a flight, for good: a value a column.

        Raises OSError for a full disk; what was written before stays.  Raises StoreError for a number that is there.
        """
        with told_errors(self.path):
            marks = ", ".join("?" * len(self._kind.columns))
            self._connection.execute(
                f"INSERT INTO flights VALUES ({marks})", [values[name] for name in self._kind.columns]
            )

    def drop_from(self, flight: int) -> None:
        """Take out the flights from this number on: those that were flown while an earlier one decided."""
        with told_errors(self.path):
            self._connection.execute("DELETE FROM flights WHERE flight >= ?", (flight,))

    def tally(self) -> Tally:
        """How many flights came out how."""
        counts = dict(self._connection.execute("SELECT outcome, COUNT(*) FROM flights GROUP BY outcome"))
        return Tally(counts.get("flyable", 0), counts.get("not flyable", 0), counts.get("lost", 0))


def kept_settings(path: Path) -> dict[str, Any]:
    """What the flights of a table were asked for with; nothing where there is no such file.

    Raises StoreError for a file that is none of ours or is held.
    """
    if not path.is_file():
        return {}
    with told_errors(path), closing(sqlite3.connect(path, timeout=1.0)) as connection:
        found = connection.execute("SELECT value FROM campaign WHERE key = 'settings'").fetchone()
    settings: dict[str, Any] = json.loads(found[0]) if found else {}
    return settings


def refuse_held(path: Path) -> None:
    """Refuse a table that another process holds; a file that is none is nobody's.  Raises StoreError."""
    if not path.is_file():
        return
    connection = sqlite3.connect(path, timeout=1.0, isolation_level=None)
    try:
        connection.execute("BEGIN EXCLUSIVE")
    except sqlite3.Error as error:
        if getattr(error, "sqlite_errorcode", sqlite3.SQLITE_NOTADB) & 0xFF in _HELD:
            raise StoreError(f"{path}: is held by another process", file=path) from error
    finally:
        connection.close()


class told_errors:
    """Tell SQLite's errors about a file as ours: a full disk as OSError, the rest as StoreError."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> None:
        """Nothing to do before."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Raise what SQLite raised as ours."""
        if not isinstance(error, sqlite3.Error):
            return
        code = getattr(error, "sqlite_errorcode", None)
        if code is not None and code & 0xFF == sqlite3.SQLITE_FULL:
            raise OSError(errno.ENOSPC, "no space left; the flights before are kept, --resume goes on", str(self._path))
        if code is not None and code & 0xFF in _HELD:
            raise StoreError(f"{self._path}: is held by another process", file=self._path) from error
        raise StoreError(f"{self._path}: {error}", file=self._path) from error
