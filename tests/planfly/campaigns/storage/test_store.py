"""The table: by index, one process at a time, and one line for what cannot be opened."""

import sqlite3
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.flight_row import fly_one, lost_row
from planfly.campaigns.statistics.proportions import Tally
from planfly.campaigns.storage.store import COLUMNS, NOT_THE_SAME, Store, StoreError, read_table, same_flight
from tests.planfly.campaigns.made_campaigns import all_fly, made_flight


def opened(path: Path, made_of: str = "a", *, resume: bool = False) -> Store:
    return Store(path, made_of, {"seed": 1}, resume=resume)


def test_rows_come_back_as_they_were_in_order_of_index(base: CampaignBase, tmp_path: Path) -> None:
    real, made, lost = fly_one(base, 2), made_flight(base, 0), lost_row(base, 1, "died")
    with opened(tmp_path / "c.sqlite") as store:
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
        assert [row.draw.index for row in store.closest(3)] == [1, 0, 2]
        assert store.has_track() == [False, False, True]
        assert store.column("mass").tolist() == [row.draw.values["mass"] for row in rows]
        store.drop_from(1)
        assert list(store.outcomes()) == [0]
        with pytest.raises(StoreError, match="UNIQUE"):
            store.add(made)
    table = read_table(tmp_path / "c.sqlite")
    assert tuple(table) == COLUMNS
    assert table["flight"] == [0]


def test_what_was_added_stays_after_a_kill(base: CampaignBase, tmp_path: Path) -> None:
    path = tmp_path / "c.sqlite"
    code = (
        "import os, sys; from pathlib import Path\n"
        "from planfly.campaigns.storage.store import Store\n"
        "from planfly.campaigns.flights.flight_row import FlightRow\n"
        "from planfly.campaigns.spread.draws import Draw\n"
        "from planfly.campaigns.spread.quantities import NAMES\n"
        "store = Store(Path(sys.argv[1]), 'a', {}, resume=False)\n"
        "for k in range(3): store.add(FlightRow(Draw(k, k, dict.fromkeys(NAMES, 0.0)), 'flyable', 'completed'))\n"
        "os.kill(os.getpid(), 9)\n"
    )
    subprocess.run([sys.executable, "-c", code, str(path)], check=False)
    with opened(path, resume=True) as store:
        assert list(store.outcomes()) == [0, 1, 2]


def test_another_campaign_and_a_missing_one_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "c.sqlite"
    with pytest.raises(StoreError, match="no such campaign"):
        opened(path, resume=True)
    opened(path).__exit__(None, None, None)
    with pytest.raises(StoreError, match=r"another campaign.*\(a, not b\)"):
        opened(path, "b", resume=True)


@pytest.mark.parametrize("holder", ["another store", "another program"])
def test_a_held_table_is_refused_and_loses_nothing(base: CampaignBase, tmp_path: Path, holder: str) -> None:
    path = tmp_path / "c.sqlite"
    with opened(path) as store:
        store.add(all_fly(base, 0))
        if holder == "another store":
            with pytest.raises(StoreError, match="held by another process"):
                opened(path, resume=True)
    if holder == "another program":
        other = sqlite3.connect(path, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(StoreError, match="held by another process"):
            opened(path, resume=True)
        other.close()
    with opened(path, resume=True) as store:
        assert store.tally() == Tally(1, 0)


def test_a_file_that_is_no_table_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "c.sqlite"
    path.write_bytes(b"not a database at all, but long enough to be read as one" * 40)
    with pytest.raises(StoreError, match="not a database"):
        opened(path, resume=True)


def test_a_full_disk_is_told_and_keeps_what_was_written(base: CampaignBase, tmp_path: Path) -> None:
    path = tmp_path / "c.sqlite"
    row = fly_one(base, 0)

    with opened(path) as store:
        # As SQLite says it of a disk: the file may have no more pages.
        store._connection.execute("PRAGMA max_page_count = 12")
        many = (replace(row, draw=replace(row.draw, index=k)) for k in range(1000))
        with pytest.raises(OSError, match="no space left"):
            any(store.add(one) for one in many)
    with opened(path, resume=True) as store:
        # All before the one that found no room.
        assert list(store.outcomes()) == list(range(len(store.outcomes())))
        assert len(store.outcomes()) > 0


def test_who_flew_and_how_long_makes_no_other_flight(base: CampaignBase) -> None:
    row = made_flight(base, 1)
    assert NOT_THE_SAME == ("seconds", "worker")
    assert same_flight(row, replace(row, worker="tcp://x", seconds=9.0))
    assert not same_flight(row, replace(row, ended="x"))
