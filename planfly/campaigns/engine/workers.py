"""Workers: processes of this machine, or those of a running dask scheduler."""

import contextlib
import ipaddress
import logging
import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import urlsplit

from planfly.pipeline import Advance
from world.errors import PlanflyError
from world.files import temporary_folder
from world.interruption import Interrupted, children_ignore_sigint, end_children, end_with_parent

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
# `planfly.campaigns.engine.flight_loop` sends it again then, twice at most.
ALLOWED_FAILURES = 2
_CONNECT_SECONDS = 20


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

    Raises SchedulerError for an address that may not be used, and a scheduler that does not answer.
    """
    import dask
    import distributed

    # It states no types.
    cluster_types: Any = distributed

    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    settings: dict[str, Any] = {
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
                message = f"--scheduler {address}: no scheduler answers: {error}"
                raise SchedulerError(message, field="--scheduler", value=address) from error
            with client:
                yield client
            return
        with contextlib.ExitStack() as stack:
            # In a folder that goes with this process, however it ends.
            folder = stack.enter_context(temporary_folder("planfly-workers-"))
            stack.enter_context(dask.config.set({"temporary-directory": str(folder)}))
            number = workers.count or os.cpu_count() or 1
            start_tracker()
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


def _local_cluster(cluster_types: Any, number: int, folder: Path) -> Any:
    try:
        return cluster_types.LocalCluster(
            n_workers=number,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            scheduler_kwargs={"dashboard": False},
            worker_dashboard_address=None,
            memory_limit=0,
            silence_logs=logging.CRITICAL,
            local_directory=str(folder),
            # Imported before the scheduler knows the worker: a flight that waited for it would die with the worker.
            preload=["planfly.campaigns.engine.flight_loop", "scipy.stats"],
            # What a worker leaves that is killed goes with it, too.
            env={"TMPDIR": str(folder)},
        )
    except (RuntimeError, OSError) as error:
        message = f"--workers {number}: could not be started: {error}"
        raise SchedulerError(message, field="--workers", value=number) from error


def checked_address(address: str) -> str:
    """A scheduler's address, if flights may be sent there: TLS anywhere, plain TCP on loopback only.

    A scheduler's workers run whatever they are sent.  Raises SchedulerError.

    >>> checked_address("127.0.0.1:8786"), checked_address("tls://10.0.0.7:8786")
    ('tcp://127.0.0.1:8786', 'tls://10.0.0.7:8786')
    >>> checked_address("tcp://10.0.0.7:8786")
    Traceback (most recent call last):
    ...
    planfly.campaigns.engine.workers.SchedulerError: --scheduler tcp://10.0.0.7:8786: plain TCP beyond loopback; ...
    """
    whole = address if "://" in address else f"tcp://{address}"
    try:
        parts = urlsplit(whole)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not host or not port or parts.scheme not in ("tcp", "tls"):
        allowed = "tcp://HOST:PORT on this machine, or tls://HOST:PORT, is expected"
        raise SchedulerError.of_option("--scheduler", address, allowed)
    if parts.scheme == "tcp" and not _is_loopback(host):
        allowed = "plain TCP beyond loopback; use tls://, with certificates in dask's configuration"
        raise SchedulerError.of_option("--scheduler", address, allowed)
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

    advance: told as work tells it.
    Raises what work raised, and OSError where the process was lost.
    """
    # Before anything else does, so that it says nothing of what the workers leave later.
    start_tracker()
    here, there = multiprocessing.get_context("spawn").Pipe(duplex=False)
    child = multiprocessing.get_context("spawn").Process(target=_work, args=(there, work, args, options), daemon=True)
    with children_ignore_sigint():
        child.start()
    there.close()
    try:
        while True:
            kind, told = here.recv()
            if kind == "done":
                made: Made = told
                return made
            if kind == "failed":
                raise told
            if advance is not None:
                advance(*told)
    except EOFError:
        raise OSError(0, "a process of the campaign was lost: killed, or out of memory", work.__name__) from None
    finally:
        here.close()
        end_children([child])


def _work(tell: Connection, work: Callable[..., Any], args: tuple[Any, ...], options: dict[str, Any]) -> None:
    end_with_parent()
    try:
        tell.send(("done", work(*args, advance=lambda *told: tell.send(("told", told)), **options)))
    except Exception as error:
        tell.send(("failed", error))
