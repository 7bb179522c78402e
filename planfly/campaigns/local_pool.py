"""Fly a campaign in plain processes on this machine, without sockets.

Each process flies one flight at a time.
"""

import errno
import os
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children, get_context
from typing import TYPE_CHECKING

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
from planfly.runtime.process_setup import check_script_guard
from world.errors import PlanflyError
from world.interruption import children_ignore_sigint, delay_signals, end_children, end_with_parent

if TYPE_CHECKING:
    from multiprocessing.process import BaseProcess

# Number of successive processes that may die during their start before the pool fails.
MAX_FAILED_STARTS = 10

# Campaign of this worker process.
_worker_campaign: list[CampaignCopy] = []


def _initialise_worker(campaign: CampaignCopy) -> None:
    """Store the campaign in this worker process, for `_fly_request`."""
    _worker_campaign.append(campaign)


def _fly_request(request: FlightRequest) -> FlightRow:
    """Fly the requested flight in a worker process."""
    return _worker_campaign[0].fly(request, f"process {os.getpid()}")


class _Worker:
    """Process that flies one flight at a time; a dead process is replaced when the next flight is sent."""

    def __init__(self, copy: CampaignCopy) -> None:
        self._copy = copy
        self._pool: ProcessPoolExecutor | None = None
        # Process of this worker in a list, empty without a process.
        self.processes: list[BaseProcess] = []
        self._start_future: Future[None] = Future()

    def send(self, request: FlightRequest) -> Future[FlightRow]:
        """Send a request to the worker's process; start the process if there is none or it has died."""
        # Ctrl-C reaches every process of a terminal, so workers ignore it, and this process ends them.
        with children_ignore_sigint(), delay_signals():
            try:
                return self._submit(request)
            except BrokenProcessPool:
                # The process has died since its last flight.
                _end_workers([self])
                return self._submit(request)

    def _submit(self, request: FlightRequest) -> Future[FlightRow]:
        """Submit a request to the worker's process; start the process if there is none."""
        if self._pool is None:
            other_children = set(active_children())
            # The pool has one process, so that its flight is known if the process dies.
            self._pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=end_with_parent)
            # The campaign is not an argument of the process, because the start would wait for the imports it needs.
            self._start_future = self._pool.submit(_initialise_worker, self._copy)
            self.processes = [child for child in active_children() if child not in other_children]
        return self._pool.submit(_fly_request, request)

    @property
    def has_started(self) -> bool:
        """True if the latest process has started and received the campaign."""
        return self._start_future.done() and self._start_future.exception() is None

    def close(self) -> None:
        """Shut down the executor of a process that has ended, which frees its semaphores."""
        if self._pool is not None:
            # The thread that manages the pool keeps its semaphores until the thread ends.
            self._pool.shutdown(cancel_futures=True)
            self._pool = None
        self.processes = []


def _end_workers(workers: Iterable[_Worker]) -> None:
    """Kill the processes of workers."""
    worker_list = list(workers)
    end_children([process for worker in worker_list for process in worker.processes])
    for worker in worker_list:
        worker.close()


class LocalPool:
    """Processes on this machine that fly the flights of a campaign.

    count: number of processes.
    base: inputs that all flights of the campaign share.
    fly: function that flies one flight of the campaign.
    """

    def __init__(self, count: int, base: CampaignBase, fly: FlyOne = fly_one) -> None:
        self._base = base
        campaign = CampaignCopy(base, fingerprint(base.scenario.flight.aircraft), fly)
        self._workers = [_Worker(campaign) for _ in range(count)]
        self._failed_starts = 0

    def close(self) -> None:
        """End all processes."""
        _end_workers(self._workers)

    def fly(self, next_request: Callable[[], FlightRequest | None]) -> Iterator[FinishedFlight]:
        """Fly the requests that `next_request` returns, and yield each flight when it is done, in any order.

        next_request: returns the next request, or None while no request is ready; called again after each flight.
        The iteration ends when no request is ready and no flight is in progress.  A flight that ended the processes of
        `MAX_WORKER_DEATHS` workers is yielded as lost.

        Raises a `world.errors.PlanflyError` that a flight raised, RuntimeError for any other error of a flight, and
        OSError if no process can be started.
        """
        idle_workers = list(self._workers)
        flying: dict[Future[FlightRow], tuple[_Worker, FlightRequest]] = {}
        requests_to_retry: deque[FlightRequest] = deque()
        death_counts: Counter[FlightRequest] = Counter()
        try:
            while True:
                while (
                    idle_workers
                    and (request := requests_to_retry.popleft() if requests_to_retry else next_request()) is not None
                ):
                    worker = idle_workers.pop()
                    flying[worker.send(request)] = worker, request
                if not flying:
                    return
                for future in wait(flying, return_when=FIRST_COMPLETED).done:
                    worker, request = flying.pop(future)
                    idle_workers.append(worker)
                    row = self._result_row(future, worker, request)
                    if row is None:
                        death_counts[request] += worker.has_started
                        _end_workers([worker])
                        if death_counts[request] < MAX_WORKER_DEATHS:
                            requests_to_retry.append(request)
                            continue
                        row = make_lost_row(self._base, request.index, LOST_REASON)
                    yield FinishedFlight(request, row)
        finally:
            _end_workers(worker for worker, _ in flying.values())

    def _result_row(self, future: Future[FlightRow], worker: _Worker, request: FlightRequest) -> FlightRow | None:
        """Return the row of a flight, or None if its process has died.

        Raises as `fly`, and the PlanflyError of `check_script_guard`.
        """
        try:
            row = future.result()
        except BrokenProcessPool:
            check_script_guard(worker.processes)
            self._failed_starts = 0 if worker.has_started else self._failed_starts + 1
            if self._failed_starts == MAX_FAILED_STARTS:
                workers = f"{len(self._workers)} workers"
                raise OSError(errno.EIO, "could not be started: their processes end at once", workers) from None
            return None
        except PlanflyError:
            raise
        except Exception as error:
            raise RuntimeError(f"flight {request.index}: {type(error).__name__}: {error}") from error
        self._failed_starts = 0
        return row
