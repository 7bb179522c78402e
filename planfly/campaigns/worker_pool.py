"""The workers of a campaign: processes of this machine, or a running dask cluster's, and how fast they fly."""

import contextlib
import ipaddress
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol
from urllib.parse import urlsplit

from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.flight_requests import FlightRequest, Flown, FlyOne
from planfly.campaigns.flight_row import fly_one
from planfly.campaigns.local_pool import LocalPool
from world.errors import PlanflyError
from world.extras import need_extra

# Seconds between two lines of progress.
REPORTED_EVERY = 0.5


class SchedulerError(PlanflyError):
    """A scheduler cannot be used as it stands."""


@dataclass(frozen=True)
class Workers:
    """Place where a campaign is flown.

    count: processes on this machine; None for as many as it has cores.
    scheduler: address of a running dask scheduler; None for processes of this machine.
    """

    count: int | None = None
    scheduler: str | None = None


class WorkerPool(Protocol):
    """Workers that fly the flights of a campaign."""

    def fly(self, following: Callable[[], FlightRequest | None]) -> Iterator[Flown]:
        """Fly requests as they are asked for, and yield each when it is done, in any order."""


@contextlib.contextmanager
def worker_pool(workers: Workers, base: CampaignBase, fly: FlyOne = fly_one) -> Iterator[WorkerPool]:
    """Make the pool of a campaign; processes of this machine end with it, workers of a cluster forget the campaign.

    Raises SchedulerError for an address that may not be used, and a scheduler that does not answer.
    """
    if workers.scheduler is None:
        with contextlib.closing(LocalPool(workers.count or os.cpu_count() or 1, base, fly)) as pool:
            yield pool
        return
    address = checked_address(workers.scheduler)
    need_extra("cluster", "--scheduler needs")
    # Imported here: it is an extra.
    from planfly.campaigns.dask_pool import DaskPool, connect

    try:
        client = connect(address)
    except (OSError, ValueError) as error:
        raise SchedulerError.of_argument("scheduler", address, f"no scheduler answers: {error}") from error
    with client, contextlib.closing(DaskPool(client, base, fly)) as cluster:
        yield cluster


def checked_address(address: str) -> str:
    """Return a scheduler's address, if flights may be sent there: TLS anywhere, plain TCP on loopback only.

    A scheduler's workers run whatever they are sent.  Raises SchedulerError.

    >>> checked_address("127.0.0.1:8786"), checked_address("tls://10.0.0.7:8786")
    ('tcp://127.0.0.1:8786', 'tls://10.0.0.7:8786')
    >>> checked_address("tcp://10.0.0.7:8786")
    Traceback (most recent call last):
    ...
    planfly.campaigns.worker_pool.SchedulerError: scheduler tcp://10.0.0.7:8786: plain TCP beyond loopback; ...
    """
    whole = address if "://" in address else f"tcp://{address}"
    try:
        parts = urlsplit(whole)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not host or not port or parts.scheme not in ("tcp", "tls"):
        allowed = "tcp://HOST:PORT on this machine, or tls://HOST:PORT, is expected"
        raise SchedulerError.of_argument("scheduler", address, allowed)
    if parts.scheme == "tcp" and not _is_loopback(host):
        allowed = "plain TCP beyond loopback; use tls://, with certificates in dask's configuration"
        raise SchedulerError.of_argument("scheduler", address, allowed)
    return whole


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


class FlightRate:
    """Flights a second since it was made; known: flights that were there before."""

    def __init__(self, known: int) -> None:
        self._known = known
        self._started = self._reported = time.monotonic()

    def due(self) -> bool:
        """Return True if it is time to report again, and count the time from now on."""
        now = time.monotonic()
        if now - self._reported < REPORTED_EVERY:
            return False
        self._reported = now
        return True

    def a_second(self, flights: int) -> float:
        """Return the flights a second, with so many flights there by now; 0 before the first."""
        return (flights - self._known) / max(time.monotonic() - self._started, 1e-3)
