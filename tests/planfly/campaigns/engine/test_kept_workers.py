"""Workers that stay away are started anew: what is asked of a cluster, and by a cluster whose workers all die."""

import contextlib
import os
import random
import signal
import time
from collections.abc import Callable
from typing import Any

import psutil
import pytest

from planfly.campaigns.engine import kept_workers as module
from planfly.campaigns.engine.cluster import Workers, connected
from planfly.campaigns.engine.kept_workers import kept_workers
from tests.planfly.campaigns.kills import spawned_processes
from tests.soak import SOAK, note


class FewWorkers:
    """A cluster of two, or more, of which so many are there."""

    def __init__(self, there: int, started: int = 2) -> None:
        self.scheduler_info = {"workers": dict.fromkeys(range(there))}
        self.worker_spec = dict.fromkeys(range(started))
        self.asked: list[int] = []

    def scale(self, n: int) -> None:
        self.asked.append(n)
        self.worker_spec = dict.fromkeys(range(n))


def until(there: Callable[[], Any], seconds: float) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end and not there():
        time.sleep(0.05)
    return bool(there())


@pytest.mark.parametrize(("there", "asked"), [(0, [2, 4]), (1, [2, 3])])
def test_the_missing_are_asked_for_by_their_names_then_by_new_ones(
    there: int, asked: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_LOOK", 0.01)
    cluster = FewWorkers(there)
    with kept_workers(cluster, 2, patience=0.05):
        assert until(lambda: len(cluster.asked) > 1, 10.0)
    assert cluster.asked[:2] == asked


@pytest.mark.parametrize(("there", "started"), [(3, 3), (2, 4)])
def test_those_that_are_too_many_end(there: int, started: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who stayed away came back after others had been started, or may still."""
    monkeypatch.setattr(module, "_LOOK", 0.01)
    cluster = FewWorkers(there, started)
    with kept_workers(cluster, 2, patience=60.0):
        assert until(lambda: bool(cluster.asked), 10.0)
    assert cluster.asked == [2]


def test_nothing_is_asked_while_all_are_there_or_not_long_away(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_LOOK", 0.01)
    whole, away = FewWorkers(2), FewWorkers(0)
    with kept_workers(whole, 2, patience=0.0), kept_workers(away, 2, patience=60.0):
        time.sleep(0.3)
    assert whole.asked == away.asked == []


@pytest.mark.skipif(not SOAK, reason="kills all workers while they start, and waits for others: in make soak")
@pytest.mark.filterwarnings("default")
def test_workers_that_all_die_while_they_start_come_back() -> None:
    moments, ages, kills = random.Random(1), dict[int, float](), 0
    with connected(Workers(2)) as client:
        end = time.monotonic() + 90.0
        gone_since = end
        while time.monotonic() < min(end, gone_since + 5.0):
            workers = spawned_processes()
            gone_since = end if workers else min(gone_since, time.monotonic())
            for number in workers:
                with contextlib.suppress(psutil.NoSuchProcess):
                    age = time.time() - psutil.Process(number).create_time()
                    if age > ages.setdefault(number, moments.uniform(0.1, 2.2)):
                        os.kill(number, signal.SIGKILL)
                        kills += 1
            time.sleep(0.02)
        assert until(lambda: len(client.nthreads()) == 2, 90.0)
    note("campaign: workers killed while they start", kills=kills, came_back=2)
