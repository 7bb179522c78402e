"""The table does not depend on who flew, in which order, or how often it was interrupted."""

import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from planfly.campaigns import fly_campaign as fly_campaign_module
from planfly.campaigns.campaign_base import CampaignBase, GivenWind
from planfly.campaigns.flight_requests import LOST_REASON, FlightRequest, FlyOne
from planfly.campaigns.flight_row import FlightRow, fly_one, make_lost_row
from planfly.campaigns.fly_campaign import (
    _FlightTally,
    fly_campaign,
    open_store,
    resumed_goal,
)
from planfly.campaigns.statistics.decision import Estimate, Estimator, Goal, Tally, lower_bound
from planfly.campaigns.summary import summarise_campaign
from planfly.campaigns.tables import CAMPAIGN_DATABASE, StoreError, read_stored_settings, read_table
from planfly.campaigns.worker_pool import Workers
from tests.planfly.campaigns.kills import finish_client, kill_while_it_flies, start_client, workers_killed
from tests.planfly.campaigns.made_campaigns import (
    all_fly,
    made_flight,
    short_base,
    slow_flight,
    table,
)
from tests.planfly.campaigns.made_searches import hire_here
from tests.soak import SOAK, note, only_in_soak, scaled

pytestmark = pytest.mark.filterwarnings("default")


def flown(base: CampaignBase, goal: Goal, folder: Path, workers: Workers, fly: FlyOne = made_flight) -> Estimate:
    folder.mkdir(exist_ok=True)
    resume = (folder / CAMPAIGN_DATABASE).exists()
    with open_store(base, goal, folder, resume=resume) as store:
        return fly_campaign(base, goal, workers, store, fly=fly)


def expected(base: CampaignBase, folder: Path, count: int, fly: FlyOne = made_flight) -> list[tuple[Any, ...]]:
    """The table as one process writes it, flight after flight."""
    folder.mkdir()
    keep(base, folder, range(count), fly)
    return table(folder / CAMPAIGN_DATABASE)


def keep(base: CampaignBase, folder: Path, flights: Iterable[int], fly: FlyOne = made_flight) -> None:
    """Write some flights down, in a new table."""
    folder.mkdir(exist_ok=True)
    with open_store(base, Goal(None, False, 1), folder, resume=False) as store:
        for k in flights:
            store.add(fly(base, k, None))


@pytest.mark.parametrize("order", range(6))
def test_it_decides_in_the_order_of_indices_whoever_was_quicker(order: int) -> None:
    goal = Goal(0.95, True, 500)
    shuffled = list(range(80))
    random.Random(order).shuffle(shuffled)
    book = _FlightTally(Estimator(goal), goal)
    for index in shuffled:
        book.add(index, "flyable")
    # 59 flights without a failure show 0.95; those beyond are not looked at.
    assert book.is_decided
    assert book.tally == Tally(59, 0)
    assert book.next_request() is None


def test_what_is_known_is_not_sent_again() -> None:
    goal = Goal(None, False, 6)
    book = _FlightTally(Estimator(goal), goal)
    for known in (0, 1, 3):
        book.add(known, "flyable")
    sent = []
    while (order := book.next_request()) is not None:
        sent.append(order.index)
    assert sent == [2, 4, 5]


def test_the_last_line_of_progress_counts_every_flight(
    base: CampaignBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class AtOnce:
        def fly(self, next_request: Callable[[], FlightRequest | None]) -> Iterator[tuple[FlightRequest, FlightRow]]:
            while (order := next_request()) is not None:
                yield order, made_flight(base, order.index, None)

    goal, told = Goal(None, False, 6), list[tuple[float, float, str]]()
    monkeypatch.setattr("planfly.campaigns.fly_campaign.worker_pool", lambda *_: nullcontext(AtOnce()))
    monkeypatch.setattr("planfly.campaigns.worker_pool.REPORT_INTERVAL_S", 86_400.0)
    with open_store(base, goal, tmp_path, resume=False) as store:
        fly_campaign(base, goal, Workers(1), store, lambda *said: told.append(said))
    # How many there are is said before the first; no other line is due.
    assert [said[:2] for said in told] == [(0.0, 6.0), (6.0, 6.0)]
    assert told[-1][2].startswith("6 flights, probability ")
    assert told[-1][2].endswith(", 0 s left")


def test_the_table_is_the_same_for_any_workers_and_after_a_stop(base: CampaignBase, tmp_path: Path) -> None:
    count = 60 if SOAK else 24
    goal, want = Goal(None, False, count), expected(base, tmp_path / "one", count)
    for workers in (1, 2, 4) if SOAK else ():
        flown(base, goal, tmp_path / f"w{workers}", Workers(workers))
        assert table(tmp_path / f"w{workers}" / CAMPAIGN_DATABASE) == want
    # Part of it first, with a gap, as one who was stopped leaves it.
    keep(base, tmp_path / "part", (0, 1, 2, 5, 9))
    flown(base, goal, tmp_path / "part", Workers(2))
    assert table(tmp_path / "part" / CAMPAIGN_DATABASE) == want


def kept_goal(folder: Path, confidence: float | None = None) -> Goal:
    """Return the goal of a campaign that is resumed without a goal."""
    return resumed_goal(Goal(None, False, 300), folder, confidence, keeps_target=True, keeps_flights=True)


def test_a_campaign_that_is_gone_on_with_keeps_its_goal(base: CampaignBase, tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="there is no campaign to continue"):
        kept_goal(tmp_path)
    asked = Goal(0.9, False, 40, 0.8)
    with open_store(base, asked, tmp_path, resume=False):
        pass
    assert kept_goal(tmp_path) == asked
    assert kept_goal(tmp_path, 0.95) == replace(asked, confidence=0.95)
    assert resumed_goal(Goal(None, False, 42), tmp_path, keeps_target=True) == replace(asked, flights=42, changed=True)
    assert resumed_goal(Goal(0.9, False, 40), tmp_path) == asked
    assert resumed_goal(Goal(0.9, False, 40), tmp_path, 0.95) == Goal(0.9, False, 40, 0.95)
    assert resumed_goal(replace(asked, target=0.95), tmp_path) == replace(asked, target=0.95)
    asked_anew = Goal(0.95, False, 300, 0.8)
    assert resumed_goal(asked_anew, tmp_path, keeps_flights=True) == replace(asked, target=0.95, confidence=0.8)
    # The maximum of a proof is no number of flights fixed beforehand.
    assert resumed_goal(replace(asked_anew, stops=True), tmp_path, keeps_flights=True).flights == 300


def test_a_number_of_flights_that_was_changed_is_said_to_be(base: CampaignBase, tmp_path: Path) -> None:
    """Bounds for a number fixed beforehand are no such bounds then; nor is it forgotten at the next time."""
    keep(base, tmp_path, range(3))
    more = resumed_goal(Goal(None, False, 6), tmp_path)
    assert more.changed
    assert "changed" in more.bound_method
    assert "changed" not in Goal(None, False, 6).bound_method
    with open_store(base, more, tmp_path, resume=True):
        pass
    assert kept_goal(tmp_path) == resumed_goal(Goal(None, False, 6), tmp_path) == more
    # One that stops is valid at any number.
    assert "changed" not in resumed_goal(Goal(0.9, True, 6), tmp_path).bound_method


def test_fewer_flights_than_were_flown_are_refused_and_none_is_lost(base: CampaignBase, tmp_path: Path) -> None:
    with open_store(base, Goal(None, False, 5), tmp_path, resume=False) as store:
        for k in range(5):
            store.add(made_flight(base, k, None))
    before = table(tmp_path / CAMPAIGN_DATABASE)
    with pytest.raises(StoreError, match="flights 4: the table already contains 5 flights"):
        open_store(base, Goal(None, False, 4), tmp_path, resume=True)
    assert table(tmp_path / CAMPAIGN_DATABASE) == before
    # Nor are the refused question's settings kept.
    assert read_stored_settings(tmp_path / CAMPAIGN_DATABASE)["flights"] == 5
    assert kept_goal(tmp_path) == Goal(None, False, 5)
    with open_store(base, Goal(None, False, 5), tmp_path, resume=True) as store:
        assert store.tally().flown == 5


@pytest.mark.skipif(not SOAK, reason="flights in earnest on seven workers: in make soak")
def test_real_flights_are_the_same_on_any_workers(base: CampaignBase, tmp_path: Path) -> None:
    goal, want = Goal(None, False, 20), expected(base, tmp_path / "one", 20, fly_one)
    for workers in (1, 2, 4):
        keep(base, tmp_path / f"w{workers}", (1, 7)[: workers - 1], fly_one)
        flown(base, goal, tmp_path / f"w{workers}", Workers(workers), fly_one)
        assert table(tmp_path / f"w{workers}" / CAMPAIGN_DATABASE) == want
    note("campaign: real flights on 1, 2 and 4 workers", flights=20, other=0)


def lost_fifth(base: CampaignBase, index: int, wind: GivenWind | None = None) -> FlightRow:
    """Make a flight; flight 5 is one that a pool has given up."""
    return make_lost_row(base, 5, LOST_REASON) if index == 5 else made_flight(base, index, wind)


def test_a_deadly_flight_is_named_and_counts_against(
    base: CampaignBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A flight that its pool gives up: which it gives up is tested in test_local_pool.py and test_dask_pool.py."""
    monkeypatch.setattr(fly_campaign_module, "worker_pool", hire_here)
    goal, count = Goal(None, False, 12), 12
    found = flown(base, goal, tmp_path, Workers(2), lost_fifth)
    others = [row for row in expected(base, tmp_path / "one", count) if row[0] != 5]
    assert [row for row in table(tmp_path / CAMPAIGN_DATABASE) if row[0] != 5] == others
    with open_store(base, goal, tmp_path, resume=True) as store:
        assert store.flight(5) == make_lost_row(base, 5, LOST_REASON)
        assert summarise_campaign(base, goal, found, store).lost == (5,)
    flyable = found.tally.flyable
    assert found.tally == Tally(flyable, 11 - flyable, 1)
    assert found.lower == lower_bound(Tally(flyable, 12 - flyable))


@pytest.mark.skipif(not SOAK, reason="two processes for what its book is asked above: in make soak")
def test_prove_keeps_the_flights_that_decide_and_no_more(base: CampaignBase, tmp_path: Path) -> None:
    goal = Goal(0.9, True, 500)
    found = flown(base, goal, tmp_path / "p", Workers(2), all_fly)
    assert found.answer == "reached"
    assert table(tmp_path / "p" / CAMPAIGN_DATABASE) == expected(base, tmp_path / "one", 29, all_fly)


@pytest.mark.skipif(not SOAK, reason="stopped for twelve seconds: in make soak")
def test_a_sleeping_laptop_costs_no_worker(tmp_path: Path) -> None:
    """All processes are stopped for a while."""
    folder, count = tmp_path / "slept", 150
    folder.mkdir()
    client = start_client("campaign", folder, count)
    # It is under way.
    for _ in range(4):
        assert client.stdout is not None
        client.stdout.readline()
    os.killpg(client.pid, signal.SIGSTOP)
    time.sleep(12.0)
    os.killpg(client.pid, signal.SIGCONT)
    client.communicate(timeout=120.0)
    assert client.returncode == 0
    assert table(folder / CAMPAIGN_DATABASE) == expected(short_base(folder), tmp_path / "one", count)
    assert len(set(read_table(folder / CAMPAIGN_DATABASE)["worker"])) == 2
    note("campaign: stopped for 12 s", flights=count, workers_lost=0)


@pytest.mark.skipif(not SOAK, reason="a table after a kill, and gone on with, above and in its own tests: in make soak")
def test_a_killed_client_loses_no_flight(tmp_path: Path) -> None:
    kills, count = scaled(20, 1), scaled(400, 20)
    folder = tmp_path / "killed"
    folder.mkdir()
    moments, written = random.Random(3), set[int]()
    for _ in range(kills):
        after = moments.randint(1, 12)
        said = kill_while_it_flies("campaign", folder, count, after, moments.uniform(0.0, 0.2))
        # None that was written is flown again.
        assert not said & written
        written |= said
        assert written <= {row[0] for row in table(folder / CAMPAIGN_DATABASE)}
    last = finish_client("campaign", folder, count)
    assert not last & written
    assert table(folder / CAMPAIGN_DATABASE) == expected(short_base(folder), tmp_path / "one", count)
    note("campaign: kill -9 of its client", kills=kills, flights=count, lost=0)


def test_a_killed_worker_loses_no_flight(base: CampaignBase, tmp_path: Path) -> None:
    kills, count = scaled(20, 1), scaled(1200, 40)
    # A process takes some seconds to start, and the other one flies on.
    pause = (0.3, 1.2) if SOAK else (0.1, 0.4)
    begun, goal = threading.Event(), Goal(None, False, count)
    with open_store(base, goal, tmp_path, resume=False) as store, workers_killed(kills, begun, pause=pause) as killed:
        fly_campaign(base, goal, Workers(2), store, lambda done, *_: begun.set() if done else None, fly=slow_flight)
    assert len(killed) == kills
    assert table(tmp_path / CAMPAIGN_DATABASE) == expected(base, tmp_path / "one", count)
    note("campaign: kill -9 of its workers", kills=kills, flights=count, lost=0)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, "subprocess.Popen[bytes]"]]:
    """A scheduler of its own with two workers: its address, and the second worker's process."""
    pytest.importorskip("distributed")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(Path.cwd()), *sys.path])}
    dask, file = [sys.executable, "-m", "dask"], tmp_path / "scheduler.json"
    found = ["--scheduler-file", str(file), "--no-dashboard", "--host", "127.0.0.1"]
    started = [subprocess.Popen([*dask, "scheduler", *found, "--port", "0"], env=environment)]
    try:
        while not file.exists():
            assert started[0].poll() is None
            time.sleep(0.05)
        line = [*dask, "worker", *found, "--nthreads", "1", "--no-nanny"]
        started += [subprocess.Popen(line, env=environment) for _ in range(2)]
        yield json.loads(file.read_text(encoding="utf-8"))["address"], started[-1]
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait()


@only_in_soak
def test_a_real_scheduler_with_a_worker_killed_gives_the_same_table(
    base: CampaignBase, tmp_path: Path, cluster: tuple[str, "subprocess.Popen[bytes]"]
) -> None:
    count = scaled(400, 40)
    address, worker = cluster
    goal, want = Goal(None, False, count), expected(base, tmp_path / "one", count)
    rows: list[str] = []

    def kill_one(done: float, *_: object) -> None:
        if done >= 6.0 and worker.poll() is None:
            worker.kill()
            worker.wait()

    for name, flights in (("whole", ()), ("part", (0, 3, 4))):
        keep(base, tmp_path / name, flights)
        with open_store(base, goal, tmp_path / name, resume=True) as store:
            fly_campaign(base, goal, Workers(None, address), store, kill_one, fly=slow_flight)
        assert table(tmp_path / name / CAMPAIGN_DATABASE) == want
        rows += read_table(tmp_path / name / CAMPAIGN_DATABASE)["worker"].tolist()
    assert worker.poll() is not None
    assert {row.partition("://")[0] for row in rows if "://" in row} == {"tcp"}
