"""The table does not depend on who flew, in which order, or how often it was interrupted."""

import contextlib
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from planfly.campaigns.engine.cluster import Workers
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.fly_campaign import _Book, fly_campaign, open_store
from planfly.campaigns.statistics.decision import Estimator, Goal
from planfly.campaigns.statistics.proportions import Tally
from planfly.campaigns.storage.store import DATABASE, NOT_THE_SAME, StoreError, read_table
from tests.planfly.campaigns.made_campaigns import all_fly, made_flight, short_base, slow_flight
from tests.soak import SOAK, note

pytestmark = pytest.mark.filterwarnings("default")


def table(folder: Path) -> dict[str, list[object]]:
    return {name: values for name, values in read_table(folder / DATABASE).items() if name not in NOT_THE_SAME}


def flown(base: CampaignBase, goal: Goal, folder: Path, workers: Workers, fly: object = made_flight) -> object:
    folder.mkdir(exist_ok=True)
    resume = (folder / DATABASE).exists()
    with open_store(base, goal, folder, resume=resume) as store:
        return fly_campaign(base, goal, workers, store, fly=fly)


def expected(base: CampaignBase, folder: Path, count: int, fly: object = made_flight) -> dict[str, list[object]]:
    """The table as one process writes it, flight after flight."""
    folder.mkdir()
    with open_store(base, Goal(None, False, count), folder, resume=False) as store:
        for k in range(count):
            store.add(fly(base, k))
    return table(folder)


@pytest.mark.parametrize("order", range(6))
def test_it_decides_in_the_order_of_indices_whoever_was_quicker(order: int) -> None:
    goal = Goal(0.95, True, 500)
    shuffled = list(range(80))
    random.Random(order).shuffle(shuffled)
    book = _Book(Estimator(goal), goal)
    for index in shuffled:
        book.add(index, "flyable")
    # 59 flights without a failure show 0.95; those beyond are not looked at.
    assert book.decided
    assert book.tally == Tally(59, 0)
    assert book.following() is None


def test_what_is_known_is_not_sent_again() -> None:
    goal = Goal(None, False, 6)
    book = _Book(Estimator(goal), goal)
    for known in (0, 1, 3):
        book.add(known, "flyable")
    sent = []
    while (order := book.following()) is not None:
        sent.append(order.index)
    assert sent == [2, 4, 5]


def test_the_table_is_the_same_for_any_workers_and_after_a_stop(base: CampaignBase, tmp_path: Path) -> None:
    count = 60 if SOAK else 24
    goal, want = Goal(None, False, count), expected(base, tmp_path / "one", count)
    for workers in (1, 2, 4) if SOAK else (2,):
        flown(base, goal, tmp_path / f"w{workers}", Workers(workers))
        assert table(tmp_path / f"w{workers}") == want
    # Part of it first, with a gap, as one who was stopped leaves it.
    folder = tmp_path / "part"
    folder.mkdir()
    with open_store(base, Goal(None, False, count), folder, resume=False) as store:
        for k in (0, 1, 2, 5, 9):
            store.add(made_flight(base, k))
    flown(base, goal, folder, Workers(2))
    assert table(folder) == want


@pytest.mark.skipif(not SOAK, reason="a cluster for what its book is asked above: in make soak")
def test_prove_keeps_the_flights_that_decide_and_no_more(base: CampaignBase, tmp_path: Path) -> None:
    goal = Goal(0.9, True, 500)
    found = flown(base, goal, tmp_path / "p", Workers(2), all_fly)
    assert found.answer == "reached"
    assert table(tmp_path / "p") == expected(base, tmp_path / "one", 29, all_fly)


_CLIENT = """
import sys
from pathlib import Path
from planfly.campaigns.engine.cluster import Workers
from planfly.campaigns.fly_campaign import fly_campaign, open_store
from planfly.campaigns.statistics.decision import Goal
from tests.planfly.campaigns.made_campaigns import short_base, slow_flight

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    base, goal = short_base(folder), Goal(None, False, int(sys.argv[2]))
    with open_store(base, goal, folder, resume=(folder / "campaign.sqlite").exists()) as store:
        fly_campaign(base, goal, Workers(2), store, fly=slow_flight)
"""


@pytest.mark.skipif(not SOAK, reason="stopped for twelve seconds: in make soak")
def test_a_sleeping_laptop_costs_no_worker(tmp_path: Path) -> None:
    """All processes are stopped for longer than a scheduler would wait for a worker's sign of life."""
    folder, count = tmp_path / "slept", 150
    folder.mkdir()
    script = tmp_path / "client.py"
    script.write_text(_CLIENT)
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(sys.path),
        "DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": "1s",
    }
    client = subprocess.Popen(
        [sys.executable, str(script), str(folder), str(count)], env=environment, start_new_session=True
    )
    until, sizes = time.monotonic() + 120.0, set()
    # It is under way: the table grows.
    while len(sizes) < 4:
        assert client.poll() is None
        assert time.monotonic() < until
        time.sleep(0.05)
        sizes.add(sum(path.stat().st_size for path in folder.glob(f"{DATABASE}*")))
    os.killpg(client.pid, signal.SIGSTOP)
    time.sleep(12.0)
    os.killpg(client.pid, signal.SIGCONT)
    assert client.wait(120.0) == 0
    assert table(folder) == expected(short_base(folder), tmp_path / "one", count)
    assert len(set(read_table(folder / DATABASE)["worker"])) == 2
    note("campaign: stopped for 12 s", flights=count, workers_lost=0)


def test_a_killed_client_loses_no_flight(tmp_path: Path) -> None:
    kills, count = (20, 300) if SOAK else (1, 60)
    folder = tmp_path / "killed"
    folder.mkdir()
    script = tmp_path / "client.py"
    script.write_text(_CLIENT)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    moments, known = random.Random(3), 0
    for _ in range(kills):
        client = subprocess.Popen([sys.executable, str(script), str(folder), str(count)], env=environment)
        if SOAK:
            time.sleep(moments.uniform(1.0, 8.0))
        else:
            _wait_until(lambda: (folder / DATABASE).exists() and len(table(folder).get("flight", [])) > 3)
        client.send_signal(signal.SIGKILL)
        client.wait()
        if (folder / DATABASE).exists():
            now = len(table(folder)["flight"]) if table(folder) else 0
            assert now >= known
            known = now
    subprocess.run([sys.executable, str(script), str(folder), str(count)], env=environment, check=True)
    assert table(folder) == expected(short_base(folder), tmp_path / "one", count)
    note("campaign: kill -9 of its client", kills=kills, flights=count, lost=0)


def _wait_until(there: Callable[[], bool], seconds: float = 60.0) -> None:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        # The client that writes it holds the table.
        with contextlib.suppress(StoreError):
            if there():
                return
        time.sleep(0.1)
    raise AssertionError("it did not come")


def test_a_killed_worker_loses_no_flight(base: CampaignBase, tmp_path: Path) -> None:
    kills, count = (20, 1200) if SOAK else (2, 100)
    moments, begun, over, killed = random.Random(5), threading.Event(), threading.Event(), []

    def kill() -> None:
        begun.wait()
        while len(killed) < kills and not over.wait(moments.uniform(0.3, 1.2)):
            children = psutil.Process().children(recursive=True)
            workers = [one.pid for one in children if "spawn_main" in " ".join(one.cmdline())]
            if workers:
                killed.append(moments.choice(workers))
                os.kill(killed[-1], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    goal = Goal(None, False, count)
    with open_store(base, goal, tmp_path, resume=False) as store:
        killer.start()
        try:
            fly_campaign(base, goal, Workers(2), store, lambda *_: begun.set(), fly=slow_flight)
        finally:
            begun.set()
            over.set()
            killer.join()
    assert len(killed) == kills
    assert table(tmp_path) == expected(base, tmp_path / "one", count)
    note("campaign: kill -9 of its workers", kills=kills, flights=count, lost=0)


def test_a_real_scheduler_gives_the_same_table(base: CampaignBase, tmp_path: Path) -> None:
    count = 400 if SOAK else 12
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(Path.cwd()), *sys.path])}
    dask = [sys.executable, "-m", "dask"]
    scheduler = subprocess.Popen(
        [*dask, "scheduler", "--host", "127.0.0.1", "--port", "18786", "--no-dashboard"], env=environment
    )
    line = [*dask, "worker", "tcp://127.0.0.1:18786", "--nthreads", "1", "--host", "127.0.0.1", "--no-dashboard"]
    workers = [subprocess.Popen(line, env=environment) for _ in range(2)]
    try:
        flown(base, Goal(None, False, count), tmp_path / "far", Workers(None, "tcp://127.0.0.1:18786"))
    finally:
        for process in (*workers, scheduler):
            process.terminate()
            process.wait()
    assert table(tmp_path / "far") == expected(base, tmp_path / "one", count)
