"""Flights sent to workers and taken back, as many at a time as there are workers."""

import contextlib
import itertools
import uuid
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

from planfly.campaigns.engine.cluster import Workers, connected
from planfly.campaigns.engine.fingerprint import fingerprint
from planfly.campaigns.engine.flight_tasks import CampaignPlugin, FlyOne, fly_task
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.flight_row import FlightRow, fly_one, lost_row
from planfly.campaigns.flights.varied_flight import GivenWind
from world.errors import PlanflyError
from world.interruption import Interrupted

# How a flight ended that could not be flown.
LOST = "lost: its workers died"
# How often dask gives a flight up before it is lost: its workers may have died of something else.
_MOST_GIVEN_UP = 3
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
                if row is None and given_up[order] < _MOST_GIVEN_UP:
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
    Raises SchedulerError as `planfly.campaigns.engine.cluster.connected`.
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
