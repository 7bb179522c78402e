"""Fly a campaign on the workers of a running dask cluster; no other module of planfly imports dask.

Each worker shows by its fingerprint that its flights would be identical to this process's flights, receives the
campaign once, and gets at most as many flights at a time as it has threads.
"""

import contextlib
import itertools
import logging
import uuid
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any, cast

import distributed
from distributed import CancelledError, KilledWorker, WorkerPlugin, get_worker

from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.flight_requests import (
    LOST_REASON,
    MAX_WORKER_DEATHS,
    CampaignCopy,
    FinishedFlight,
    FlightRequest,
    FlyOne,
    fingerprint,
)
from planfly.campaigns.flight_row import FlightRow, fly_one, make_lost_row
from world.errors import PlanflyError
from world.interruption import Interrupted

# Timeout for the connection to a scheduler, s.
_CONNECT_SECONDS = 20
# Number of task names that are used in turn; dask keeps the last 100,000 tasks, so an old name is free again in time.
_TASK_NAME_COUNT = 4096


def connect_client(address: str) -> Any:
    """Connect to a scheduler with the security settings of dask's configuration; return its client.

    address: address of the scheduler.

    Raises OSError and ValueError if no scheduler answers.
    """
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    # distributed has no type annotations.
    client: Any = distributed.Client
    return client(address, timeout=_CONNECT_SECONDS, set_as_default=False)


class CampaignPlugin(WorkerPlugin):
    """Campaign on a worker; dask installs it on every worker, including late ones and replacements.

    name: name under which a worker registers the campaign.
    copy: the campaign, packed for its workers.
    """

    def __init__(self, name: str, copy: CampaignCopy) -> None:
        self.name, self.copy = name, copy


def fly_task(campaign: str, request: FlightRequest) -> FlightRow:
    """Fly the requested flight of a campaign on the dask worker that runs this task.

    campaign: name under which the campaign is registered on the worker.
    Raises WorkerError if the software of this worker differs, and TypeError for a name that is not a campaign's.
    """
    worker = get_worker()
    plugin = worker.plugins[campaign]
    if not isinstance(plugin, CampaignPlugin):
        raise TypeError(f"{campaign} is not a campaign of this worker")
    return plugin.copy.fly(request, worker.address)


class DaskPool:
    """Workers of a cluster that fly the flights of a campaign.

    client: a `distributed.Client`.
    base: inputs that all flights of the campaign share.
    fly: function that flies one flight of the campaign.
    """

    def __init__(self, client: Any, base: CampaignBase, fly: FlyOne = fly_one) -> None:
        self._client, self._base = client, base
        self._name = f"planfly-{uuid.uuid4().hex[:12]}"
        self._numbers = itertools.cycle(range(_TASK_NAME_COUNT))
        copy = CampaignCopy(base, fingerprint(base.scenario.flight.aircraft), fly)
        client.register_plugin(CampaignPlugin(self._name, copy))

    def close(self) -> None:
        """Remove the campaign from the workers; ignore errors of workers that die meanwhile."""
        with contextlib.suppress(OSError):
            self._client.unregister_worker_plugin(self._name)

    def fly(self, next_request: Callable[[], FlightRequest | None]) -> Iterator[FinishedFlight]:
        """Fly the requests that `next_request` returns, and yield each flight when it is done, in any order.

        A flight whose worker died `MAX_WORKER_DEATHS` times is yielded as lost.

        next_request: returns the next request, or None while no request is ready; called again after each flight.
        The iteration ends when no request is ready and no flight is in progress.

        Raises a `world.errors.PlanflyError` that a flight raised, RuntimeError for any other error of a flight, and
        OSError if the scheduler is lost.
        """
        flying: dict[tuple[str, int], FlightRequest] = {}
        abandoned_counts: Counter[FlightRequest] = Counter()
        finished: Any = cast("Any", distributed.as_completed)(loop=self._client.loop)

        def send(request: FlightRequest) -> None:
            """Submit a request to the cluster under a free task name."""
            # Dask takes the first word of a tuple as the kind of task, and keeps a permanent record of each kind.
            key = next(key for number in self._numbers if (key := (self._name, number)) not in flying)
            flying[key] = request
            finished.add(self._client.submit(fly_task, self._name, request, key=key, pure=False))

        def send_requests() -> None:
            """Submit requests until all workers are busy or there is no further request."""
            while len(flying) < min(_TASK_NAME_COUNT, max(1, sum(self._client.nthreads().values()))):
                if (request := next_request()) is None:
                    break
                send(request)

        try:
            send_requests()
            while flying:
                future = next(finished)
                request = flying.pop(future.key)
                row = self._result_row(future, request)
                if row is None:
                    abandoned_counts[request] += 1
                if row is None and abandoned_counts[request] < MAX_WORKER_DEATHS:
                    send(request)
                else:
                    yield FinishedFlight(request, row or make_lost_row(self._base, request.index, LOST_REASON))
                    send_requests()
                # Release it after the next task was sent, because dask makes a new record for a kind without tasks.
                future.release()
        except Interrupted:
            # Do not wait for these flights, which end with the client.
            flying.clear()
            raise
        finally:
            if flying:
                self._client.cancel(list(finished.futures), force=True)

    def _result_row(self, future: Any, request: FlightRequest) -> FlightRow | None:
        """Return the row of a flight, or None if dask abandoned the flight because its workers died.

        Raises as `fly`.
        """
        if future.status == "finished":
            # Until it is fetched, a result is lost if its worker dies.  Dask then flies again, and may give up, too.
            with contextlib.suppress(KilledWorker, CancelledError):
                return future.result()
        elif future.status == "error":
            error = future.exception()
            if isinstance(error, PlanflyError):
                raise error
            if not isinstance(error, KilledWorker):
                raise RuntimeError(f"flight {request.index}: {type(error).__name__}: {error}") from error
        # On a loaded machine, dask has cancelled a flight whose worker was killed.
        if self._client.status != "running":
            raise OSError(0, "the scheduler was lost; finished flights are kept: continue with --resume", "--scheduler")
        return None
