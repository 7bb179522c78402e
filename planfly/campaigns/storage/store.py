"""The table of a campaign: a row a flight, read by its index."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planfly.campaigns.flights.flight_row import FlightRow
from planfly.campaigns.storage.held_table import HeldTable, TableKind
from planfly.campaigns.storage.row_values import ROW_COLUMNS, row_of, row_values

DATABASE = "campaign.sqlite"
KIND = TableKind("planfly.campaign/1", {"flight": "INTEGER PRIMARY KEY", **ROW_COLUMNS})
COLUMNS = tuple(KIND.columns)


class Store(HeldTable):
    """A campaign's table, held by one process at a time; a flight's number is its draw's index."""

    def __init__(self, path: Path, made_of: str, settings: dict[str, Any], *, resume: bool) -> None:
        """Make the table, or open it to go on; as `planfly.campaigns.storage.held_table.HeldTable`."""
        super().__init__(path, KIND, made_of, settings, resume=resume)

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
