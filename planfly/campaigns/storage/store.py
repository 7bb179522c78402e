"""The table of flights: one SQLite file, a row a flight, written as flights come in and read by their index."""

import errno
import json
import math
import sqlite3
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from logs.verdict.findings import RULES
from logs.verdict.places import Place
from planfly.campaigns.flights.flight_row import FlightRow, LeastMargin
from planfly.campaigns.spread.draws import Draw
from planfly.campaigns.spread.quantities import NAMES
from planfly.campaigns.statistics.proportions import Tally
from world.errors import PlanflyError

DATABASE = "campaign.sqlite"
SCHEMA = "planfly.campaign/1"
# Columns that a second campaign of the same flights may have otherwise.
NOT_THE_SAME = ("seconds", "worker")
_MARGINS = tuple(f"{kind}_{rule}" for rule in RULES for kind in ("margin", "place"))
_COLUMNS: dict[str, str] = {
    "flight": "INTEGER PRIMARY KEY",
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
    "clearance": "BLOB NOT NULL",
    "crossings": "BLOB NOT NULL",
    "seconds": "REAL NOT NULL",
    "worker": "TEXT NOT NULL",
}
COLUMNS = tuple(_COLUMNS)


class StoreError(PlanflyError):
    """The table of a campaign cannot be opened, or is another campaign's."""


class Store:
    """A campaign's table, held by one process at a time.

    made_of: hash of code, model, mission, scenario, spread and seed: of flights with another one it keeps away.
    """

    def __init__(self, path: Path, made_of: str, settings: dict[str, Any], *, resume: bool) -> None:
        """Make the table, or open it to go on.

        settings: what the campaign was asked for, kept in the file.
        Raises StoreError for a file that is none of ours, another campaign's, or held by another process, and OSError
        for a full disk.
        """
        self.path, self.made_of = path, made_of
        if resume and not path.is_file():
            raise StoreError(f"{path}: no such campaign to resume", file=path)
        self._connection = sqlite3.connect(path, timeout=1.0, isolation_level=None)
        try:
            with _told(path):
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
        columns = ", ".join(f"{name} {kind}" for name, kind in _COLUMNS.items())
        run(f"CREATE TABLE IF NOT EXISTS flights ({columns})")
        run("CREATE TABLE IF NOT EXISTS campaign (key TEXT PRIMARY KEY, value TEXT NOT NULL)")
        known = dict(run("SELECT key, value FROM campaign").fetchall())
        if known and known.get("schema") != SCHEMA:
            raise StoreError(f"{self.path}: schema {known.get('schema')!r}: {SCHEMA} is expected", file=self.path)
        if known and known.get("made_of") != self.made_of:
            raise StoreError(
                f"{self.path}: is of another campaign: its code, mission, aircraft, scenario, spread or seed differs"
                f" ({known.get('made_of')}, not {self.made_of})",
                file=self.path,
            )
        values = {"schema": SCHEMA, "made_of": self.made_of, "settings": json.dumps(settings, sort_keys=True)}
        run("DELETE FROM campaign")
        self._connection.executemany("INSERT INTO campaign VALUES (?, ?)", values.items())
        run("COMMIT")

    def __enter__(self) -> Self:
        """Hold it."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Let it go."""
        self._connection.close()

    def add(self, row: FlightRow) -> None:
        """Write a flight, for good.  Raises OSError for a full disk; what was written before stays."""
        with _told(self.path):
            marks = ", ".join("?" * len(COLUMNS))
            self._connection.execute(f"INSERT INTO flights VALUES ({marks})", _values(row, self.made_of))

    def drop_from(self, flight: int) -> None:
        """Take out the flights from this index on: those that were flown while an earlier one decided."""
        with _told(self.path):
            self._connection.execute("DELETE FROM flights WHERE flight >= ?", (flight,))

    def outcomes(self) -> dict[int, str]:
        """Outcome by index of all flights."""
        return dict(self._connection.execute("SELECT flight, outcome FROM flights ORDER BY flight"))

    def tally(self) -> Tally:
        """How many flights came out how."""
        counts = dict(self._connection.execute("SELECT outcome, COUNT(*) FROM flights GROUP BY outcome"))
        return Tally(counts.get("flyable", 0), counts.get("not flyable", 0), counts.get("lost", 0))

    def column(self, name: str) -> NDArray[np.float64]:
        """(n,) a column of numbers, in the order of flights; NaN for none."""
        rows = self._connection.execute(f"SELECT {_known(name)} FROM flights ORDER BY flight")
        return np.fromiter((math.nan if value is None else value for (value,) in rows), dtype=np.float64)

    def texts(self, name: str) -> list[str]:
        """A column of words, in the order of flights."""
        return [
            str(value) for (value,) in self._connection.execute(f"SELECT {_known(name)} FROM flights ORDER BY flight")
        ]

    def blobs(self, name: str, most: int) -> list[bytes]:
        """A column of arrays' bytes, of the first flights that have some."""
        query = f"SELECT {_known(name)} FROM flights WHERE LENGTH({name}) > 0 ORDER BY flight LIMIT ?"
        return [value for (value,) in self._connection.execute(query, (most,))]

    def has_track(self) -> list[bool]:
        """Whether each flight, in order, has a track's shape."""
        return [bool(n) for (n,) in self._connection.execute("SELECT LENGTH(clearance) FROM flights ORDER BY flight")]

    def closest(self, most: int) -> list[FlightRow]:
        """The worst flights first: the lost, those that failed, then the closest calls, each by its least margin."""
        order = "CASE outcome WHEN 'lost' THEN 0 WHEN 'not flyable' THEN 1 ELSE 2 END, closeness IS NULL, closeness"
        rows = self._connection.execute(f"SELECT * FROM flights ORDER BY {order}, flight LIMIT ?", (most,))
        return [_row(values) for values in rows]

    def flight(self, index: int) -> FlightRow | None:
        """The flight of an index; None where there is none."""
        found = self._connection.execute("SELECT * FROM flights WHERE flight = ?", (index,)).fetchone()
        return None if found is None else _row(found)

    def rows(self) -> Iterator[FlightRow]:
        """All flights in order."""
        for values in self._connection.execute("SELECT * FROM flights ORDER BY flight"):
            yield _row(values)


def read_table(path: Path) -> dict[str, list[Any]]:
    """The columns of a campaign's table by name, in the order of flights, without holding it.

    Raises StoreError for a file that is none of ours or is held.
    """
    with _told(path):
        connection = sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=1.0)
        try:
            rows = connection.execute("SELECT * FROM flights ORDER BY flight").fetchall()
        finally:
            connection.close()
    return {name: list(values) for name, values in zip(COLUMNS, zip(*rows, strict=True), strict=True)} if rows else {}


class _told:
    """Tell SQLite's errors as ours: a full disk as OSError, the rest as StoreError."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> None:
        pass

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not isinstance(error, sqlite3.Error):
            return
        code = getattr(error, "sqlite_errorcode", None)
        if code is not None and code & 0xFF == sqlite3.SQLITE_FULL:
            raise OSError(errno.ENOSPC, "no space left; the flights before are kept, --resume goes on", str(self._path))
        if code is not None and code & 0xFF in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
            raise StoreError(f"{self._path}: is held by another process", file=self._path) from error
        raise StoreError(f"{self._path}: {error}", file=self._path) from error


def _known(name: str) -> str:
    if name not in COLUMNS:
        raise KeyError(name)
    return name


def _values(row: FlightRow, made_of: str) -> list[Any]:
    margins: dict[str, Any] = dict.fromkeys(_MARGINS)
    for rule, margin in row.margins:
        margins[f"margin_{rule}"] = margin.value
        margins[f"place_{rule}"] = json.dumps({"unit": margin.unit, **asdict(margin.place)})
    values = {
        "flight": row.draw.index,
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
    return [values[name] for name in COLUMNS]


def _row(values: tuple[Any, ...]) -> FlightRow:
    known = dict(zip(COLUMNS, values, strict=True))
    margins = []
    for rule in RULES:
        if (place := known[f"place_{rule}"]) is not None:
            data = json.loads(place)
            margins.append((rule, LeastMargin(known[f"margin_{rule}"], data.pop("unit"), Place(**data))))
    failed = []
    for entry in json.loads(known["failed"]):
        rule = entry.pop("rule")
        failed.append((rule, Place(**entry)))
    return FlightRow(
        draw=Draw(known["flight"], known["seed"], {name: known[name] for name in NAMES}),
        outcome=known["outcome"],
        ended=known["ended"],
        failed=tuple(failed),
        margins=tuple(margins),
        energy_left=known["energy_left"],
        duration=known["duration"],
        clearance=known["clearance"],
        crossings=known["crossings"],
        seconds=known["seconds"],
        worker=known["worker"],
    )


def same_flight(one: FlightRow, other: FlightRow) -> bool:
    """Whether two rows tell of the same flight, whoever flew it and however long that took."""
    mine, theirs = (_values(row, "") for row in (one, other))
    left_out = {COLUMNS.index(name) for name in NOT_THE_SAME}
    return all(a == b for k, (a, b) in enumerate(zip(mine, theirs, strict=True)) if k not in left_out)
