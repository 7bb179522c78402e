"""Flights sent to workers and taken back, as many at a time as there are workers."""

import contextlib
import hashlib
import itertools
import pickle
import platform
import signal
import threading
import time
import uuid
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from importlib import metadata, resources
from pathlib import Path
from typing import Any, NamedTuple, cast

from distributed import WorkerPlugin, get_worker

from aircraft.catalog import find_aircraft, model_hash
from planfly import __version__
from planfly.campaigns.engine.workers import Workers, connected
from planfly.campaigns.flights.campaign_base import CampaignBase, GivenWind
from planfly.campaigns.flights.flight_row import FlightRow, fly_one, lost_row
from world.errors import PlanflyError
from world.interruption import Interrupted

# ----------------------------------------------------------------------
# What a worker flies with: two that differ in it may not fly flights of one campaign.

# Packages whose version may move a bit of a flight.
_PACKAGES = ("jsbsim", "numba", "numpy", "scipy")
_ROOMS = ("aircraft", "flight", "logs", "planfly", "planner", "world")


class WorkerError(PlanflyError):
    """A worker does not fly what the campaign flies."""


@cache
def code_hash() -> str:
    """Hash of planfly's own sources, as installed here."""
    digest = hashlib.sha256()
    for room in _ROOMS:
        root = Path(str(resources.files(room)))
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
    planfly.campaigns.engine.flight_loop.WorkerError: worker tls://10.0.0.7:4000: planfly 0.0.9, not 0.1.0 as here
    """
    for name, value in mine.items():
        if theirs.get(name) != value:
            found, allowed = theirs.get(name), f"not {value} as here"
            message = f"worker {worker}: {name} {found or 'missing'}, {allowed}"
            raise WorkerError(message, file=f"worker {worker}", field=name, value=found, allowed=allowed)


# ----------------------------------------------------------------------
# How fast flights come in, and when to tell of it again.

# Seconds between two lines of progress.
TOLD_EVERY = 0.5


class FlightRate:
    """Flights a second since it was made; known: flights that were there before."""

    def __init__(self, known: int) -> None:
        self._known = known
        self._started = self._told = time.monotonic()

    def due(self) -> bool:
        """Whether it is time to tell again; asked for by what then tells."""
        now = time.monotonic()
        if now - self._told < TOLD_EVERY:
            return False
        self._told = now
        return True

    def a_second(self, flights: int) -> float:
        """Flights a second, with so many flights there by now; 0 before the first."""
        return (flights - self._known) / max(time.monotonic() - self._started, 1e-3)


# ----------------------------------------------------------------------
# What a worker holds of a campaign, and how it flies one of its flights.

# Flies flight k of a base, in this wind; `planfly.campaigns.flights.flight_row.fly_one` in all campaigns.
FlyOne = Callable[[CampaignBase, int, GivenWind | None], FlightRow]


class CampaignPlugin(WorkerPlugin):
    """A campaign on a worker: on each, also on one that comes late or takes a dead one's place.

    name: of the campaign on its scheduler.
    """

    def __init__(self, name: str, base: CampaignBase, mine: dict[str, str], fly: FlyOne = fly_one) -> None:
        self.name = name
        self._packed = pickle.dumps((base, fly))
        self._aircraft = base.scenario.flight.aircraft
        self._mine = mine
        self._ready: tuple[CampaignBase, FlyOne] | None = None

    def setup(self, worker: Any) -> None:
        """Leave Ctrl-C on a terminal to the client, which ends its workers."""
        if threading.current_thread() is threading.main_thread():
            with contextlib.suppress(ValueError):
                signal.signal(signal.SIGINT, signal.SIG_IGN)

    def ready(self, worker: str) -> tuple[CampaignBase, FlyOne]:
        """The campaign, unpacked once.  Raises WorkerError for a worker that flies otherwise than the client would."""
        if self._ready is None:
            refuse_different(self._mine, fingerprint(self._aircraft), worker)
            base, fly = pickle.loads(self._packed)
            # The same model, wherever this machine has it.
            airframe = replace(base.airframe, aircraft=find_aircraft(self._aircraft))
            self._ready = replace(base, airframe=airframe), fly
        return self._ready


def fly_task(campaign: str, index: int, wind: GivenWind | None) -> FlightRow:
    """Fly a flight on the worker that this runs on."""
    worker = get_worker()
    plugin = worker.plugins[campaign]
    if not isinstance(plugin, CampaignPlugin):
        raise TypeError(f"{campaign} is no campaign of this worker")
    base, fly = plugin.ready(worker.address)
    return replace(fly(base, index, wind), worker=worker.address)


# How a flight ended that could not be flown.
LOST = "lost: its workers died"
# How often dask gives a flight up before it is lost: its workers may have died of something else.
_MAX_FAILURES = 3
# Names of tasks, which dask keeps the last 100,000 of: enough of them that one is long forgotten when it comes again.
_NAMES = 4096


@dataclass(frozen=True, slots=True)
class Order:
    """A flight to fly: its index, and the mean wind that takes the scenario's place, None for none."""

    index: int
    wind: GivenWind | None = None


class Flown(NamedTuple):
    """An order, and what came of it."""

    order: Order
    row: FlightRow


class Pilots:
    """Workers that fly the flights of a campaign; client: a `distributed.Client`."""

    def __init__(self, client: Any, base: CampaignBase, fly: FlyOne = fly_one) -> None:
        self._client, self._base = client, base
        self._name = f"planfly-{uuid.uuid4().hex[:12]}"
        self._numbers = itertools.cycle(range(_NAMES))
        mine = fingerprint(base.scenario.flight.aircraft)
        client.register_plugin(CampaignPlugin(self._name, base, mine, fly))

    def close(self) -> None:
        """Let workers that live on forget the campaign."""
        self._client.unregister_worker_plugin(self._name)

    def threads(self) -> int:
        """Flights that the workers can fly at a time, at least 1."""
        threads: dict[str, int] = self._client.nthreads()
        return max(1, sum(threads.values()))

    def fly(self, following: Callable[[], Order | None]) -> Iterator[Flown]:
        """Fly orders as they are asked for, and hand each back as it is done, in whatever order that is.

        following: gives the next order, None for none at present; asked again after each flight.
        Raises what a flight raised of `world.errors.PlanflyError`, and OSError where the scheduler is lost.
        """
        from distributed import as_completed

        flying: dict[tuple[str, int], Order] = {}
        given_up: Counter[Order] = Counter()
        done: Any = cast("Any", as_completed)(loop=self._client.loop)

        def send(order: Order) -> None:
            # A tuple: dask takes its first word for the kind of task, and keeps something of each kind for good.
            key = next(key for number in self._numbers if (key := (self._name, number)) not in flying)
            flying[key] = order
            done.add(self._client.submit(fly_task, self._name, order.index, order.wind, key=key, pure=False))

        def send_following() -> None:
            while len(flying) < min(_NAMES, self.threads()) and (order := following()) is not None:
                send(order)

        try:
            send_following()
            while flying:
                future = next(done)
                order = flying.pop(future.key)
                row = self._result(future, order)
                if row is None:
                    given_up[order] += 1
                if row is None and given_up[order] < _MAX_FAILURES:
                    send(order)
                else:
                    yield Flown(order, row or lost_row(self._base, order.index, LOST))
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

    def _result(self, future: Any, order: Order) -> FlightRow | None:
        """What came of a flight; None where dask gave it up, as workers died on it."""
        from distributed import KilledWorker

        if future.status == "finished":
            # A result goes with its worker until it is fetched, and is made anew: that may be given up, too.
            with contextlib.suppress(KilledWorker):
                row: FlightRow = future.result()
                return row
            return None
        if future.status == "error":
            error = future.exception()
            if isinstance(error, KilledWorker):
                return None
            if isinstance(error, PlanflyError):
                raise error
            raise RuntimeError(f"flight {order.index}: {type(error).__name__}: {error}") from error
        raise OSError(0, "the scheduler was lost; the flights before are kept, --resume goes on", "--scheduler")


@contextlib.contextmanager
def hired_pilots(workers: Workers, base: CampaignBase, fly: FlyOne = fly_one) -> Iterator[Pilots]:
    """Pilots of a campaign on these workers; workers of our own end with it, others forget it.

    An interruption waits for no answer of workers of our own: they end with this process.
    Raises SchedulerError as `planfly.campaigns.engine.workers.connected`.
    """
    with connected(workers) as client:
        pilots, live_on = Pilots(client, base, fly), True
        try:
            yield pilots
        except Interrupted:
            live_on = workers.scheduler is not None
            raise
        finally:
            if live_on:
                pilots.close()
