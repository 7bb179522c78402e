"""Provide the workers of a campaign, on this machine or on a dask cluster.

The rate of their flights is measured.
"""

import contextlib
import ipaddress
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol
from urllib.parse import urlsplit

from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.flight_requests import FinishedFlight, FlightRequest, FlyOne
from planfly.campaigns.flight_row import fly_one
from planfly.campaigns.local_pool import LocalPool
from world.errors import PlanflyError
from world.extras import require_extra

# Minimum time between two progress reports, s.
REPORT_INTERVAL_S = 0.5


class SchedulerError(PlanflyError):
    """Raised for a scheduler that cannot be used."""


@dataclass(frozen=True)
class Workers:
    """Workers that fly a campaign.

    count: number of processes on this machine; None for the number of its cores.
    scheduler: address of a running dask scheduler; None for local processes.
    """

    count: int | None = None
    scheduler: str | None = None


class WorkerPool(Protocol):
    """Workers that fly the flights of a campaign."""

    def fly(self, next_request: Callable[[], FlightRequest | None]) -> Iterator[FinishedFlight]:
        """Fly the requests that `next_request` returns, and yield each flight when it is done, in any order."""


@contextlib.contextmanager
def worker_pool(workers: Workers, base: CampaignBase, fly: FlyOne = fly_one) -> Iterator[WorkerPool]:
    """Yield the pool of workers that fly a campaign.

    base: inputs that all flights of the campaign share.
    fly: function that flies one flight of the campaign.

    On exit, local processes are ended, or the campaign is removed from a cluster's workers.  Raises SchedulerError for
    an address that is not allowed, and for a scheduler that does not answer.
    """
    if workers.scheduler is None:
        with contextlib.closing(LocalPool(workers.count or os.cpu_count() or 1, base, fly)) as pool:
            yield pool
        return
    address = check_scheduler_address(workers.scheduler)
    require_extra("cluster", "--scheduler needs")
    # Imported here because dask is an optional dependency.
    from planfly.campaigns.dask_pool import DaskPool, connect_client

    try:
        client = connect_client(address)
    except (OSError, ValueError) as error:
        raise SchedulerError.of_argument("scheduler", address, f"no scheduler answers: {error}") from error
    with client, contextlib.closing(DaskPool(client, base, fly)) as cluster:
        yield cluster


def check_scheduler_address(address: str) -> str:
    """Return the full address of a scheduler; an address without a scheme gets tcp://.

    Raises SchedulerError for an invalid address, and for plain TCP to another machine, because the workers of a
    scheduler run any code sent to them.  TLS is allowed for any host.

    >>> check_scheduler_address("127.0.0.1:8786"), check_scheduler_address("tls://10.0.0.7:8786")
    ('tcp://127.0.0.1:8786', 'tls://10.0.0.7:8786')
    >>> check_scheduler_address("tcp://10.0.0.7:8786")
    Traceback (most recent call last):
    ...
    planfly.campaigns.worker_pool.SchedulerError: scheduler tcp://10.0.0.7:8786: tcp:// is allowed only ...
    """
    full_address = address if "://" in address else f"tcp://{address}"
    try:
        parts = urlsplit(full_address)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not host or not port or parts.scheme not in ("tcp", "tls"):
        allowed = "expected tcp://HOST:PORT on this machine, or tls://HOST:PORT"
        raise SchedulerError.of_argument("scheduler", address, allowed)
    is_loopback = host == "localhost"
    with contextlib.suppress(ValueError):
        is_loopback = is_loopback or ipaddress.ip_address(host).is_loopback
    if parts.scheme == "tcp" and not is_loopback:
        allowed = "tcp:// is allowed only on this machine; use tls://, with certificates in dask's configuration"
        raise SchedulerError.of_argument("scheduler", address, allowed)
    return full_address


class FlightRate:
    """Clock of a campaign: rate of the flights since this object was created, and time of the next report.

    stored_count: number of flights in the table at the start.
    """

    def __init__(self, stored_count: int) -> None:
        self._stored_count = stored_count
        self._start_time = self._last_report = time.monotonic()

    def is_due(self) -> bool:
        """Return True if `REPORT_INTERVAL_S` has passed since the last report; the interval then starts again."""
        now = time.monotonic()
        if now - self._last_report < REPORT_INTERVAL_S:
            return False
        self._last_report = now
        return True

    def flights_per_second(self, flights: int) -> float:
        """Return the flights per second since the start; `flights` includes the flights stored before."""
        return (flights - self._stored_count) / max(time.monotonic() - self._start_time, 1e-3)
