"""The tables of campaigns: a row a flight, by index, and in the order in which a search for winds asked for them."""

import json
import math
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from logs.verdict.places import Place
from planfly.campaigns.flights.flight_row import FlightRow, NarrowPass, Outcome
from planfly.campaigns.storage.table import (
    ROW_COLUMNS,
    SHAPES,
    HeldTable,
    TableKind,
    failed_of,
    row_of,
    row_values,
    told_errors,
)

# ----------------------------------------------------------------------
# The table of a campaign: a row a flight, read by its index.

DATABASE = "campaign.sqlite"
CAMPAIGN_KIND = TableKind("planfly.campaign/1", {"flight": "INTEGER PRIMARY KEY", **ROW_COLUMNS})
COLUMNS = tuple(CAMPAIGN_KIND.columns)


class Store(HeldTable):
    """A campaign's table, held by one process at a time; a flight's number is its draw's index."""

    def __init__(self, path: Path, made_of: str, settings: dict[str, Any], *, resume: bool) -> None:
        """Make the table, or open it to go on; as `planfly.campaigns.storage.table.HeldTable`."""
        super().__init__(path, CAMPAIGN_KIND, made_of, settings, resume=resume)

    def add(self, row: FlightRow) -> None:
        """Write a flight, for good.  Raises OSError for a full disk; what was written before stays."""
        self.insert({"flight": row.draw.index, **row_values(row, self.made_of)})

    def outcomes(self) -> dict[int, str]:
        """Outcome by index of all flights."""
        return dict(self._connection.execute("SELECT flight, outcome FROM flights ORDER BY flight"))

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
    "planfly.winds-flights/2",
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
    """What came of a flight: its outcome, rule and place of each finding that failed, and its narrow passes."""

    outcome: Outcome
    failed: tuple[tuple[str, Place], ...]
    narrow: tuple[NarrowPass, ...] = ()


class WindsStore(HeldTable):
    """A search's table, held by one process at a time."""

    def __init__(self, path: Path, made_of: str, settings: dict[str, Any], *, resume: bool) -> None:
        """Make the table, or open it to go on with the same question; settings: with `FIXED` among them."""
        super().__init__(path, WINDS_KIND, made_of, settings, resume=resume)

    def add(self, asked: AskedFlight, row: FlightRow) -> None:
        """Write a flight, for good.  Raises OSError for a full disk; what was written before stays."""
        asked_for = {
            "flight": asked.number, "direction": asked.direction, "asked_speed": asked.speed, "draw": asked.draw,
            "narrow": json.dumps([{"rule": rule, "room": room, **asdict(place)} for rule, place, room in row.narrow]),
        }  # fmt: skip
        self.insert({**asked_for, **row_values(row, self.made_of)})

    def known(self) -> dict[int, tuple[AskedFlight, FlownFlight]]:
        """Each flight there is and what came of it, by number."""
        rows = self._connection.execute(
            "SELECT flight, direction, asked_speed, draw, outcome, failed, narrow FROM flights ORDER BY flight"
        )
        return {
            number: (AskedFlight(number, *asked), FlownFlight(outcome, failed_of(failed), narrow_passes_of(narrow)))
            for number, *asked, outcome, failed, narrow in rows
        }


def narrow_passes_of(text: str) -> tuple[NarrowPass, ...]:
    """Narrow passes of the column's text.

    >>> narrow_passes_of('[{"rule": "slope", "room": 0.25, "kind": "leg", "index": 3}]')[0][2]
    0.25
    """
    return tuple(_narrow_pass(**entry) for entry in json.loads(text))


def _narrow_pass(rule: str, room: float, **place: Any) -> NarrowPass:
    return rule, Place(**place), room


# ----------------------------------------------------------------------
# The table of a campaign as columns, read without holding it and without what no table of numbers needs.

# Rows that are turned into arrays at a time.
_CHUNK = 1000
_TYPES: dict[str, type] = {"INTEGER": np.int64, "REAL": np.float64, "TEXT": object}


def read_table(path: Path) -> dict[str, NDArray[Any]]:
    """The columns of a campaign's table by name, (n,) each, in the order of flights; of arrays' bytes none.

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


def read_shapes(path: Path) -> dict[str, NDArray[np.float32]]:
    """What a campaign keeps of each flight's way, in the order of flights; NaN for flights that have none.

    "clearance": (n, 150) least height above ground on each equal piece of the route's length, m.
    "crossings": (n, w, 2) how far right of and above each waypoint it was at its nearest, m.
    Raises StoreError for a file that is none of ours or is held.
    """
    with _opened(path) as connection:
        clearance, crossings = (_singles(connection, name) for name in SHAPES)
    count, width = crossings.shape
    return {"clearance": clearance, "crossings": crossings.reshape(count, width // 2, 2)}


def _singles(connection: sqlite3.Connection, name: str) -> NDArray[np.float32]:
    """(n, m) the arrays of a column, m the longest one's length."""
    count, size = connection.execute(f"SELECT COUNT(*), MAX(LENGTH({name})) FROM flights").fetchone()
    found = np.full((count, (size or 0) // np.dtype(np.float32).itemsize), np.nan, dtype=np.float32)
    for row, (data,) in zip(found, connection.execute(f"SELECT {name} FROM flights ORDER BY flight"), strict=True):
        if data:
            row[:] = np.frombuffer(data, np.float32)
    return found


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    with (
        told_errors(path),
        closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=1.0)) as connection,
    ):
        yield connection
