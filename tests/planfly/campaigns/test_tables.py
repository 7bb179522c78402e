"""The table of a campaign: by index, and in order of index whoever came first."""

import sqlite3
import tracemalloc
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from logs.verdict.places import Place
from planfly.campaigns.campaign_base import CampaignBase, GivenWind
from planfly.campaigns.flight_row import STATION_COUNT, FlightRow, fly_one, make_lost_row
from planfly.campaigns.statistics.decision import Tally
from planfly.campaigns.tables import (
    ARRAY_COLUMNS,
    COLUMN_NAMES,
    FIXED_SETTINGS,
    FlownFlight,
    RequestedFlight,
    Store,
    StoreError,
    WindsStore,
    count_flights,
    read_path_arrays,
    read_table,
)
from tests.planfly.campaigns.made_campaigns import all_fly, made_flight, table
from tests.soak import SOAK, note


def test_rows_come_back_as_they_were_in_order_of_index(base: CampaignBase, tmp_path: Path) -> None:
    real, made, lost = (
        replace(fly_one(base, 2), marginal_passes=()),
        made_flight(base, 0),
        make_lost_row(base, 1, "died"),
    )
    with Store(tmp_path / "c.sqlite", "a", {}, resume=False) as store:
        for row in (real, made, lost):
            store.add(row)
        rows = list(store.rows())
        assert [row.draw.index for row in rows] == [0, 1, 2]
        assert rows[2] == real
        assert store.flight(2) == real
        assert store.flight(3) is None
        assert store.tally() == Tally(1, 1, 1)
        assert store.outcomes()[1] == "lost"
        # The lost first, then the one that failed.
        assert [row.draw.index for row in store.worst_flights(3)] == [1, 0, 2]
        assert store.has_track() == [False, False, True]
        assert store.column("mass").tolist() == [row.draw.values["mass"] for row in rows]
        store.delete_later_flights(1)
        assert list(store.outcomes()) == [0]
        with pytest.raises(StoreError, match="UNIQUE"):
            store.add(made)


def test_a_copy_of_the_file_alone_lacks_a_few_flights_at_most(base: CampaignBase, tmp_path: Path) -> None:
    """A campaign that is killed leaves the last flights in the write-ahead log next to its file."""
    with Store(tmp_path / "c.sqlite", "a", {}, resume=False) as store:
        for flights in (0, 3, 20, 47):
            for index in range(store.tally().flown, flights):
                store.add(replace(fly_one(base, 0), draw=made_flight(base, index).draw))
            copy = tmp_path / f"copy-{flights}.sqlite"
            copy.write_bytes((tmp_path / "c.sqlite").read_bytes())
            assert flights - 8 <= count_flights(copy) <= flights


# ----------------------------------------------------------------------
# The table of a search: what was asked for and what came of it, and another question is refused by name.

QUESTION: dict[str, Any] = {"target": 0.99, "confidence": 0.95, "directions": 16, "most": 20.0, "flights": 99}


def opened(path: Path, *, resume: bool = True, **other: float) -> WindsStore:
    return WindsStore(path, "a", QUESTION | other, resume=resume)


def test_what_was_asked_for_comes_back_in_order(base: CampaignBase, tmp_path: Path) -> None:
    later, first = RequestedFlight(7, 3, 0.1 * 3, 2), RequestedFlight(2, 3, 12.300000000000001, 2)
    narrow = (("slope", Place("leg", 1), 0.1 * 3), ("threat", Place("missile", 0, name="Alfa"), 0.0))
    bad = replace(made_flight(base, 3, GivenWind(15.0, 0.0)), marginal_passes=narrow)
    with opened(tmp_path / "w.sqlite", resume=False) as store:
        open_row = replace(
            all_fly(base, 2),
            outcome="undecided",
            failed=(("loiter", Place("waypoint", 1)),),
            undecided_text="loiters (a guess)",
        )
        store.add(later, open_row)
        store.add(RequestedFlight(8, 3, 15.0, 3), bad)
        # The draw of another direction's flight: a number of its own.
        store.add(first, make_lost_row(base, 2, "lost: x"))
        assert list(store.stored_flights().items()) == [
            (2, (first, FlownFlight("lost", ()))),
            (7, (later, FlownFlight("undecided", open_row.failed, undecided="loiters (a guess)"))),
            (
                8,
                (RequestedFlight(8, 3, 15.0, 3), FlownFlight("not flyable", (("clearance", Place("leg", 1)),), narrow)),
            ),
        ]
        with pytest.raises(StoreError, match="UNIQUE"):
            store.add(first, all_fly(base, 2))
    assert [row[:4] for row in table(tmp_path / "w.sqlite")][:2] == [(2, 3, 12.300000000000001, 2), (7, 3, 0.1 * 3, 2)]


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("target", 0.9, "target 0.9: the campaign in this file has 0.99"),
        ("confidence", 0.9, "confidence 0.9"),
        ("directions", 8, "directions 8: the campaign in this file has 16"),
        ("most", 30.0, "most 30.0"),
    ],
)
def test_another_question_is_refused_by_name(tmp_path: Path, name: str, value: float, words: str) -> None:
    assert name in FIXED_SETTINGS
    opened(tmp_path / "w.sqlite", resume=False).__exit__(None, None, None)
    with pytest.raises(StoreError, match=words):
        opened(tmp_path / "w.sqlite", **{name: value})
    opened(tmp_path / "w.sqlite", flights=7).__exit__(None, None, None)


# ----------------------------------------------------------------------
# The table as columns: numbers as numbers, words once each, bytes of arrays on asking only.


def kept(path: Path, rows: list[FlightRow]) -> Path:
    with Store(path, "a", {}, resume=False) as store:
        store._connection.execute("BEGIN")
        for row in rows:
            store.add(row)
        store._connection.execute("COMMIT")
    return path


def test_numbers_are_arrays_and_words_are_words(base: CampaignBase, tmp_path: Path) -> None:
    rows = [fly_one(base, 0), made_flight(base, 1), make_lost_row(base, 2, "lost: x")]
    # Characters that an address of a file would take for something else.
    (tmp_path / "50 % ?#").mkdir()
    table = read_table(kept(tmp_path / "50 % ?#" / "c.sqlite", rows))
    assert tuple(table) == tuple(name for name in COLUMN_NAMES if name not in ARRAY_COLUMNS)
    assert table["flight"].tolist() == [0, 1, 2]
    assert table["mass"].tolist() == [row.draw.values["mass"] for row in rows]
    assert {table[name].dtype for name in ("flight", "seed")} == {np.dtype(np.int64)}
    assert {table[name].dtype for name in ("mass", "margin_clearance", "energy_left")} == {np.dtype(np.float64)}
    assert np.isnan(table["margin_clearance"]).tolist() == [False, False, True]
    assert table["outcome"].tolist() == [row.outcome for row in rows]
    assert table["place_clearance"][2] is None


def test_shapes_are_read_on_asking(base: CampaignBase, tmp_path: Path) -> None:
    real = fly_one(base, 0)
    shapes = read_path_arrays(kept(tmp_path / "c.sqlite", [real, made_flight(base, 1)]))
    clearance, crossings = shapes["clearance"], shapes["crossings"]
    assert clearance.shape == (2, STATION_COUNT)
    assert clearance[0].tobytes() == real.clearance
    assert crossings.shape[::2] == (2, 2)
    assert crossings[0].tobytes() == real.crossings
    assert np.isnan(clearance[1]).all()
    assert np.isnan(crossings[1]).all()


def test_flights_of_different_routes_have_their_shapes_in_one_array(base: CampaignBase, tmp_path: Path) -> None:
    """Wind decides how many stops a way back has: the shorter arrays end with NaN."""
    rows = [replace(made_flight(base, k), crossings=np.zeros((k, 2), np.float32).tobytes()) for k in (1, 3)]
    crossings = read_path_arrays(kept(tmp_path / "c.sqlite", rows))["crossings"]
    assert crossings.shape == (2, 3, 2)
    assert np.isnan(crossings).sum(axis=(1, 2)).tolist() == [4, 0]


def test_a_table_without_a_flight_has_columns_without_one(tmp_path: Path) -> None:
    path = kept(tmp_path / "c.sqlite", [])
    assert {len(values) for values in read_table(path).values()} == {0}
    assert {name: values.shape for name, values in read_path_arrays(path).items()} == {
        "clearance": (0, 0),
        "crossings": (0, 0, 2),
    }


def test_what_is_no_table_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="unable to open"):
        read_table(tmp_path / "none.sqlite")


def test_memory_is_that_of_the_numbers(base: CampaignBase, tmp_path: Path) -> None:
    """A flight takes 8 bytes a column: of 100,000 some 60 MB, where its row takes three kilobytes in the file."""
    count = 100_000 if SOAK else 4_000
    path = kept(tmp_path / "c.sqlite", [replace(fly_one(base, 0), worker="tcp://127.0.0.1:40123")])
    numbers = f"WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n WHERE k < {count - 1}) "
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        same = ", ".join((*COLUMN_NAMES[1:], "checksum"))
        connection.execute(f"INSERT INTO flights {numbers} SELECT k, {same} FROM n, flights")
    tracemalloc.start()
    table = read_table(path)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(table["flight"]) == count
    # A thousand rows of words are there for a moment, however many there are.
    assert most < count * len(table) * 8 * 1.05 + 4e6
    note("campaign: columns of its table", flights=count, most_mb=round(most / 1e6, 1))
