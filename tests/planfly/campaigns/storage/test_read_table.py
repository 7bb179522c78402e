"""The table as columns: numbers as numbers, words once each, bytes of arrays on asking only."""

import sqlite3
import tracemalloc
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.flight_row import FlightRow, fly_one, lost_row
from planfly.campaigns.flights.track_shape import STATIONS
from planfly.campaigns.storage.held_table import StoreError
from planfly.campaigns.storage.read_table import read_shapes, read_table
from planfly.campaigns.storage.row_values import SHAPES
from planfly.campaigns.storage.store import COLUMNS, Store
from tests.planfly.campaigns.made_campaigns import made_flight
from tests.soak import SOAK, note


def kept(path: Path, rows: list[FlightRow]) -> Path:
    with Store(path, "a", {}, resume=False) as store:
        store._connection.execute("BEGIN")
        for row in rows:
            store.add(row)
        store._connection.execute("COMMIT")
    return path


def test_numbers_are_arrays_and_words_are_words(base: CampaignBase, tmp_path: Path) -> None:
    rows = [fly_one(base, 0), made_flight(base, 1), lost_row(base, 2, "lost: x")]
    # Characters that an address of a file would take for something else.
    (tmp_path / "50 % ?#").mkdir()
    table = read_table(kept(tmp_path / "50 % ?#" / "c.sqlite", rows))
    assert tuple(table) == tuple(name for name in COLUMNS if name not in SHAPES)
    assert table["flight"].tolist() == [0, 1, 2]
    assert table["mass"].tolist() == [row.draw.values["mass"] for row in rows]
    assert {table[name].dtype for name in ("flight", "seed")} == {np.dtype(np.int64)}
    assert {table[name].dtype for name in ("mass", "margin_clearance", "energy_left")} == {np.dtype(np.float64)}
    assert np.isnan(table["margin_clearance"]).tolist() == [False, False, True]
    assert table["outcome"].tolist() == [row.outcome for row in rows]
    assert table["place_clearance"][2] is None


def test_shapes_are_read_on_asking(base: CampaignBase, tmp_path: Path) -> None:
    real = fly_one(base, 0)
    shapes = read_shapes(kept(tmp_path / "c.sqlite", [real, made_flight(base, 1)]))
    clearance, crossings = shapes["clearance"], shapes["crossings"]
    assert clearance.shape == (2, STATIONS)
    assert clearance[0].tobytes() == real.clearance
    assert crossings.shape[::2] == (2, 2)
    assert crossings[0].tobytes() == real.crossings
    assert np.isnan(clearance[1]).all()
    assert np.isnan(crossings[1]).all()


def test_a_table_without_a_flight_has_columns_without_one(tmp_path: Path) -> None:
    path = kept(tmp_path / "c.sqlite", [])
    assert {len(values) for values in read_table(path).values()} == {0}
    assert {name: values.shape for name, values in read_shapes(path).items()} == {
        "clearance": (0, 0),
        "crossings": (0, 0, 2),
    }


def test_what_is_no_table_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="unable to open"):
        read_table(tmp_path / "none.sqlite")


def test_memory_is_that_of_the_numbers(base: CampaignBase, tmp_path: Path) -> None:
    """A flight takes 8 bytes a column: of 100,000 some 60 MB, where its row takes three kilobytes in the file."""
    count = 100_000 if SOAK else 10_000
    path = kept(tmp_path / "c.sqlite", [replace(fly_one(base, 0), worker="tcp://127.0.0.1:40123")])
    numbers = f"WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n WHERE k < {count - 1}) "
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute(f"INSERT INTO flights {numbers} SELECT k, {', '.join(COLUMNS[1:])} FROM n, flights")
    tracemalloc.start()
    table = read_table(path)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(table["flight"]) == count
    # A thousand rows of words are there for a moment, however many there are.
    assert most < count * len(table) * 8 * 1.05 + 4e6
    note("campaign: columns of its table", flights=count, most_mb=round(most / 1e6, 1))
