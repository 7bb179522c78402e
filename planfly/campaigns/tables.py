"""Tables of flights: SQLite files that are written flight by flight, and read as rows or as columns.

The table of a campaign has one row per flight, keyed by the index of its draw. The table of a search for winds has one
row per flight, in the order of requests. One process at a time can lock a table; opening a table drops all rows with a
wrong checksum.
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
from planfly.campaigns.campaign_inputs import describe_differences
from planfly.campaigns.dispersions import NAMES, Draw
from planfly.campaigns.flight_row import (
    COLUMN_FIELDS,
    OUTCOMES,
    FlightRow,
    MarginalPass,
    MinimumMargin,
    Outcome,
    parse_failed_findings,
)
from planfly.campaigns.statistics.decision import Tally
from planfly.campaigns.table_repair import LOCKED_CODES, checksum, copy_undamaged_rows, examine_table, stored_value
from planfly.runtime.stages import report_line
from world.errors import PlanflyError
from world.wording import count_text

# ----------------------------------------------------------------------
# Convert a flight's row to values of the table's columns and back; `FlightRow`, `RULE_WORDS` and `NAMES` define these.

# Columns that may differ between two campaigns with the same flights.
RUN_DEPENDENT_COLUMNS = tuple(name for name, column in COLUMN_FIELDS.items() if not column.same)
# Columns with arrays, stored as bytes.
ARRAY_COLUMNS = tuple(name for name, column in COLUMN_FIELDS.items() if column.kind.startswith("BLOB"))


def _row_columns() -> dict[str, str]:
    """Return the SQL types of a row's columns by name, in the order of the fields of `FlightRow`."""
    columns = {"seed": "INTEGER NOT NULL", **dict.fromkeys(NAMES, "REAL NOT NULL")}
    for name in FlightRow.__dataclass_fields__:
        if name in COLUMN_FIELDS:
            columns[name] = COLUMN_FIELDS[name].kind
        elif name == "margins":
            for rule in RULE_WORDS.values():
                columns |= {rule.margin_column: "REAL", rule.place_column: "TEXT"}
            columns["closeness"] = "REAL"
    return columns


# Columns of a row, without the flight's number.
ROW_COLUMNS = _row_columns()


def row_values(row: FlightRow) -> dict[str, Any]:
    """Return the stored value of each column of `ROW_COLUMNS` for a flight, keyed by column name."""
    values: dict[str, Any] = dict.fromkeys(ROW_COLUMNS)
    values |= {"seed": row.draw.seed, **row.draw.values}
    values |= {name: column.write(getattr(row, name)) for name, column in COLUMN_FIELDS.items()}
    values["closeness"] = row.closeness if math.isfinite(row.closeness) else None
    for name, margin in row.margins:
        rule = RULE_WORDS[name]
        values[rule.margin_column] = margin.value
        values[rule.place_column] = json.dumps({"unit": margin.unit, **asdict(margin.place)})
    return values


def make_flight_row(index: int, values: Mapping[str, Any]) -> FlightRow:
    """Make the row of a flight from its stored values; the inverse of `row_values`.

    index: index of the flight's draw.
    values: stored value of each column, keyed by the column's name.
    """
    margins = []
    for rule in RULE_WORDS.values():
        if (place_json := values[rule.place_column]) is not None:
            data = json.loads(place_json)
            margins.append((rule.name, MinimumMargin(values[rule.margin_column], data.pop("unit"), Place(**data))))
    return FlightRow(
        draw=Draw(index, values["seed"], {name: values[name] for name in NAMES}),
        margins=tuple(margins),
        **{name: column.read(values[name]) for name, column in COLUMN_FIELDS.items()},
    )


def is_same_flight(first: FlightRow, second: FlightRow) -> bool:
    """Return True if two rows have the same draw and agree in all columns of `differing_columns`."""
    return first.draw.index == second.draw.index and not differing_columns(first, second)


def differing_columns(first: FlightRow, second: FlightRow) -> list[str]:
    """Return the names of the columns in which two rows differ; `RUN_DEPENDENT_COLUMNS` are not compared."""
    first_values, second_values = (row_values(replace(row, made_of="")) for row in (first, second))
    return [
        name for name in ROW_COLUMNS if name not in RUN_DEPENDENT_COLUMNS and first_values[name] != second_values[name]
    ]


# ----------------------------------------------------------------------
# Create the file or open it to resume, lock it for one process, and refuse other contents.

# Maximum number of flights in a table without this setting, and maximum flight number in a damaged table.
_MAX_FLIGHTS = 100_000


# Number of pages in the write-ahead log (the file's name with -wal) after which they are copied into the file itself.
# A copy of the file alone, also of a killed campaign, then lacks at most the last eight flights.  It takes about 1 ms
# per flight.
_CHECKPOINT_PAGES = 16


class StoreError(PlanflyError):
    """Raised if the table of a campaign cannot be opened, or belongs to another campaign."""


@dataclass(frozen=True)
class TableKind:
    """Kind of a table file.

    name: name of the schema.
    columns: SQL type of each column of the table of flights, by name; the first column is the key, the number of the
        flight.  A column with a checksum of all columns is added at the end.
    fixed: settings that must stay the same when the table is resumed.
    """

    name: str
    columns: Mapping[str, str]
    fixed: tuple[str, ...] = ()

    @property
    def schema(self) -> str:
        """Schema stored in the file: its name, and a digest of the columns as its version.

        >>> TableKind("t", {"a": "REAL"}).schema == TableKind("t", {"a": "REAL", "b": "REAL"}).schema
        False
        """
        columns = json.dumps([*self.columns.items(), "checksum"])
        return f"{self.name}/{hashlib.sha256(columns.encode()).hexdigest()[:8]}"


class LockedTable:
    """Table of a campaign or of a search for winds, locked until the context ends.

    made_of: hash of code, model, mission, scenario, dispersions and seed; flights with another hash are refused.
    """

    def __init__(self, path: Path, kind: TableKind, made_of: str, settings: dict[str, Any], *, resume: bool) -> None:
        """Create the table, or open it to resume.

        kind: columns and fixed settings of the table.
        settings: settings of the request, which are stored in the file.
        resume: True to open an existing table, which must be there.
        Raises StoreError for a file of another kind or campaign, and for a file that another process has locked.
        Raises OSError for a full disk.
        """
        self.path, self.made_of, self._kind = path, made_of, kind
        if resume and not path.is_file():
            raise StoreError(f"{path}: no such campaign to resume", file=path)
        self._connection = sqlite3.connect(path, timeout=1.0, isolation_level=None)
        try:
            with convert_errors(path):
                self._prepare_file(settings)
            self._file = path.stat()
        except BaseException:
            self._connection.close()
            raise

    def _prepare_file(self, settings: dict[str, Any]) -> None:
        """Lock the file, check and repair an existing table, and write the settings.

        Raises StoreError for a table of another campaign, or with more flights than requested.
        """
        self._lock_file()
        tables = {name for (name,) in self._connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if tables:
            stored_settings = _read_settings(self._connection) if "campaign" in tables else {}
            schema = stored_settings.get("schema")
            if schema is None:
                _check_settings_intact(stored_settings, self.path)
            if schema != self._kind.schema:
                raise StoreError(f"{self.path}: schema {schema!r}: expected {self._kind.schema}", file=self.path)
            _check_settings_intact(stored_settings, self.path)
            stored_request = json.loads(stored_settings["settings"])
            if stored_settings.get("made_of") != self.made_of:
                inputs = [json.loads(json.dumps(request.get("inputs", {}))) for request in (stored_request, settings)]
                differences = describe_differences(*inputs) or "planfly's code differs"
                raise StoreError(f"{self.path}: contains a campaign with other settings: {differences}", file=self.path)
            for name in self._kind.fixed:
                if stored_request[name] != settings[name]:
                    raise StoreError(
                        f"{self.path}: {name} {settings[name]}: the campaign in this file has"
                        f" {stored_request[name]}; resume it with the same value, or name another folder",
                        file=self.path,
                    )
            self._repair_file(stored_settings)
        # Use the connection only from here, because a repair opens another one.
        execute = self._connection.execute
        for statement in self._create_statements():
            execute(statement)
        # Refuse the request before its settings are written, because they would stay in the file.
        self._check_flight_count(settings)
        values = {
            "schema": self._kind.schema,
            "made_of": self.made_of,
            "settings": json.dumps(settings, sort_keys=True),
        }
        execute("DELETE FROM campaign")
        self._connection.executemany(
            "INSERT INTO campaign VALUES (?, ?)", {**values, "checksum": checksum(values.values())}.items()
        )
        execute("COMMIT")
        execute("PRAGMA wal_checkpoint")

    def _lock_file(self) -> None:
        """Lock the file for this process, and start a transaction."""
        execute = self._connection.execute
        execute("PRAGMA locking_mode = EXCLUSIVE")
        execute("PRAGMA journal_mode = WAL")
        execute(f"PRAGMA wal_autocheckpoint = {_CHECKPOINT_PAGES}")
        execute("PRAGMA synchronous = NORMAL")
        execute("BEGIN EXCLUSIVE")

    def _create_statements(self) -> list[str]:
        """Return the SQL statements that create the tables of flights and of settings."""
        columns = ", ".join(f"{name} {kind}" for name, kind in self._kind.columns.items())
        return [
            f"CREATE TABLE IF NOT EXISTS flights ({columns}, checksum TEXT NOT NULL)",
            "CREATE TABLE IF NOT EXISTS campaign (key TEXT PRIMARY KEY, value TEXT NOT NULL)",
        ]

    def _repair_file(self, stored_settings: dict[str, str]) -> None:
        """Rewrite a damaged file with its undamaged flights, and report the damaged flights.

        stored_settings: entries of the file's table ``campaign``, of which "settings" states the number of flights.
        """
        # A search may have been resumed with fewer flights than the table contains; all of them are kept.
        requested_count = json.loads(stored_settings["settings"]).get("flights", _MAX_FLIGHTS)
        # Largest flight number that can be read from either end of a damaged table; -1 without any.
        last_number = -1
        for order in ("", " DESC"):
            with suppress(sqlite3.Error, UnicodeDecodeError):
                for (number,) in self._connection.execute(f"SELECT flight FROM flights ORDER BY flight{order}"):
                    # A damaged page may contain any number.
                    if isinstance(number, int) and number < _MAX_FLIGHTS:
                        last_number = max(last_number, number)
                        if order:
                            break
        examination = examine_table(
            self._connection, tuple(self._kind.columns), requested_count, max(requested_count, last_number + 1)
        )
        if examination.is_sound and not examination.damaged:
            return
        repaired_path = self.path.with_name(f".{self.path.name}.mended")
        copy_undamaged_rows(
            self._connection, repaired_path, self._create_statements(), examination.undamaged, stored_settings
        )
        self._connection.close()
        repaired_path.replace(self.path)
        for ending in ("-wal", "-shm"):
            Path(f"{self.path}{ending}").unlink(missing_ok=True)
        self._connection = sqlite3.connect(self.path, timeout=1.0, isolation_level=None)
        self._lock_file()
        report_line(f"{self.path}: {examination.describe()}")

    def _check_flight_count(self, settings: Mapping[str, Any]) -> None:
        """Raise StoreError if the table contains more flights than requested; here, accept any number.

        The settings state the requested number.
        """

    def __enter__(self) -> Self:
        """Return the locked table."""
        return self

    def __exit__(
        self, error_type: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Release the table."""
        self._connection.close()

    def insert(self, values: Mapping[str, Any]) -> None:
        """Write the row of a flight durably.

        values: value of each column, keyed by the column's name.

        Raises OSError for a full disk or a removed table; earlier flights stay in the file. Raises StoreError for a
        number that the table already has.
        """
        self._check_not_removed()
        with convert_errors(self.path):
            row = [stored_value(values[name], kind) for name, kind in self._kind.columns.items()]
            placeholders = ", ".join("?" * (len(row) + 1))
            self._connection.execute(f"INSERT INTO flights VALUES ({placeholders})", [*row, checksum(row)])

    def delete_later_flights(self, first_number: int) -> None:
        """Delete the flights from `first_number` on, because an earlier flight decided the campaign.

        Raises OSError for a table that was removed.
        """
        self._check_not_removed()
        with convert_errors(self.path):
            self._connection.execute("DELETE FROM flights WHERE flight >= ?", (first_number,))

    def _check_not_removed(self) -> None:
        """Raise OSError if the file was deleted or replaced.

        On POSIX, writing to it would succeed, but the data would be lost.
        """
        try:
            is_same_file = os.path.samestat(self.path.stat(), self._file)
        except OSError:
            is_same_file = False
        if not is_same_file:
            reason = "was removed or replaced by another file: the flights written to it are lost"
            raise OSError(errno.EIO, reason, str(self.path))

    def tally(self) -> Tally:
        """Return the number of flights with each outcome."""
        counts = dict(self._connection.execute("SELECT outcome, COUNT(*) FROM flights GROUP BY outcome"))
        return Tally(*(counts.get(outcome, 0) for outcome in OUTCOMES))


def read_stored_settings(path: Path) -> dict[str, Any]:
    """Return the settings stored in a table; empty if the file does not exist.

    Raises StoreError for a file that planfly did not write, or that another process has locked.
    """
    if not path.is_file():
        return {}
    with convert_errors(path), closing(sqlite3.connect(path, timeout=1.0)) as connection:
        settings = _read_settings(connection)
    if settings:
        _check_settings_intact(settings, path)
    return json.loads(settings["settings"]) if settings else {}


def _read_settings(connection: sqlite3.Connection) -> dict[str, str]:
    """Return the entries of the table ``campaign``, keyed by name."""
    connection.text_factory = lambda data: data.decode("utf-8", "surrogateescape")
    return dict(connection.execute("SELECT key, value FROM campaign").fetchall())


def _check_settings_intact(settings: Mapping[str, str], path: Path) -> None:
    """Raise StoreError if the settings of a table do not have their checksum."""
    if settings.get("checksum") != checksum(settings.get(name) for name in ("schema", "made_of", "settings")):
        reason = (
            "its settings are damaged or written by another version: the campaign cannot be resumed;"
            " --overwrite starts again"
        )
        raise StoreError(f"{path}: {reason}", file=path, field="settings")


def check_not_locked(path: Path) -> None:
    """Raise StoreError if another process has locked a table; a missing file passes."""
    if not path.is_file():
        return
    connection = sqlite3.connect(path, timeout=1.0, isolation_level=None)
    try:
        connection.execute("BEGIN EXCLUSIVE")
    except sqlite3.Error as error:
        if getattr(error, "sqlite_errorcode", sqlite3.SQLITE_NOTADB) & 0xFF in LOCKED_CODES:
            raise StoreError(f"{path}: is locked by another process", file=path) from error
    finally:
        connection.close()


class convert_errors:
    """Context that converts SQLite errors about a file.

    A full disk becomes OSError, any other error StoreError.
    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> None:
        """Enter the context."""

    def __exit__(
        self, error_type: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Raise the converted SQLite error, if there is one."""
        if isinstance(error, UnicodeDecodeError):
            # SQLite quotes the parts of a table definition that it does not understand.
            raise StoreError(f"{self._path}: is damaged in the list of its tables", file=self._path) from error
        if not isinstance(error, sqlite3.Error):
            return
        code = getattr(error, "sqlite_errorcode", None)
        if code is not None and code & 0xFF == sqlite3.SQLITE_FULL:
            raise OSError(
                errno.ENOSPC, "no space left; finished flights are kept: continue with --resume", str(self._path)
            )
        if code is not None and code & 0xFF in LOCKED_CODES:
            raise StoreError(f"{self._path}: is locked by another process", file=self._path) from error
        raise StoreError(f"{self._path}: {error}", file=self._path) from error


# ----------------------------------------------------------------------
# Table of a campaign, with one row per flight, which is read by its index.

# Name of the file with the table of a campaign.
CAMPAIGN_DATABASE = "campaign.sqlite"
# Kind of the table of a campaign.
CAMPAIGN_KIND = TableKind("planfly.campaign", {"flight": "INTEGER PRIMARY KEY", **ROW_COLUMNS})
# Columns of the table of a campaign.
COLUMN_NAMES = tuple(CAMPAIGN_KIND.columns)
# Query for whole rows.
_SELECT_ROWS = f"SELECT {', '.join(COLUMN_NAMES)} FROM flights"


class Store(LockedTable):
    """Table of a campaign, locked by one process at a time.

    The number of a flight is the index of its draw.
    """

    def __init__(self, path: Path, made_of: str, settings: dict[str, Any], *, resume: bool) -> None:
        """Create the table, or open it to resume.

        made_of, settings, resume: as for `LockedTable`.
        Raises as `LockedTable`, and StoreError if the table contains more flights than requested.
        """
        super().__init__(path, CAMPAIGN_KIND, made_of, settings, resume=resume)

    def _check_flight_count(self, settings: Mapping[str, Any]) -> None:
        """Raise StoreError if the table contains more flights than the settings request."""
        if (flight_count := self.tally().flown) > settings.get("flights", math.inf):
            reason = f"flights {settings['flights']}: the table already contains {count_text(flight_count, 'flight')}"
            raise StoreError(f"{self.path}: {reason}", file=self.path)

    def add(self, row: FlightRow) -> None:
        """Write a flight durably. Raises OSError for a full disk; earlier flights stay in the file."""
        self.insert({"flight": row.draw.index, **row_values(replace(row, made_of=self.made_of))})

    def outcomes(self) -> dict[int, str]:
        """Return the outcome of each flight, keyed by index."""
        return dict(self._connection.execute("SELECT flight, outcome FROM flights ORDER BY flight"))

    def column(self, name: str) -> NDArray[np.float64]:
        """Return a column of numbers by its name, in the order of flights, (n,); a missing value is NaN."""
        rows = self._connection.execute(f"SELECT {_check_column(name)} FROM flights ORDER BY flight")
        return np.fromiter((math.nan if value is None else value for (value,) in rows), dtype=np.float64)

    def texts(self, name: str) -> list[str]:
        """Return a column of texts by its name, in the order of flights."""
        return [
            str(value)
            for (value,) in self._connection.execute(f"SELECT {_check_column(name)} FROM flights ORDER BY flight")
        ]

    def failures(self) -> list[tuple[tuple[str, Place], ...]]:
        """Return, for each flight in order, rule and place of its failed findings; () for an undecided flight."""
        return [
            () if outcome == "undecided" else parse_failed_findings(text)
            for outcome, text in zip(self.texts("outcome"), self.texts("failed"), strict=True)
        ]

    def first_text(self, name: str) -> str | None:
        """Return the text of the first flight that has one in a column; None if no flight has one."""
        query = f"SELECT {_check_column(name)} FROM flights WHERE {name} IS NOT NULL ORDER BY flight LIMIT 1"
        row = self._connection.execute(query).fetchone()
        return None if row is None else str(row[0])

    def blobs(self, name: str, max_count: int) -> list[bytes]:
        """Return the bytes of a column of arrays, in order.

        They are those of the first `max_count` flights that have an array.
        """
        query = f"SELECT {_check_column(name)} FROM flights WHERE LENGTH({name}) > 0 ORDER BY flight LIMIT ?"
        return [value for (value,) in self._connection.execute(query, (max_count,))]

    def has_track(self) -> list[bool]:
        """Return a list with an entry for each flight, in order: True if its path data are stored."""
        return [
            bool(size) for (size,) in self._connection.execute("SELECT LENGTH(clearance) FROM flights ORDER BY flight")
        ]

    def worst_flights(self, max_count: int) -> list[FlightRow]:
        """Return at most `max_count` flights, the worst first: lost, failed, undecided, then flyable flights.

        Within each outcome, the flights with the smallest scaled margin come first.
        """
        ranks = "WHEN 'lost' THEN 0 WHEN 'not flyable' THEN 1 WHEN 'undecided' THEN 2 ELSE 3"
        order = f"CASE outcome {ranks} END, closeness IS NULL, closeness"
        rows = self._connection.execute(f"{_SELECT_ROWS} ORDER BY {order}, flight LIMIT ?", (max_count,))
        return [_make_row(values) for values in rows]

    def flight(self, index: int) -> FlightRow | None:
        """Return the flight with an index, or None if the table has no such flight."""
        values = self._connection.execute(f"{_SELECT_ROWS} WHERE flight = ?", (index,)).fetchone()
        return None if values is None else _make_row(values)

    def rows(self) -> Iterator[FlightRow]:
        """Yield all flights in order."""
        for values in self._connection.execute(f"{_SELECT_ROWS} ORDER BY flight"):
            yield _make_row(values)


def _check_column(name: str) -> str:
    """Return the name of a column unchanged.

    Raise KeyError for any other text, which must not get into a query.
    """
    if name not in COLUMN_NAMES:
        raise KeyError(name)
    return name


def _make_row(values: tuple[Any, ...]) -> FlightRow:
    """Make the row of a flight from the values of all columns in order."""
    columns = dict(zip(COLUMN_NAMES, values, strict=True))
    return make_flight_row(columns["flight"], columns)


# ----------------------------------------------------------------------
# Table of a search for the strongest winds, with one row per flight, numbered in the order of requests.

# Name of the file with the table of a search.
WINDS_DATABASE = "winds.sqlite"
# Settings that determine the requested flights; the number of flights only determines where the sequence ends.
FIXED_SETTINGS = ("target", "confidence", "directions", "most")
# Kind of the table of a search.
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
    FIXED_SETTINGS,
)


@dataclass(frozen=True, slots=True)
class RequestedFlight:
    """Flight that a search requests.

    number: position in the order of the search.
    direction: index of the wind's direction, clockwise from north.
    speed: mean wind speed, m/s.
    draw: index of the draw of variations around this wind; the indices are the same in all directions.
    """

    number: int
    direction: int
    speed: float
    draw: int


@dataclass(frozen=True, slots=True)
class FlownFlight:
    """Result of a flight of a search, as far as the search uses it.

    failed: rule and place of each failed finding.
    marginal_passes: rules that the flight nearly failed.
    undecided: rules that leave the flight undecided, with their reasons; "" for other flights.
    """

    outcome: Outcome
    failed: tuple[tuple[str, Place], ...]
    marginal_passes: tuple[MarginalPass, ...] = ()
    undecided: str = ""


class WindsStore(LockedTable):
    """Table of a search, locked by one process at a time."""

    def __init__(self, path: Path, made_of: str, settings: dict[str, Any], *, resume: bool) -> None:
        """Create the table, or open it to resume the same search.

        settings: settings of the search, which must include `FIXED_SETTINGS`.
        """
        super().__init__(path, WINDS_KIND, made_of, settings, resume=resume)

    def add(self, request: RequestedFlight, row: FlightRow) -> None:
        """Write a flight durably. Raises OSError for a full disk; earlier flights stay in the file."""
        request_values = {
            "flight": request.number,
            "direction": request.direction,
            "asked_speed": request.speed,
            "draw": request.draw,
            "narrow": json.dumps(
                [{"rule": rule, "margin": margin, **asdict(place)} for rule, place, margin in row.marginal_passes]
            ),
        }
        self.insert({**request_values, **row_values(replace(row, made_of=self.made_of))})

    def stored_flights(self) -> dict[int, tuple[RequestedFlight, FlownFlight]]:
        """Return the request and the outcome of each flight, keyed by number."""
        rows = self._connection.execute(
            "SELECT flight, direction, asked_speed, draw, outcome, failed, narrow, undecided_text FROM flights"
            " ORDER BY flight"
        )
        return {
            number: (
                RequestedFlight(number, *request),
                FlownFlight(outcome, parse_failed_findings(failed_text), parse_marginal_passes(passes_text), undecided),
            )
            for number, *request, outcome, failed_text, passes_text, undecided in rows
        }


def parse_marginal_passes(text: str) -> tuple[MarginalPass, ...]:
    """Parse marginal passes from the JSON text of a column.

    >>> parse_marginal_passes('[{"rule": "slope", "margin": 0.25, "kind": "leg", "index": 3}]')[0][2]
    0.25
    """
    passes = []
    for place_fields in json.loads(text):
        rule, margin = place_fields.pop("rule"), place_fields.pop("margin")
        passes.append((rule, Place(**place_fields), margin))
    return tuple(passes)


# ----------------------------------------------------------------------
# Read the table of a campaign as columns, without locking it and without the columns of arrays.

# Number of rows converted to arrays in one step.
_ROWS_PER_STEP = 1000
# Array type of each kind of column.
_TYPES: dict[str, type] = {"INTEGER": np.int64, "REAL": np.float64, "TEXT": object}


def read_table(path: Path) -> dict[str, NDArray[Any]]:
    """Read the columns (n,) of a campaign's table, by name, in the order of flights.

    Columns of arrays are left out.  Numbers are float64, NaN if missing, or int64.  Texts are Python strings, None if
    missing; equal strings share memory.  The result takes about 60 MB for 100,000 flights.

    Raises StoreError for a file that planfly did not write, or that another process has locked.
    """
    names = tuple(name for name in CAMPAIGN_KIND.columns if name not in ARRAY_COLUMNS)
    with _open_to_read(path) as connection:
        (count,) = connection.execute("SELECT COUNT(*) FROM flights").fetchone()
        columns = {name: np.empty(count, dtype=_TYPES[CAMPAIGN_KIND.columns[name].split()[0]]) for name in names}
        shared_texts: dict[str | None, str | None] = {}
        cursor = connection.execute(f"SELECT {', '.join(names)} FROM flights ORDER BY flight")
        for start in range(0, count, _ROWS_PER_STEP):
            for name, values in zip(names, zip(*cursor.fetchmany(_ROWS_PER_STEP), strict=True), strict=True):
                column = columns[name]
                shared_values = (
                    [shared_texts.setdefault(text, text) for text in values] if column.dtype == object else values
                )
                column[start : start + len(values)] = shared_values
    return columns


def with_place_numbers(columns: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return the columns with each column of places (JSON texts) replaced.

    It is replaced by kind, index and item of the place.

    The new names end in _kind, _index and _item.  The item of a leg is the item to which it leads.  Missing numbers are
    NaN, and missing kinds are None.
    """
    names = {rule.place_column for rule in RULE_WORDS.values()}
    places = {text: json.loads(text) for name in names & columns.keys() for text in set(columns[name]) - {None}}
    result: dict[str, NDArray[Any]] = {}
    for name, column in columns.items():
        if name not in names:
            result[name] = column
            continue
        parsed_places = [{} if text is None else places[text] for text in column]
        items = [place.get("to_item") if place.get("item") is None else place["item"] for place in parsed_places]
        result[f"{name}_kind"] = np.array([place.get("kind") for place in parsed_places], dtype=object)
        result[f"{name}_index"] = np.array([place.get("index") for place in parsed_places], dtype=np.float64)
        result[f"{name}_item"] = np.array(items, dtype=np.float64)
    return result


def check_rows(path: Path) -> None:
    """Raise StoreError if rows of a campaign's table are damaged, or if another program changed them."""
    with _open_to_read(path) as connection:
        (last_number,) = connection.execute("SELECT COALESCE(MAX(flight), -1) FROM flights").fetchone()
        examination = examine_table(connection, tuple(CAMPAIGN_KIND.columns), last_number + 1, last_number + 1)
    if damaged := examination.damaged:
        numbers_text = ", ".join(map(str, damaged[:10])) + (", ..." if len(damaged) > 10 else "")
        raise StoreError(
            f"{path}: {count_text(len(damaged), 'row')} damaged or changed by another program (flights {numbers_text});"
            " `planfly campaign --resume` flies these flights again",
            file=path,
        )


def count_flights(path: Path) -> int:
    """Return the number of flights in the table of a campaign or of a wind search.

    Raises StoreError for other files, and for a table that another process has locked.
    """
    with _open_to_read(path) as connection:
        return int(connection.execute("SELECT COUNT(*) FROM flights").fetchone()[0])


def read_path_arrays(path: Path) -> dict[str, NDArray[np.float32]]:
    """Read the path data of each flight, in the order of flights; NaN for flights without them.

    "clearance": minimum height above ground on each of 150 equally long parts of the route, m, (n, 150).
    "crossings": offset from each waypoint at closest approach, m, (n, w, 2): to the right and upwards.

    Raises StoreError for a file that planfly did not write, or that another process has locked.
    """
    with _open_to_read(path) as connection:
        result = {}
        for name in ARRAY_COLUMNS:
            # Entries are numbers or pairs; shorter rows are padded with NaN.
            entry_shape = COLUMN_FIELDS[name].entry
            count, size = connection.execute(f"SELECT COUNT(*), MAX(LENGTH({name})) FROM flights").fetchone()
            arrays = np.full((count, (size or 0) // np.dtype(np.float32).itemsize), np.nan, dtype=np.float32)
            cursor = connection.execute(f"SELECT {name} FROM flights ORDER BY flight")
            for row, (data,) in zip(arrays, cursor, strict=True):
                array = np.frombuffer(data or b"", np.float32)
                row[: array.size] = array
            result[name] = arrays.reshape(count, arrays.shape[1] // math.prod(entry_shape), *entry_shape)
        return result


@contextmanager
def _open_to_read(path: Path) -> Iterator[sqlite3.Connection]:
    """Yield a connection for reading a table.

    Raises StoreError for a locked file or another kind of file.
    """
    # Nothing is written, but a writable connection removes its -wal and -shm files when it closes.
    with (
        convert_errors(path),
        closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=rw", uri=True, timeout=1.0)) as connection,
    ):
        yield connection
