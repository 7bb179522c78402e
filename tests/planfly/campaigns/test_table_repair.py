"""Damaged tables: no traceback, no row but those that were written, and what is missing is flown again."""

import json
import math
import random
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.flight_row import FlightRow, fly_one, make_lost_row
from planfly.campaigns.fly_campaign import fly_campaign, open_store
from planfly.campaigns.statistics.decision import Goal, Tally
from planfly.campaigns.table_repair import Examination, checksum, examine_table, stored_value
from planfly.campaigns.tables import (
    CAMPAIGN_DATABASE,
    CAMPAIGN_KIND,
    WINDS_KIND,
    RequestedFlight,
    Store,
    StoreError,
    WindsStore,
    count_flights,
    read_path_arrays,
    read_stored_settings,
    read_table,
)
from planfly.campaigns.worker_pool import Workers
from planfly.runtime.stages import Receiver, send_progress_to
from tests.planfly.campaigns.made_campaigns import made_flight, table
from tests.soak import note, scaled

FLIGHTS = 40
QUESTION = {"target": 0.99, "confidence": 0.95, "directions": 16, "most": 20.0, "flights": FLIGHTS}


@dataclass
class Kept:
    """A table that is whole: its file, how it is opened to go on, and all that it holds by number."""

    path: Path
    opened: Callable[[Path], Any]
    read: Callable[[Any], dict[int, Any]]
    rows: dict[int, Any]


def campaign_of(folder: Path, rows: list[FlightRow]) -> Kept:
    def opened(path: Path, resume: bool = True) -> Store:
        return Store(path, "a", {"flights": FLIGHTS}, resume=resume)

    def read(store: Store) -> dict[int, Any]:
        """Every way to read it, all of which must agree with its rows."""
        found = {row.draw.index: row for row in store.rows()}
        outcomes = [row.outcome for row in found.values()]
        assert store.tally() == Tally(*(outcomes.count(name) for name in ("flyable", "not flyable", "lost")))
        assert store.outcomes() == {index: row.outcome for index, row in found.items()}
        assert store.column("mass").tolist() == [row.draw.values["mass"] for row in found.values()]
        assert store.texts("ended") == [row.ended for row in found.values()]
        assert store.has_track() == [bool(row.clearance) for row in found.values()]
        assert store.blobs("clearance", 99) == [row.clearance for row in found.values() if row.clearance]
        assert len(store.worst_flights(FLIGHTS)) == len(found)
        return found

    path = folder / "campaign.sqlite"
    with opened(path, resume=False) as store:
        for row in rows:
            store.add(row)
        return Kept(path, opened, read, read(store))


def search_of(folder: Path, rows: list[FlightRow]) -> Kept:
    def opened(path: Path, resume: bool = True) -> WindsStore:
        return WindsStore(path, "a", QUESTION, resume=resume)

    path = folder / "winds.sqlite"
    with opened(path, resume=False) as store:
        for k, row in enumerate(rows):
            store.add(RequestedFlight(k, k % 16, 0.1 * k, row.draw.index), row)
        return Kept(path, opened, WindsStore.stored_flights, store.stored_flights())


@pytest.fixture(scope="module", params=[campaign_of, search_of])
def kept(request: pytest.FixtureRequest, base: CampaignBase, tmp_path_factory: pytest.TempPathFactory) -> Kept:
    real = [fly_one(base, k) for k in range(4)]
    made = [made_flight(base, k) for k in range(4, FLIGHTS - 1)]
    made_kept: Kept = request.param(
        tmp_path_factory.mktemp("whole"), [*real, *made, make_lost_row(base, 39, "lost: x")]
    )
    return made_kept


def gone_on_with(kept: Kept, path: Path) -> int | None:
    """How many rows are left of a damaged table, each as it was; None where it is refused in a line."""
    try:
        with kept.opened(path) as store:
            left = kept.read(store)
    except StoreError as error:
        return None if "\n" not in str(error) else pytest.fail(str(error))
    assert all(kept.rows[number] == row for number, row in left.items())
    # What was mended once is whole.
    with kept.opened(path) as store:
        assert kept.read(store) == left
    assert count_flights(path) == len(left)
    assert read_stored_settings(path)["flights"] == FLIGHTS
    if isinstance(store, Store):
        assert {len(values) for values in (*read_table(path).values(), *read_path_arrays(path).values())} == {len(left)}
    return len(left)


# Among the 20 from 180 on is a page whose rows' numbers are any; from 320 and from 820 on one whose rows have none.
@pytest.mark.parametrize("first", sorted({*range(0, scaled(1000, 20), 20), 180, 320, 820}))
def test_changed_bytes_leave_rows_that_are_whole(
    kept: Kept, tmp_path: Path, first: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = kept.path.read_bytes()
    examined: list[Examination] = []

    def examine_and_keep(*given: Any) -> Examination:
        examined.append(examine_table(*given))
        return examined[-1]

    monkeypatch.setattr("planfly.campaigns.tables.examine_table", examine_and_keep)
    left, refused = [], 0
    for seed in range(first, first + 20):
        rng, data = random.Random(seed), bytearray(whole)
        for _ in range(rng.choice([1, 1, 4, 64])):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        if rng.random() < 0.1:
            data = data[: rng.randrange(len(data))]
        path = tmp_path / f"{seed}.sqlite"
        path.write_bytes(data)
        examined.clear()
        found = gone_on_with(kept, path)
        if examined and not examined[0].is_sound:
            # Each flight that is gone is named, but for those behind the last that is known of.
            last = examined[0].last_known if examined[0].last_known is not None else FLIGHTS - 1
            assert examined[0].damaged == sorted(set(range(last + 1)) - set(examined[0].undamaged)), seed
        if found is None:
            refused += 1
        else:
            left.append(found)
    note(f"changed bytes of {kept.path.name} from seed {first}", refused=refused, rows_kept=left)
    # Most changes spoil a row or two.
    assert len(left) > 5
    assert max(left) >= FLIGHTS - 4


@pytest.mark.parametrize("first", range(0, scaled(200, 40), 20))
def test_a_changed_field_takes_its_row_out_and_no_other(kept: Kept, tmp_path: Path, first: int) -> None:
    """By SQLite itself: other numbers, other words, other types."""
    for seed in range(first, first + 20):
        rng, path = random.Random(seed), tmp_path / f"{seed}.sqlite"
        shutil.copy(kept.path, path)
        number = rng.choice(list(kept.rows))
        kind = CAMPAIGN_KIND if "campaign" in kept.path.name else WINDS_KIND
        name = rng.choice([*kind.columns, "checksum"])
        with closing(sqlite3.connect(path, isolation_level=None)) as connection:
            query = f"SELECT {name} FROM flights WHERE flight = ?"
            (before,) = connection.execute(query, (number,)).fetchone()
            values = ["flyable", "not flyable", "lost", 1e9, -1, 7, b"\xff\xfe", "\0", "{}", "[]", 1e-300]
            other = 10**6 + seed if name == "flight" else rng.choice([one for one in values if one != before])
            connection.execute(f"UPDATE flights SET {name} = ? WHERE flight = ?", (other, number))
        with kept.opened(path) as store:
            assert kept.read(store) == {k: row for k, row in kept.rows.items() if k != number}, (name, other)


def test_flights_beyond_those_last_asked_for_are_kept_where_a_file_is_broken(kept: Kept, tmp_path: Path) -> None:
    path = tmp_path / "c.sqlite"
    shutil.copy(kept.path, path)
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        known = dict(connection.execute("SELECT key, value FROM campaign"))
        known["settings"] = json.dumps(json.loads(known["settings"]) | {"flights": 3})
        known["checksum"] = checksum(known[name] for name in ("schema", "made_of", "settings"))
        connection.executemany("UPDATE campaign SET value = ? WHERE key = ?", [(v, k) for k, v in known.items()])
    data = bytearray(path.read_bytes())
    # How many pages are free, of which there are none (SQLite, Database File Format, 1.3).
    data[39] += 5
    path.write_bytes(data)
    with kept.opened(path) as store:
        assert kept.read(store) == kept.rows


@pytest.mark.parametrize("key", ["settings", "made_of", "checksum"])
def test_settings_that_are_damaged_are_one_line(kept: Kept, tmp_path: Path, key: str) -> None:
    path = tmp_path / "c.sqlite"
    shutil.copy(kept.path, path)
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("UPDATE campaign SET value = REPLACE(value, 'a', 'b') || ' ' WHERE key = ?", (key,))
    for read in (kept.opened, read_stored_settings):
        with pytest.raises(StoreError, match=r"c\.sqlite: its settings are damaged"):
            read(path)


def test_what_is_damaged_is_named_and_flown_again(base: CampaignBase, tmp_path: Path, scheduler: str) -> None:
    """Two rows changed and one with bytes that are no text: the table is that of one process again."""
    goal, workers = Goal(None, False, 12), Workers(None, scheduler)
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        with open_store(base, goal, tmp_path / folder, resume=False) as store:
            for k in range(12):
                store.add(made_flight(base, k))
    path, told = tmp_path / "one" / CAMPAIGN_DATABASE, list[str]()
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("UPDATE flights SET outcome = 'lost', failed = '[]' WHERE flight = 3")
        connection.execute("UPDATE flights SET margin_clearance = 99.0 WHERE flight = 7")
        connection.execute("UPDATE flights SET ended = CAST(X'FFFE' AS TEXT) WHERE flight = 8")
    with send_progress_to(Receiver(lambda *_: pytest.fail("no stage"), told.append)):
        store = open_store(base, goal, tmp_path / "one", resume=True)
    assert told == [
        f"{path}: flights 3, 7, 8 are damaged and were removed; intact flights: 9; --resume flies the missing ones"
    ]
    with store:
        assert store.tally().flown == 9
        assert fly_campaign(base, goal, workers, store, fly=made_flight).tally.flown == 12
    assert table(path) == table(tmp_path / "two" / CAMPAIGN_DATABASE)


def test_a_checksum_is_of_values_as_sqlite_gives_them_back() -> None:
    """Numpy's numbers, a NaN, which it does not keep, and a zero whose sign it does not keep."""
    values = (np.float64(0.1), 3, np.int64(5), math.nan, -0.0)
    row = [stored_value(*one) for one in zip(values, ("REAL", "REAL NOT NULL", "INTEGER", "REAL", "REAL"), strict=True)]
    with closing(sqlite3.connect(":memory:")) as connection:
        connection.execute("CREATE TABLE t (a REAL, b REAL NOT NULL, c INTEGER, d REAL, e REAL)")
        connection.execute("INSERT INTO t VALUES (?, ?, ?, ?, ?)", row)
        back = connection.execute("SELECT * FROM t").fetchone()
    assert checksum(row) == checksum(back)
    assert back == (0.1, 3.0, 5, None, 0.0)
    assert len({checksum([value]) for value in (1, 1.0, "1", b"1", None, "1.0", True)}) == 7


def test_many_damaged_flights_are_counted() -> None:
    assert Examination([3], [], is_sound=False).describe().startswith("is damaged; intact flights: 1;")
    assert (
        Examination([0, 2], [1], is_sound=False, last_known=2)
        .describe()
        .startswith("flight 1 is damaged and was removed, and any flights after flight 2 are lost; intact flights: 2;")
    )
    found = Examination([], [], is_sound=False, last_known=-1).describe()
    assert found.startswith("is damaged, and no flight was found; intact flights: 0;")
    assert (
        Examination([], list(range(20))).describe().startswith("flights 0, 1, 2, 3, 4, 5, 6, 7 and 12 more are damaged")
    )
