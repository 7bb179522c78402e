"""Plain processes on this machine that fly a campaign, one flight at a time each, without sockets."""

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
    LOST,
    MAX_FAILURES,
    CampaignCopy,
    FlightRequest,
    Flown,
    FlyOne,
    fingerprint,
)
from planfly.campaigns.flight_row import FlightRow, fly_one, lost_row
from world.errors import PlanflyError
from world.interruption import children_ignore_sigint, end_children, end_with_parent, uninterrupted

if TYPE_CHECKING:
    from multiprocessing.process import BaseProcess

# Number of processes in a row that may die while starting before the pool gives up.
MAX_FAILED_STARTS = 10

# Campaign of this worker process.
_copies: list[CampaignCopy] = []


def _begin(copy: CampaignCopy) -> None:
    """Load the campaign in a worker process."""
    _copies.append(copy)


def _fly(request: FlightRequest) -> FlightRow:
    """Fly a flight in a worker process."""
    return _copies[0].fly(request, f"process {os.getpid()}")


class _Worker:
    """Process that flies one flight at a time; a dead process is replaced when the next flight is sent."""

    def __init__(self, copy: CampaignCopy) -> None:
        self._copy = copy
        self._pool: ProcessPoolExecutor | None = None
        # The process of this worker, if it has one.
        self.processes: list[BaseProcess] = []
        self._started: Future[None] = Future()

    def send(self, request: FlightRequest) -> Future[FlightRow]:
        """Send a flight to the process."""
        # Ctrl-C reaches every process of a terminal: workers ignore it, and this process ends them.
        with children_ignore_sigint(), uninterrupted():
            try:
                return self._submit(request)
            except BrokenProcessPool:
                # The process has died since its last flight.
                _end([self])
                return self._submit(request)

    def _submit(self, request: FlightRequest) -> Future[FlightRow]:
        if self._pool is None:
            others = set(active_children())
            # A pool of one process: if it dies, its flight is known.
            self._pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=end_with_parent)
            # Not an argument of the process: the start would wait until the process has imported everything it needs.
            self._started = self._pool.submit(_begin, self._copy)
            self.processes = [child for child in active_children() if child not in others]
        return self._pool.submit(_fly, request)

    @property
    def has_started(self) -> bool:
        """True if the last process has started its first flight."""
        return self._started.done() and self._started.exception() is None

    def close(self) -> None:
        """Free the semaphores of a worker whose process has ended."""
        if self._pool is not None:
            # The thread that manages the pool holds its semaphores until it ends.
            self._pool.shutdown(cancel_futures=True)
            self._pool = None
        self.processes = []


def _end(workers: Iterable[_Worker]) -> None:
    """Kill the processes of workers."""
    ended = list(workers)
    end_children([process for worker in ended for process in worker.processes])
    for worker in ended:
        worker.close()


class LocalPool:
    """Processes on this machine that fly the flights of a campaign.  count: number of processes."""

    def __init__(self, count: int, base: CampaignBase, fly: FlyOne = fly_one) -> None:
        self._base = base
        copy = CampaignCopy(base, fingerprint(base.scenario.flight.aircraft), fly)
        self._workers = [_Worker(copy) for _ in range(count)]
        self._failed_starts = 0

    def close(self) -> None:
        """End all processes."""
        _end(self._workers)

    def fly(self, following: Callable[[], FlightRequest | None]) -> Iterator[Flown]:
        """Fly requests as `following` returns them, and yield each when it is done, in any order.

        following: returns the next request, or None for the time being; called again after each flight.
        Raises the `world.errors.PlanflyError` of a flight, and OSError if no process can be started.
        """
        idle = list(self._workers)
        flying: dict[Future[FlightRow], tuple[_Worker, FlightRequest]] = {}
        again: deque[FlightRequest] = deque()
        deaths: Counter[FlightRequest] = Counter()
        try:
            while True:
                while idle and (request := again.popleft() if again else following()) is not None:
                    worker = idle.pop()
                    flying[worker.send(request)] = worker, request
                if not flying:
                    return
                for future in wait(flying, return_when=FIRST_COMPLETED).done:
                    worker, request = flying.pop(future)
                    idle.append(worker)
                    row = self._row(future, worker, request)
                    if row is None:
                        deaths[request] += worker.has_started
                        _end([worker])
                        if deaths[request] < MAX_FAILURES:
                            again.append(request)
                            continue
                        row = lost_row(self._base, request.index, LOST)
                    yield Flown(request, row)
        finally:
            _end(worker for worker, _ in flying.values())

    def _row(self, future: Future[FlightRow], worker: _Worker, request: FlightRequest) -> FlightRow | None:
        """Return the row of a flight, or None if its process has died.  Raises the errors of `fly`."""
        try:
            row = future.result()
        except BrokenProcessPool:
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
