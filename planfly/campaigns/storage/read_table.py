"""The table of a campaign as columns, read without holding it and without what no table of numbers needs."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planfly.campaigns.storage.held_table import told_errors
from planfly.campaigns.storage.row_values import SHAPES
from planfly.campaigns.storage.store import KIND

# Rows that are turned into arrays at a time.
_CHUNK = 1000
_TYPES: dict[str, type] = {"INTEGER": np.int64, "REAL": np.float64, "TEXT": object}


def read_table(path: Path) -> dict[str, NDArray[Any]]:
    """The columns of a campaign's table by name, (n,) each, in the order of flights; of arrays' bytes none.

    Numbers are float64 with NaN for none, or int64; words are Python's, None for none, each kept once.  Some 60 MB for
    100,000 flights.
    Raises StoreError for a file that is none of ours or is held.
    """
    names = tuple(name for name in KIND.columns if name not in SHAPES)
    with _opened(path) as connection:
        (count,) = connection.execute("SELECT COUNT(*) FROM flights").fetchone()
        table = {name: np.empty(count, dtype=_TYPES[KIND.columns[name].split()[0]]) for name in names}
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
