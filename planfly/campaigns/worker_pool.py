"""The worker pool of a campaign: processes of this machine or of a dask cluster, and the flights sent to them.

The pool stays as large as was asked for, whichever workers die.  Each worker proves by its fingerprint that it flies
what this process would, takes the campaign once, and is sent as many flights at a time as the pool has threads.
"""

import contextlib
import errno
import hashlib
import ipaddress
import itertools
import logging
import multiprocessing
import os
import platform
import sys
import tempfile
import threading
import time
import uuid
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib import metadata, resources
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeVar, cast
from urllib.parse import urlsplit

from aircraft.catalog import find_aircraft, model_hash
from planfly._version import __version__
from planfly.campaigns.campaign_base import CampaignBase, GivenWind
from planfly.campaigns.flight_row import FlightRow, fly_one, lost_row
from planfly.campaigns.private_cluster import keep_steady_time, private_security
from planfly.make_plan import Advance
from planfly.process_setup import PARENT
from world.errors import PlanflyError
from world.files import temporary_folder
from world.interruption import Interrupted, children_ignore_sigint, end_children, end_with_parent, uninterrupted

if TYPE_CHECKING:
    from multiprocessing.context import ForkServerContext, SpawnContext

# ----------------------------------------------------------------------
# How the processes of a campaign are started.

# Bytes of the path of the folder for temporary files, below which are 32 more to the socket.
_LONGEST_FOLDER = 75
# Imported once for all of them, by the process that they are forked from.
_PRELOADED = ("planfly.campaigns.fork_server",)


def child_start_method() -> Literal["forkserver", "spawn"]:
    """How `multiprocessing` starts the processes of a campaign: ``forkserver`` on Linux, ``spawn`` elsewhere.

    Before Python 3.11.1 every user of the machine could speak to a fork server (CVE-2022-42919); and the path of its
    socket, in a folder among temporary files, has at most 107 bytes.
    """
    safe = sys.platform == "linux" and sys.version_info >= (3, 11, 1)
    return "forkserver" if safe and len(os.fsencode(tempfile.gettempdir())) <= _LONGEST_FOLDER else "spawn"


def child_processes() -> "ForkServerContext | SpawnContext":
    """The `multiprocessing` context of a campaign's processes, which never hear Ctrl-C.

    On Linux they are forked from one process that has imported what all of them need, which takes seconds.
    """
    if child_start_method() == "spawn":
        return multiprocessing.get_context("spawn")
    from multiprocessing import forkserver

    context = multiprocessing.get_context("forkserver")
    # What it preloads is settled when it starts; dask would name modules of its own.
    context.set_forkserver_preload(list(_PRELOADED))
    os.environ[PARENT] = str(os.getpid())
    with children_ignore_sigint():
        forkserver.ensure_running()
    return context


# ----------------------------------------------------------------------
# Workers of this machine stay as many as were asked for, no fewer and no more, whichever of them die.
#
# dask starts a worker anew that dies at work, but gives up one that dies while it starts.

# s between two looks, and for which a worker may be away: it is back in some seconds, and dask strikes it off its list
# after 15 (`distributed.deploy.lost-worker-timeout`).
_LOOK, _PATIENCE = 1.0, 20.0


@contextlib.contextmanager
def kept_workers(cluster: Any, count: int, patience: float = _PATIENCE) -> Iterator[None]:
    """Start others where workers of a cluster stay away, and end those that are too many.

    cluster: a `distributed.LocalCluster`.
    patience: s.
    """
    over = threading.Event()

    def watch() -> None:
        whole_at, asked = time.monotonic(), False
        while not over.wait(_LOOK):
            missing = count - len(cluster.scheduler_info["workers"])
            if missing <= 0:
                whole_at, asked = time.monotonic(), False
                if len(cluster.worker_spec) > count:
                    # Those that others were started for came back after all.
                    cluster.scale(count)
            elif time.monotonic() - whole_at > patience:
                # What was struck off is started under its old name; what still does not come back, under a new one.
                cluster.scale(len(cluster.worker_spec) + (missing if asked else 0))
                whole_at, asked = time.monotonic(), True

    watcher = threading.Thread(target=watch, name="kept workers", daemon=True)
    watcher.start()
    try:
        yield
    finally:
        over.set()
        watcher.join()


# dask gives a flight up when a third worker dies on it: one that only waited for its worker has died with it, too.
# `WorkerPool.fly` sends it again then, twice at most.
ALLOWED_FAILURES = 2
_CONNECT_SECONDS = 20
# The module that scheduler and workers of our own are shut by.
_PRIVATE = private_security.__module__


class SchedulerError(PlanflyError):
    """A scheduler cannot be used as it stands."""


@dataclass(frozen=True)
class Workers:
    """Where a campaign is flown.

    count: processes on this machine; None for as many as it has cores.
    scheduler: address of a running one; None for workers of our own.
    """

    count: int | None = None
    scheduler: str | None = None


@contextlib.contextmanager
def connected(workers: Workers) -> Iterator[Any]:
    """A `distributed.Client` of these workers; workers of our own end with it.

    Raises SchedulerError for an address that may not be used, and a scheduler that does not answer; OSError where
    workers of our own cannot be started.
    """
    import dask
    import distributed

    # It states no types.
    cluster_types: Any = distributed

    keep_steady_time()
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    settings: dict[str, Any] = {
        "distributed.worker.multiprocessing-method": child_start_method(),
        "distributed.scheduler.allowed-failures": ALLOWED_FAILURES,
        "distributed.worker.memory.terminate": False,
        "distributed.worker.memory.pause": False,
        "distributed.worker.memory.spill": False,
        "distributed.worker.memory.target": False,
        "logging": {"distributed": "critical", "tornado": "critical", "asyncio": "critical"},
    }
    if workers.scheduler is None:
        # A worker of this machine is watched by its own parent, and a laptop's sleep is no death.
        settings["distributed.scheduler.worker-ttl"] = None
    with dask.config.set(settings):
        if workers.scheduler is not None:
            address = checked_address(workers.scheduler)
            try:
                client = cluster_types.Client(address, timeout=_CONNECT_SECONDS, set_as_default=False)
            except (OSError, TimeoutError, ValueError) as error:
                raise SchedulerError.of_argument("scheduler", address, f"no scheduler answers: {error}") from error
            with client:
                yield client
            return
        with contextlib.ExitStack() as stack:
            # In a folder that goes with this process, however it ends.
            folder = stack.enter_context(temporary_folder("planfly-workers-"))
            stack.enter_context(dask.config.set({"temporary-directory": str(folder)}))
            number = workers.count or os.cpu_count() or 1
            start_tracker()
            child_processes()
            # Ctrl-C in the middle of a worker's imports would have it say so.
            with children_ignore_sigint():
                cluster = stack.enter_context(_local_cluster(cluster_types, number, folder))
            stack.enter_context(kept_workers(cluster, number))
            client = stack.enter_context(cluster_types.Client(cluster, set_as_default=False))
            try:
                yield client
            except Interrupted:
                # This process ends, and its children with it, sooner than workers can be asked to: their folder goes
                # after them.
                stack.pop_all()
                raise


def start_tracker() -> None:
    """Start multiprocessing's tracker of semaphores, so that it removes what a killed worker leaves without a word."""
    if os.name != "posix":
        return
    from multiprocessing import resource_tracker

    name, words = "PYTHONWARNINGS", "ignore:resource_tracker:UserWarning"
    before = os.environ.get(name)
    os.environ[name] = words if before is None else f"{before},{words}"
    try:
        resource_tracker.ensure_running()
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before


def descriptors_of(number: int) -> int:
    """File descriptors that a process takes that leads so many workers of its own, with some to spare.

    It was seen to hold 31 with one worker, 44 with two and 75 with five.

    >>> descriptors_of(2)
    64
    """
    return 32 + 16 * number


def allow_descriptors(number: int) -> None:
    """Allow this process the file descriptors of so many workers, as far as it may allow itself more.

    Raises OSError where that is not enough: dask tries without end to accept what it has no descriptor for.
    """
    try:
        import resource
    except ImportError:
        # Windows has no such limit.
        return
    needed = descriptors_of(number)
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY or soft >= needed:
        return
    if hard != resource.RLIM_INFINITY and hard < needed:
        words = f"take {needed} file descriptors, and the limit is {hard} (ulimit -n); fewer --workers take fewer"
        raise OSError(errno.EMFILE, words, f"{number} worker{'s' if number > 1 else ''}")
    resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))


def _local_cluster(cluster_types: Any, number: int, folder: Path) -> Any:
    allow_descriptors(number)
    try:
        return cluster_types.LocalCluster(
            n_workers=number,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            security=private_security(),
            scheduler_kwargs={"dashboard": False, "preload": [_PRIVATE]},
            worker_dashboard_address=None,
            memory_limit=0,
            silence_logs=logging.CRITICAL,
            local_directory=str(folder),
            # Imported before the scheduler knows the worker: a flight that waited for it would die with the worker.
            preload=["planfly.campaigns.campaign_worker", "scipy.stats", _PRIVATE],
            # What a worker leaves that is killed goes with it, too.
            env={"TMPDIR": str(folder)},
        )
    except (RuntimeError, OSError) as error:
        # The machine's fault, and nobody's input.
        words = " ".join(str(error).split())
        raise OSError(errno.EIO, f"could not be started: {words}", f"{number} workers") from error


def checked_address(address: str) -> str:
    """A scheduler's address, if flights may be sent there: TLS anywhere, plain TCP on loopback only.

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


# ----------------------------------------------------------------------
# A part of a campaign in a process of its own: the one that leads it stays small, whatever plans and pictures take.

Made = TypeVar("Made")


def in_own_process(work: Callable[..., Made], *args: Any, advance: Advance | None = None, **options: Any) -> Made:
    """What work(*args, advance=..., **options) returns there; all of it goes between processes by pickle.

    advance: called as work calls its own.
    Raises what work raised, and OSError where the process was lost.
    """
    # Before anything else does, so that it says nothing of what the workers leave later.
    start_tracker()
    context = child_processes()
    here, there = context.Pipe(duplex=False)
    child = context.Process(target=_work, args=(there, work, args, options), daemon=True)
    with children_ignore_sigint(), uninterrupted():
        child.start()
    there.close()
    try:
        while True:
            kind, sent = here.recv()
            if kind == "done":
                made: Made = sent
                return made
            if kind == "failed":
                raise sent
            if advance is not None:
                advance(*sent)
    except EOFError:
        raise OSError(0, "a process of the campaign was lost: killed, or out of memory", work.__name__) from None
    finally:
        here.close()
        end_children([child])


def _work(tell: Connection, work: Callable[..., Any], args: tuple[Any, ...], options: dict[str, Any]) -> None:
    end_with_parent()
    try:
        tell.send(("done", work(*args, advance=lambda *done: tell.send(("advance", done)), **options)))
    except Exception as error:
        tell.send(("failed", error))


# ----------------------------------------------------------------------
# What a worker flies with: two that differ in it may not fly flights of one campaign.

# Packages whose version may move a bit of a flight.
_PACKAGES = ("jsbsim", "numba", "numpy", "scipy")
_OURS = ("aircraft", "flight", "logs", "planfly", "planner", "world")


class WorkerError(PlanflyError):
    """A worker does not fly what the campaign flies."""


@cache
def code_hash() -> str:
    """Hash of planfly's own sources, as installed here."""
    digest = hashlib.sha256()
    for package in _OURS:
        root = Path(str(resources.files(package)))
        for file in sorted(root.rglob("*.py")):
            digest.update(str(file.relative_to(root)).encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def fingerprint(aircraft: str) -> dict[str, str]:
    """What decides a flight of this aircraft on this machine, by name.

    >>> sorted(fingerprint("aerosonde"))
    ['jsbsim', 'model', 'numba', 'numpy', 'planfly', 'python', 'scipy', 'sources']
    """
    try:
        model = model_hash(find_aircraft(aircraft))
    except PlanflyError as error:
        model = f"none: {error}"
    return {
        "planfly": __version__,
        "sources": code_hash(),
        "model": model,
        "python": ".".join(platform.python_version_tuple()[:2]),
        **{name: metadata.version(name) for name in _PACKAGES},
    }


def refuse_different(mine: dict[str, str], theirs: dict[str, str], worker: str) -> None:
    """Raise WorkerError, naming the worker and what differs first, unless it flies what this process would.

    >>> refuse_different({"planfly": "0.1.0"}, {"planfly": "0.0.9"}, "tls://10.0.0.7:4000")
    Traceback (most recent call last):
    ...
    planfly.campaigns.worker_pool.WorkerError: worker tls://10.0.0.7:4000: planfly 0.0.9, not 0.1.0 as here
    """
    for name, value in mine.items():
        if theirs.get(name) != value:
            found, allowed = theirs.get(name), f"not {value} as here"
            message = f"worker {worker}: {name} {found or 'missing'}, {allowed}"
            raise WorkerError(message, file=f"worker {worker}", field=name, value=found, allowed=allowed)


# ----------------------------------------------------------------------
# How fast flights come in, and when to tell of it again.

# Seconds between two lines of progress.
REPORTED_EVERY = 0.5


class FlightRate:
    """Flights a second since it was made; known: flights that were there before."""

    def __init__(self, known: int) -> None:
        self._known = known
        self._started = self._reported = time.monotonic()

    def due(self) -> bool:
        """Whether it is time to report again; asked by what then reports."""
        now = time.monotonic()
        if now - self._reported < REPORTED_EVERY:
            return False
        self._reported = now
        return True

    def a_second(self, flights: int) -> float:
        """Flights a second, with so many flights there by now; 0 before the first."""
        return (flights - self._known) / max(time.monotonic() - self._started, 1e-3)


# ----------------------------------------------------------------------
# Flights sent to the workers, and what comes of them.

# Flies flight k of a base, in this wind; `fly_one` in all campaigns.
FlyOne = Callable[[CampaignBase, int, GivenWind | None], FlightRow]

# How a flight ended that could not be flown.
LOST = "lost: its workers died"
# How often dask gives a flight up before it is lost: its workers may have died of something else.
_MAX_FAILURES = 3
# Names of tasks, which dask keeps the last 100,000 of: enough of them that one is long forgotten when it comes again.
_NAMES = 4096


@dataclass(frozen=True, slots=True)
class FlightRequest:
    """A flight to fly: its index, and the mean wind that takes the scenario's place, None for none."""

    index: int
    wind: GivenWind | None = None


class Flown(NamedTuple):
    """A request, and what came of it."""

    request: FlightRequest
    row: FlightRow


class WorkerPool:
    """Workers that fly the flights of a campaign.  client: a `distributed.Client`."""

    def __init__(self, client: Any, base: CampaignBase, fly: FlyOne = fly_one) -> None:
        self._client, self._base = client, base
        self._name = f"planfly-{uuid.uuid4().hex[:12]}"
        self._numbers = itertools.cycle(range(_NAMES))
        mine = fingerprint(base.scenario.flight.aircraft)
        # Imported here and below: without the extra there is no dask.
        from planfly.campaigns.campaign_worker import CampaignPlugin

        client.register_plugin(CampaignPlugin(self._name, base, mine, fly))

    def close(self) -> None:
        """Let workers that live on forget the campaign; one that dies meanwhile has nothing to forget."""
        with contextlib.suppress(OSError):
            self._client.unregister_worker_plugin(self._name)

    def threads(self) -> int:
        """Flights that the workers can fly at a time, at least 1."""
        threads: dict[str, int] = self._client.nthreads()
        return max(1, sum(threads.values()))

    def fly(self, following: Callable[[], FlightRequest | None]) -> Iterator[Flown]:
        """Fly requests as they are asked for, and hand each back as it is done, in whatever order that is.

        following: gives the next request, None for none at present; asked again after each flight.
        Raises what a flight raised of `world.errors.PlanflyError`, and OSError where the scheduler is lost.
        """
        from distributed import as_completed

        from planfly.campaigns.campaign_worker import fly_task

        flying: dict[tuple[str, int], FlightRequest] = {}
        given_up: Counter[FlightRequest] = Counter()
        done: Any = cast("Any", as_completed)(loop=self._client.loop)

        def send(request: FlightRequest) -> None:
            # A tuple: dask takes its first word for the kind of task, and keeps something of each kind for good.
            key = next(key for number in self._numbers if (key := (self._name, number)) not in flying)
            flying[key] = request
            done.add(self._client.submit(fly_task, self._name, request.index, request.wind, key=key, pure=False))

        def send_following() -> None:
            while len(flying) < min(_NAMES, self.threads()) and (request := following()) is not None:
                send(request)

        try:
            send_following()
            while flying:
                future = next(done)
                request = flying.pop(future.key)
                row = self._result(future, request)
                if row is None:
                    given_up[request] += 1
                if row is None and given_up[request] < _MAX_FAILURES:
                    send(request)
                else:
                    yield Flown(request, row or lost_row(self._base, request.index, LOST))
                    send_following()
                # After the next was sent: of a kind without any task dask makes a new record with the next one.
                future.release()
        except Interrupted:
            # No time to wait for an answer: these flights end with the client.
            flying.clear()
            raise
        finally:
            if flying:
                self._client.cancel(list(done.futures), force=True)

    def _result(self, future: Any, request: FlightRequest) -> FlightRow | None:
        """What came of a flight; None where dask gave it up, as workers died on it.

        Raises OSError where the scheduler is lost.
        """
        from distributed import CancelledError, KilledWorker

        if future.status == "finished":
            # A result goes with its worker until it is fetched, and is made anew: that may be given up, too.
            with contextlib.suppress(KilledWorker, CancelledError):
                row: FlightRow = future.result()
                return row
        elif future.status == "error":
            error = future.exception()
            if isinstance(error, PlanflyError):
                raise error
            if not isinstance(error, KilledWorker):
                raise RuntimeError(f"flight {request.index}: {type(error).__name__}: {error}") from error
        # On a loaded machine dask was seen to cancel a flight whose worker was killed.
        if self._client.status != "running":
            raise OSError(0, "the scheduler was lost; the flights before are kept, --resume goes on", "--scheduler")
        return None


@contextlib.contextmanager
def worker_pool(workers: Workers, base: CampaignBase, fly: FlyOne = fly_one) -> Iterator[WorkerPool]:
    """WorkerPool of a campaign on these workers; workers of our own end with it, others forget it.

    Raises SchedulerError as `connected`.
    """
    with connected(workers) as client:
        pool = WorkerPool(client, base, fly)
        try:
            yield pool
        finally:
            if workers.scheduler is not None:
                pool.close()
