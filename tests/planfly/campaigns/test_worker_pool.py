"""Processes that flights may be sent to, a cluster that forgets a campaign, and the rate of flights."""

import sys
import time
from pathlib import Path

import pytest

import planfly
from planfly.campaigns import worker_pool as worker_pool_module
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.worker_pool import (
    REPORT_INTERVAL_S,
    FlightRate,
    SchedulerError,
    Workers,
    check_scheduler_address,
    worker_pool,
)
from tests.planfly.campaigns.made_campaigns import made_flight, write_short
from world.interruption import Interrupted


@pytest.mark.parametrize(
    ("address", "whole"),
    [
        ("127.0.0.1:8786", "tcp://127.0.0.1:8786"),
        ("tcp://localhost:8786", "tcp://localhost:8786"),
        ("tcp://[::1]:8786", "tcp://[::1]:8786"),
        ("tls://10.0.0.7:8786", "tls://10.0.0.7:8786"),
    ],
)
def test_loopback_and_tls_are_let_in(address: str, whole: str) -> None:
    assert check_scheduler_address(address) == whole


@pytest.mark.parametrize(
    "address", ["tcp://10.0.0.7:8786", "10.0.0.7:8786", "tcp://example.org:8786", "tcp://0.0.0.0:8786", "tcp://[::]:1"]
)
def test_plain_tcp_beyond_loopback_is_refused(address: str) -> None:
    with pytest.raises(SchedulerError, match="tcp:// is allowed only on this machine"):
        check_scheduler_address(address)


@pytest.mark.parametrize("address", ["", "127.0.0.1", "ws://127.0.0.1:1", "tcp://:8786", "tcp://[", "tls://x"])
def test_what_is_no_address_is_told(address: str) -> None:
    with pytest.raises(SchedulerError, match="expected"):
        check_scheduler_address(address)


@pytest.mark.filterwarnings("default")
def test_a_scheduler_that_is_not_there_is_one_line(base: CampaignBase, monkeypatch: pytest.MonkeyPatch) -> None:
    dask_pool = pytest.importorskip("planfly.campaigns.dask_pool", exc_type=ImportError)
    monkeypatch.setattr(dask_pool, "_CONNECT_SECONDS", 0.5)
    with (
        pytest.raises(SchedulerError, match="no scheduler answers") as caught,
        worker_pool(Workers(None, "127.0.0.1:1"), base),
    ):
        pass
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("verb", [planfly.campaign, planfly.winds])
def test_a_scheduler_without_dask_names_the_extra_before_anything_is_written(
    verb: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    mission, scenario = write_short(tmp_path)
    before = set(tmp_path.iterdir())
    with pytest.raises(planfly.MissingExtraError, match="--scheduler needs the extra 'cluster'"):
        verb(mission, scenario=scenario, scheduler="127.0.0.1:8786", out=tmp_path / "out")  # type: ignore[operator]
    assert set(tmp_path.iterdir()) == before


@pytest.mark.parametrize("error", [ZeroDivisionError(), Interrupted(2)])
def test_a_cluster_forgets_a_campaign_however_it_ends(
    base: CampaignBase, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    dask_pool = pytest.importorskip("planfly.campaigns.dask_pool", exc_type=ImportError)
    told: list[str] = []

    class Client:
        def __enter__(self) -> "Client":
            return self

        def __exit__(self, *_: object) -> None:
            told.append("closed")

        def register_plugin(self, plugin: object) -> None:
            told.append(plugin.name)  # type: ignore[attr-defined]

        def unregister_worker_plugin(self, name: str) -> None:
            told.append(name)
            # As dask does where one of the workers has just died.
            raise OSError("Stream is closed")

    monkeypatch.setattr(dask_pool, "connect_client", lambda _: Client())
    with pytest.raises(type(error)), worker_pool(Workers(1, "tcp://127.0.0.1:8786"), base, made_flight):
        raise error
    assert told == [told[0], told[0], "closed"]


def test_flights_that_were_there_before_are_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    rate = FlightRate(40)
    assert not rate.is_due()
    now += 4.0
    assert rate.flights_per_second(60) == 5.0
    assert rate.is_due()
    assert not rate.is_due()
    now += REPORT_INTERVAL_S
    assert rate.is_due()


def test_as_many_processes_are_asked_for_as_there_are_cores(
    base: CampaignBase, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []

    class Pool:
        def __init__(self, count: int, *_: object) -> None:
            asked.append(count)

        def close(self) -> None:
            asked.append(0)

    monkeypatch.setattr(worker_pool_module, "LocalPool", Pool)
    monkeypatch.setattr("os.cpu_count", lambda: 7)
    for count in (None, 3):
        with worker_pool(Workers(count), base):
            pass
    assert asked == [7, 0, 3, 0]
