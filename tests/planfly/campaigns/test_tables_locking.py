"""A row as values and back: all of it, and what makes it another flight."""

import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from logs.verdict.rule_words import RULE_WORDS
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.flight_row import FlightRow, fly_one, make_lost_row
from planfly.campaigns.statistics.decision import Tally
from planfly.campaigns.tables import (
    CAMPAIGN_KIND,
    ROW_COLUMNS,
    RUN_DEPENDENT_COLUMNS,
    WINDS_KIND,
    RequestedFlight,
    Store,
    StoreError,
    WindsStore,
    check_not_locked,
    is_same_flight,
    make_flight_row,
    row_values,
)
from tests.planfly.campaigns.made_campaigns import all_fly, made_flight, table


def test_values_make_the_row_again(base: CampaignBase) -> None:
    for row in (fly_one(base, 1), made_flight(base, 2), make_lost_row(base, 3, "lost: x")):
        values = row_values(row)
        assert tuple(values) == tuple(ROW_COLUMNS)
        # But for its narrow passes, which a search's table keeps for itself.
        assert make_flight_row(row.draw.index, values) == replace(row, marginal_passes=())


def test_who_flew_and_how_long_makes_no_other_flight(base: CampaignBase, tmp_path: Path) -> None:
    row = made_flight(base, 1)
    assert RUN_DEPENDENT_COLUMNS == ("seconds", "worker")
    assert is_same_flight(row, replace(row, worker="tcp://x", seconds=9.0))
    assert not is_same_flight(row, replace(row, ended="x"))
    assert not is_same_flight(row, replace(row, draw=replace(row.draw, index=2)))


# ----------------------------------------------------------------------
# A table: held by one process at a time, kept over a kill, and one line for what cannot be opened.

QUESTION = {"target": 0.99, "confidence": 0.95, "directions": 16, "most": 20.0}


def opened(path: Path, made_of: str = "a", *, resume: bool = False) -> Store:
    return Store(path, made_of, {"seed": 1}, resume=resume)


def add_to_campaign(path: Path, rows: list[FlightRow], *, resume: bool, pages: int = 0) -> None:
    with opened(path, resume=resume) as store:
        if pages:
            # As SQLite says it of a disk: the file may have no more pages.
            store._connection.execute(f"PRAGMA max_page_count = {pages}")
        for row in rows:
            store.add(row)


def add_to_search(path: Path, rows: list[FlightRow], *, resume: bool, pages: int = 0) -> None:
    with WindsStore(path, "a", QUESTION, resume=resume) as store:
        if pages:
            store._connection.execute(f"PRAGMA max_page_count = {pages}")
        for row in rows:
            store.add(RequestedFlight(row.draw.index, 0, 5.0, row.draw.index), row)


def test_what_was_added_stays_after_a_kill(base: CampaignBase, tmp_path: Path) -> None:
    path = tmp_path / "c.sqlite"
    code = (
        "import os, sys; from pathlib import Path\n"
        "from planfly.campaigns.tables import Store\n"
        "from planfly.campaigns.flight_row import FlightRow\n"
        "from planfly.campaigns.dispersions import Draw\n"
        "from planfly.campaigns.dispersions import NAMES\n"
        "store = Store(Path(sys.argv[1]), 'a', {}, resume=False)\n"
        "for k in range(3): store.add(FlightRow(Draw(k, k, dict.fromkeys(NAMES, 0.0)), 'flyable', 'completed'))\n"
        "os.kill(os.getpid(), 9)\n"
    )
    subprocess.run([sys.executable, "-c", code, str(path)], check=False)
    with opened(path, resume=True) as store:
        assert list(store.outcomes()) == [0, 1, 2]


@pytest.mark.parametrize("how", ["folder removed", "file removed", "file replaced", "folder moved"])
@pytest.mark.parametrize("adding", [add_to_campaign, add_to_search])
def test_nothing_is_written_into_a_table_that_was_removed(
    base: CampaignBase, tmp_path: Path, adding: Callable[..., None], how: str
) -> None:
    """It ends at the next flight: what is written after it has no name any more."""
    folder = tmp_path / "campaign"
    path = folder / "c.sqlite"
    folder.mkdir()

    def rows() -> Iterator[FlightRow]:
        yield all_fly(base, 0)
        if how == "folder removed":
            shutil.rmtree(folder)
        elif how == "folder moved":
            folder.rename(tmp_path / "moved")
        else:
            path.unlink()
            if how == "file replaced":
                path.write_bytes(b"another's")
        yield all_fly(base, 1)
        raise AssertionError("a second flight was taken")

    with pytest.raises(OSError, match=r"was removed or replaced by another file.*c\.sqlite"):
        adding(path, rows(), resume=False)


def test_another_campaign_and_a_missing_one_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "c.sqlite"
    with pytest.raises(StoreError, match="no such campaign"):
        opened(path, resume=True)
    assert not path.exists()
    opened(path).__exit__(None, None, None)
    with pytest.raises(StoreError, match=r"other settings: planfly's code differs"):
        opened(path, "b", resume=True)


def test_a_search_s_table_is_no_campaign_s(base: CampaignBase, tmp_path: Path) -> None:
    add_to_campaign(tmp_path / "c", [all_fly(base, 0)], resume=False)
    add_to_search(tmp_path / "w", [all_fly(base, 0)], resume=False)
    with pytest.raises(StoreError, match=rf"expected {WINDS_KIND.schema}"):
        add_to_search(tmp_path / "c", [], resume=True)
    with pytest.raises(StoreError, match=rf"expected {CAMPAIGN_KIND.schema}"):
        add_to_campaign(tmp_path / "w", [], resume=True)
    assert len(table(tmp_path / "c")) == len(table(tmp_path / "w")) == 1


def test_every_rule_has_its_columns() -> None:
    for rule in RULE_WORDS.values():
        assert {f"margin_{rule.name}", f"place_{rule.name}"} <= set(CAMPAIGN_KIND.columns) & set(WINDS_KIND.columns)
        assert rule.scale is None or rule.scale > 0.0


def test_a_table_with_other_columns_is_not_gone_on_with(
    base: CampaignBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_to_campaign(tmp_path / "c", [all_fly(base, 0)], resume=False)
    before = CAMPAIGN_KIND.schema
    more = replace(CAMPAIGN_KIND, columns={**CAMPAIGN_KIND.columns, "margin_new": "REAL", "place_new": "TEXT"})
    monkeypatch.setattr("planfly.campaigns.tables.CAMPAIGN_KIND", more)
    with pytest.raises(StoreError, match=rf"schema '{before}': expected {more.schema}"):
        opened(tmp_path / "c", resume=True)


@pytest.mark.parametrize("holder", ["another store", "another program"])
def test_a_held_table_is_refused_and_loses_nothing(base: CampaignBase, tmp_path: Path, holder: str) -> None:
    path = tmp_path / "c.sqlite"
    with opened(path) as store:
        store.add(all_fly(base, 0))
        if holder == "another store":
            with pytest.raises(StoreError, match="locked by another process"):
                opened(path, resume=True)
            with pytest.raises(StoreError, match="locked by another process"):
                check_not_locked(path)
    if holder == "another program":
        other = sqlite3.connect(path, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(StoreError, match="locked by another process"):
            opened(path, resume=True)
        with pytest.raises(StoreError, match="locked by another process"):
            check_not_locked(path)
        other.close()
    check_not_locked(path)
    with opened(path, resume=True) as store:
        assert store.tally() == Tally(1, 0)


def test_a_file_that_is_no_table_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "c.sqlite"
    path.write_bytes(b"not a database at all, but long enough to be read as one" * 40)
    with pytest.raises(StoreError, match="not a database"):
        opened(path, resume=True)
    # Nor is it anybody's.
    check_not_locked(path)


@pytest.mark.parametrize("add", [add_to_campaign, add_to_search])
def test_a_full_disk_is_told_and_keeps_what_was_written(
    base: CampaignBase, tmp_path: Path, add: Callable[..., None]
) -> None:
    path, row = tmp_path / "c.sqlite", fly_one(base, 0)
    many = [replace(row, draw=replace(row.draw, index=k)) for k in range(100)]
    with pytest.raises(OSError, match="no space left") as told:
        add(path, many, resume=False, pages=12)
    assert told.value.filename == str(path)
    kept = [flight for flight, *_ in table(path)]
    # All before the one that found no margin.
    assert kept == list(range(len(kept)))
    assert 0 < len(kept) < 100
    add(path, many[len(kept) :], resume=True)
    assert len(table(path)) == 100
