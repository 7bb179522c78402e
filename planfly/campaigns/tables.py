"""The tables of flights, SQLite files written as flights come in, and read back as rows or as columns.

A campaign's table has a row a flight, by the index of its draw; a search for winds has one a flight, in the order in
which it asked.  One process at a time holds a table, and opening it leaves only rows whose checksum holds.
"""

import errno
import hashlib
import json
import math
import os
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from logs.verdict.places import Place
from logs.verdict.rule_words import RULE_WORDS
from planfly.campaigns.dispersions import NAMES, Draw
from planfly.campaigns.flight_row import FIELDS, FlightRow, LeastMargin, NarrowPass, Outcome, failed_of
from planfly.campaigns.statistics.decision import Tally
from planfly.campaigns.table_repair import HELD, checksum, copy_whole, examine, stored
from planfly.runtime.stages import say
from world.errors import PlanflyError

# ----------------------------------------------------------------------
# A flight's row as values of the table's columns, and back: all follows from `FlightRow`, `RULE_WORDS` and `NAMES`.

# Columns that a second campaign of the same flights may have otherwise.
RUN_DEPENDENT_COLUMNS = tuple(name for name, column in FIELDS.items() if not column.same)
# Arrays as bytes.
SHAPES = tuple(name for name, column in FIELDS.items() if column.kind.startswith("BLOB"))


def _row_columns() -> dict[str, str]:
    """Return name and kind of each column of a row, in the order of the row's fields."""
    columns = {"seed": "INTEGER NOT NULL", **dict.fromkeys(NAMES, "REAL NOT NULL")}
    for name in FlightRow.__dataclass_fields__:
        if name in FIELDS:
            columns[name] = FIELDS[name].kind
        elif name == "margins":
            for rule in RULE_WORDS.values():
                columns |= {rule.margin_column: "REAL", rule.place_column: "TEXT"}
            columns["closeness"] = "REAL"
    return columns


# Of a row, but for the flight's number.
ROW_COLUMNS = _row_columns()


def row_values(row: FlightRow) -> dict[str, Any]:
    """Return a value for each of `ROW_COLUMNS`."""
    values: dict[str, Any] = dict.fromkeys(ROW_COLUMNS)
    values |= {"seed": row.draw.seed, **row.draw.values}
    values |= {name: column.write(getattr(row, name)) for name, column in FIELDS.items()}
    values["closeness"] = row.closeness if math.isfinite(row.closeness) else None
    for name, margin in row.margins:
        rule = RULE_WORDS[name]
        values[rule.margin_column] = margin.value
        values[rule.place_column] = json.dumps({"unit": margin.unit, **asdict(margin.place)})
    return values


def row_of(index: int, known: Mapping[str, Any]) -> FlightRow:
    """Return the row of a draw's index and its values by column."""
    margins = []
    for rule in RULE_WORDS.values():
        if (place := known[rule.place_column]) is not None:
            data = json.loads(place)
            margins.append((rule.name, LeastMargin(known[rule.margin_column], data.pop("unit"), Place(**data))))
    return FlightRow(
        draw=Draw(index, known["seed"], {name: known[name] for name in NAMES}),
        margins=tuple(margins),
        **{name: column.read(known[name]) for name, column in FIELDS.items()},
    )


def same_flight(one: FlightRow, other: FlightRow) -> bool:
    """Return True if two rows hold the same flight, apart from where and how fast it was flown."""
    mine, theirs = (row_values(replace(row, made_of="")) for row in (one, other))
    same = all(mine[name] == theirs[name] for name in ROW_COLUMNS if name not in RUN_DEPENDENT_COLUMNS)
    return same and one.draw.index == other.draw.index


# ----------------------------------------------------------------------
# The file: made or opened to go on, locked by one process, and refused where it holds something else.

# Flights of a table whose settings do not say how many it may have, and of a broken one beyond what they say.
_MAX_FLIGHTS = 100_000


class StoreError(PlanflyError):
    """The table of a campaign cannot be opened, or is another campaign's."""


@dataclass(frozen=True)
class TableKind:
    """Content of a file of this kind.

    name: of the schema.
    columns: of the table of flights, name and kind of each; the first is the key, a flight's number.  A checksum of
    them follows.
    fixed: what of the settings may not be otherwise where it is gone on with.
    """

    name: str
    columns: Mapping[str, str]
    fixed: tuple[str, ...] = ()

    @property
    def schema(self) -> str:
        """The schema kept in the file: its name, and as its version a digest of the columns.

        >>> TableKind("t", {"a": "REAL"}).schema == TableKind("t", {"a": "REAL", "b": "REAL"}).schema
        False
        """
        columns = json.dumps([*self.columns.items(), "checksum"])
        return f"{self.name}/{hashlib.sha256(columns.encode()).hexdigest()[:8]}"


class LockedTable:
    """The table of a campaign or of a search, held until it is left.

    made_of: hash of code, model, mission, scenario, dispersions and seed; flights with another one are refused.
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
            with translated_errors(path):
                self._prepare(settings)
            self._file = path.stat()
        except BaseException:
            self._connection.close()
            raise

    def _prepare(self, settings: dict[str, Any]) -> None:
        self._hold()
        run = self._connection.execute
        tables = {name for (name,) in run("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if tables:
            known = _kept(self._connection) if "campaign" in tables else {}
            self._refuse_other(known, settings)
            self._mend(known)
        run = self._connection.execute
        for statement in self._create():
            run(statement)
        # Before the new settings are written: those of a refused question would stay.
        self._refuse_more(settings)
        values = {
            "schema": self._kind.schema,
            "made_of": self.made_of,
            "settings": json.dumps(settings, sort_keys=True),
        }
        run("DELETE FROM campaign")
        self._connection.executemany(
            "INSERT INTO campaign VALUES (?, ?)", {**values, "checksum": checksum(values.values())}.items()
        )
        run("COMMIT")

    def _hold(self) -> None:
        """Take the file for this process alone, and begin to write."""
        run = self._connection.execute
        run("PRAGMA locking_mode = EXCLUSIVE")
        run("PRAGMA journal_mode = WAL")
        run("PRAGMA synchronous = NORMAL")
        run("BEGIN EXCLUSIVE")

    def _create(self) -> list[str]:
        columns = ", ".join(f"{name} {kind}" for name, kind in self._kind.columns.items())
        return [
            f"CREATE TABLE IF NOT EXISTS flights ({columns}, checksum TEXT NOT NULL)",
            "CREATE TABLE IF NOT EXISTS campaign (key TEXT PRIMARY KEY, value TEXT NOT NULL)",
        ]

    def _refuse_other(self, known: dict[str, str], settings: dict[str, Any]) -> None:
        schema = self._kind.schema
        if "schema" not in known:
            _refuse_damaged(known, self.path)
        if known.get("schema") != schema:
            raise StoreError(f"{self.path}: schema {known.get('schema')!r}: {schema} is expected", file=self.path)
        _refuse_damaged(known, self.path)
        if known.get("made_of") != self.made_of:
            raise StoreError(
                f"{self.path}: is of another campaign: its code, mission, aircraft, scenario, dispersions or seed"
                f" differs ({known.get('made_of')}, not {self.made_of})",
                file=self.path,
            )
        before = json.loads(known["settings"])
        for name in self._kind.fixed:
            if before[name] != settings[name]:
                raise StoreError(
                    f"{self.path}: {name} {settings[name]}: the flights there were asked for with {before[name]}",
                    file=self.path,
                )

    def _mend(self, known: dict[str, str]) -> None:
        """Keep the flights that are whole, report the others, and write the file again."""
        # A search may have been asked for fewer flights than are there: those beyond are kept, too.
        asked = json.loads(known["settings"]).get("flights", _MAX_FLIGHTS)
        examined = examine(self._connection, tuple(self._kind.columns), asked, max(asked, self._last() + 1))
        if examined.sound and not examined.damaged:
            return
        mended = self.path.with_name(f".{self.path.name}.mended")
        copy_whole(self._connection, mended, self._create(), examined.whole, known)
        self._connection.close()
        mended.replace(self.path)
        for ending in ("-wal", "-shm"):
            Path(f"{self.path}{ending}").unlink(missing_ok=True)
        self._connection = sqlite3.connect(self.path, timeout=1.0, isolation_level=None)
        self._hold()
        say(f"{self.path}: {examined.text()}")

    def _last(self) -> int:
        """Return the largest number of a flight that can be read, one after the other; -1 for none."""
        last = -1
        for order in ("", " DESC"):
            with suppress(sqlite3.Error, UnicodeDecodeError):
                for (number,) in self._connection.execute(f"SELECT flight FROM flights ORDER BY flight{order}"):
                    # That of a damaged page may be any.
                    if isinstance(number, int) and number < _MAX_FLIGHTS:
                        last = max(last, number)
                        if order:
                            break
        return last

    def _refuse_more(self, settings: Mapping[str, Any]) -> None:
        """Refuse more flights than may be there.  Raises StoreError."""

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

        Raises OSError for a full disk; what was written before stays.  Raises OSError for a table that was removed, and
        StoreError for a number that is there.
        """
        self._refuse_removed()
        with translated_errors(self.path):
            row = [stored(values[name], kind) for name, kind in self._kind.columns.items()]
            marks = ", ".join("?" * (len(row) + 1))
            self._connection.execute(f"INSERT INTO flights VALUES ({marks})", [*row, checksum(row)])

    def drop_from(self, flight: int) -> None:
        """Take out the flights from this number on: those that were flown while an earlier one decided.

        Raises OSError for a table that was removed.
        """
        self._refuse_removed()
        with translated_errors(self.path):
            self._connection.execute("DELETE FROM flights WHERE flight >= ?", (flight,))

    def _refuse_removed(self) -> None:
        """Refuse to write into a file that has lost its name: on POSIX that works, and all of it is lost at the end."""
        try:
            there = os.path.samestat(self.path.stat(), self._file)
        except OSError:
            there = False
        if not there:
            words = "was removed, or another file took its place: the flights that were written into it are lost"
            raise OSError(errno.EIO, words, str(self.path))

    def tally(self) -> Tally:
        """Return how many flights came out how."""
        counts = dict(self._connection.execute("SELECT outcome, COUNT(*) FROM flights GROUP BY outcome"))
        return Tally(counts.get("flyable", 0), counts.get("not flyable", 0), counts.get("lost", 0))


def kept_settings(path: Path) -> dict[str, Any]:
    """Return what the flights of a table were asked for with; nothing where there is no such file.

    Raises StoreError for a file that is none of ours or is held.
    """
    if not path.is_file():
        return {}
    with translated_errors(path), closing(sqlite3.connect(path, timeout=1.0)) as connection:
        known = _kept(connection)
    if known:
        _refuse_damaged(known, path)
    return json.loads(known["settings"]) if known else {}


def _kept(connection: sqlite3.Connection) -> dict[str, str]:
    """Return what a file says of itself, by key."""
    connection.text_factory = lambda data: data.decode("utf-8", "surrogateescape")
    return dict(connection.execute("SELECT key, value FROM campaign").fetchall())


def _refuse_damaged(known: Mapping[str, str], path: Path) -> None:
    """Refuse a file with settings that planfly did not write.  Raises StoreError."""
    if known.get("checksum") != checksum(known.get(name) for name in ("schema", "made_of", "settings")):
        words = "its settings are damaged, or another version's: it cannot be resumed, and --overwrite begins anew"
        raise StoreError(f"{path}: {words}", file=path, field="settings")


def refuse_held(path: Path) -> None:
    """Refuse a table that another process holds; no process holds a missing file.  Raises StoreError."""
    if not path.is_file():
        return
    connection = sqlite3.connect(path, timeout=1.0, isolation_level=None)
    try:
        connection.execute("BEGIN EXCLUSIVE")
    except sqlite3.Error as error:
        if getattr(error, "sqlite_errorcode", sqlite3.SQLITE_NOTADB) & 0xFF in HELD:
            raise StoreError(f"{path}: is held by another process", file=path) from error
    finally:
        connection.close()


class translated_errors:
    """Raises SQLite's errors about a file as planfly's: a full disk as OSError, the rest as StoreError."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> None:
        """Nothing to do before."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Raise planfly's error for SQLite's."""
        if isinstance(error, UnicodeDecodeError):
            # SQLite quotes what it does not understand of its own tables' definition.
            raise StoreError(f"{self._path}: is damaged where it says which tables it has", file=self._path) from error
        if not isinstance(error, sqlite3.Error):
            return
        code = getattr(error, "sqlite_errorcode", None)
        if code is not None and code & 0xFF == sqlite3.SQLITE_FULL:
            raise OSError(errno.ENOSPC, "no space left; the flights before are kept, --resume goes on", str(self._path))
        if code is not None and code & 0xFF in HELD:
            raise StoreError(f"{self._path}: is held by another process", file=self._path) from error
        raise StoreError(f"{self._path}: {error}", file=self._path) from error


# ----------------------------------------------------------------------
# The table of a campaign: a row a flight, read by its index.

DATABASE = "campaign.sqlite"
CAMPAIGN_KIND = TableKind("planfly.campaign", {"flight": "INTEGER PRIMARY KEY", **ROW_COLUMNS})
COLUMNS = tuple(CAMPAIGN_KIND.columns)
_SELECT = f"SELECT {', '.join(COLUMNS)} FROM flights"


class Store(LockedTable):
    """A campaign's table, held by one process at a time; a flight's number is its draw's index."""

    def __init__(self, path: Path, made_of: str, settings: dict[str, Any], *, resume: bool) -> None:
        """Make the table, or open it to go on; as `LockedTable`, and never for fewer flights than are there."""
        super().__init__(path, CAMPAIGN_KIND, made_of, settings, resume=resume)

    def _refuse_more(self, settings: Mapping[str, Any]) -> None:
        if (flown := self.tally().flown) > settings.get("flights", math.inf):
            words = f"flights {settings['flights']}: {flown} have been flown there"
            raise StoreError(f"{self.path}: {words}", file=self.path)

    def add(self, row: FlightRow) -> None:
        """Write a flight, for good.  Raises OSError for a full disk; what was written before stays."""
        self.insert({"flight": row.draw.index, **row_values(replace(row, made_of=self.made_of))})

    def outcomes(self) -> dict[int, str]:
        """Outcome by index of all flights."""
        return dict(self._connection.execute("SELECT flight, outcome FROM flights ORDER BY flight"))

    def column(self, name: str) -> NDArray[np.float64]:
        """(n,) a column of numbers, in the order of flights; NaN for none."""
        rows = self._connection.execute(f"SELECT {_known(name)} FROM flights ORDER BY flight")
        return np.fromiter((math.nan if value is None else value for (value,) in rows), dtype=np.float64)

    def texts(self, name: str) -> list[str]:
        """Return a column of words, in the order of flights."""
        return [
            str(value) for (value,) in self._connection.execute(f"SELECT {_known(name)} FROM flights ORDER BY flight")
        ]

    def blobs(self, name: str, most: int) -> list[bytes]:
        """Return a column of arrays' bytes, of the first flights that have some."""
        query = f"SELECT {_known(name)} FROM flights WHERE LENGTH({name}) > 0 ORDER BY flight LIMIT ?"
        return [value for (value,) in self._connection.execute(query, (most,))]

    def has_track(self) -> list[bool]:
        """Return True if each flight, in order, has a track's shape."""
        return [bool(n) for (n,) in self._connection.execute("SELECT LENGTH(clearance) FROM flights ORDER BY flight")]

    def closest(self, most: int) -> list[FlightRow]:
        """The worst flights first: the lost, those that failed, then the closest calls, each by its least margin."""
        order = "CASE outcome WHEN 'lost' THEN 0 WHEN 'not flyable' THEN 1 ELSE 2 END, closeness IS NULL, closeness"
        rows = self._connection.execute(f"{_SELECT} ORDER BY {order}, flight LIMIT ?", (most,))
        return [_row(values) for values in rows]

    def flight(self, index: int) -> FlightRow | None:
        """Return the flight of an index; None where there is none."""
        found = self._connection.execute(f"{_SELECT} WHERE flight = ?", (index,)).fetchone()
        return None if found is None else _row(found)

    def rows(self) -> Iterator[FlightRow]:
        """Yield all flights in order."""
        for values in self._connection.execute(f"{_SELECT} ORDER BY flight"):
            yield _row(values)


def _known(name: str) -> str:
    if name not in COLUMNS:
        raise KeyError(name)
    return name


def _row(values: tuple[Any, ...]) -> FlightRow:
    known = dict(zip(COLUMNS, values, strict=True))
    return row_of(known["flight"], known)


# ----------------------------------------------------------------------
# The table of a search for the largest winds: a row a flight, numbered in the order in which they are asked for.

WINDS_DATABASE = "winds.sqlite"
# What decides which flights are asked for; of the number of flights, only how many are.
FIXED = ("target", "confidence", "directions", "most")
WINDS_KIND = TableKind(
    "planfly.winds-flights",
    {
        "flight": "INTEGER PRIMARY KEY",
        "direction": "INTEGER NOT NULL",
        "asked_speed": "REAL NOT NULL",
        "draw": "INTEGER NOT NULL",
        "narrow": "TEXT NOT NULL",
        **ROW_COLUMNS,
    },
    FIXED,
)


@dataclass(frozen=True, slots=True)
class AskedFlight:
    """A flight that a search asks for.

    number: in the order of the search.
    direction: counted from the north.  speed: of the mean wind, m/s.
    draw: index of what varies about that wind; the same in all directions.
    """

    number: int
    direction: int
    speed: float
    draw: int


@dataclass(frozen=True, slots=True)
class FlownFlight:
    """Outcome of a flight, rule and place of each failed finding, and its narrow passes."""

    outcome: Outcome
    failed: tuple[tuple[str, Place], ...]
    narrow: tuple[NarrowPass, ...] = ()


class WindsStore(LockedTable):
    """A search's table, held by one process at a time."""

    def __init__(self, path: Path, made_of: str, settings: dict[str, Any], *, resume: bool) -> None:
        """Make the table, or open it to go on with the same question; settings: with `FIXED` among them."""
        super().__init__(path, WINDS_KIND, made_of, settings, resume=resume)

    def add(self, asked: AskedFlight, row: FlightRow) -> None:
        """Write a flight, for good.  Raises OSError for a full disk; what was written before stays."""
        asked_for = {
            "flight": asked.number,
            "direction": asked.direction,
            "asked_speed": asked.speed,
            "draw": asked.draw,
            "narrow": json.dumps([{"rule": rule, "margin": left, **asdict(place)} for rule, place, left in row.narrow]),
        }
        self.insert({**asked_for, **row_values(replace(row, made_of=self.made_of))})

    def known(self) -> dict[int, tuple[AskedFlight, FlownFlight]]:
        """Return each flight there is and what came of it, by number."""
        rows = self._connection.execute(
            "SELECT flight, direction, asked_speed, draw, outcome, failed, narrow FROM flights ORDER BY flight"
        )
        return {
            number: (AskedFlight(number, *asked), FlownFlight(outcome, failed_of(failed), narrow_passes_of(narrow)))
            for number, *asked, outcome, failed, narrow in rows
        }


def narrow_passes_of(text: str) -> tuple[NarrowPass, ...]:
    """Narrow passes of the column's text.

    >>> narrow_passes_of('[{"rule": "slope", "margin": 0.25, "kind": "leg", "index": 3}]')[0][2]
    0.25
    """
    return tuple(_narrow_pass(**entry) for entry in json.loads(text))


def _narrow_pass(rule: str, margin: float, **place: Any) -> NarrowPass:
    return rule, Place(**place), margin


# ----------------------------------------------------------------------
# The table of a campaign as columns, read without holding it and without what no table of numbers needs.

# Rows that are turned into arrays at a time.
_CHUNK = 1000
_TYPES: dict[str, type] = {"INTEGER": np.int64, "REAL": np.float64, "TEXT": object}


def read_table(path: Path) -> dict[str, NDArray[Any]]:
    """Return the columns of a campaign's table by name, (n,) each, in the order of flights; of arrays' bytes none.

    Numbers are float64 with NaN for none, or int64; words are Python's, None for none, each kept once.  Some 60 MB for
    100,000 flights.
    Raises StoreError for a file that is none of ours or is held.
    """
    names = tuple(name for name in CAMPAIGN_KIND.columns if name not in SHAPES)
    with _opened(path) as connection:
        (count,) = connection.execute("SELECT COUNT(*) FROM flights").fetchone()
        table = {name: np.empty(count, dtype=_TYPES[CAMPAIGN_KIND.columns[name].split()[0]]) for name in names}
        words: dict[str | None, str | None] = {}
        cursor = connection.execute(f"SELECT {', '.join(names)} FROM flights ORDER BY flight")
        for start in range(0, count, _CHUNK):
            for name, values in zip(names, zip(*cursor.fetchmany(_CHUNK), strict=True), strict=True):
                column = table[name]
                some = [words.setdefault(one, one) for one in values] if column.dtype == object else values
                column[start : start + len(values)] = some
    return table


def count_flights(path: Path) -> int:
    """Return the number of flights in a table of either kind.  Raises StoreError for a foreign or a locked file."""
    with _opened(path) as connection:
        return int(connection.execute("SELECT COUNT(*) FROM flights").fetchone()[0])


def read_shapes(path: Path) -> dict[str, NDArray[np.float32]]:
    """Return what a campaign keeps of each flight's way, in the order of flights; NaN for flights that have none.

    "clearance": (n, 150) least height above ground on each equal piece of the route's length, m.
    "crossings": (n, s, 2) distance right of and above each stop of the route at its nearest, m.
    Raises StoreError for a file that is none of ours or is held.
    """
    with _opened(path) as connection:
        return {name: _singles(connection, name, FIELDS[name].entry) for name in SHAPES}


def _singles(connection: sqlite3.Connection, name: str, entry: tuple[int, ...]) -> NDArray[np.float32]:
    """(n, m, *entry) the arrays of a column, m the longest one's length."""
    count, size = connection.execute(f"SELECT COUNT(*), MAX(LENGTH({name})) FROM flights").fetchone()
    found = np.full((count, (size or 0) // np.dtype(np.float32).itemsize), np.nan, dtype=np.float32)
    for row, (data,) in zip(found, connection.execute(f"SELECT {name} FROM flights ORDER BY flight"), strict=True):
        if data:
            known = np.frombuffer(data, np.float32)
            row[: known.size] = known
    return found.reshape(count, found.shape[1] // math.prod(entry), *entry)


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    # Nothing is written; but a connection that may write removes its -wal and -shm files when it closes.
    with (
        translated_errors(path),
        closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=rw", uri=True, timeout=1.0)) as connection,
    ):
        yield connection
