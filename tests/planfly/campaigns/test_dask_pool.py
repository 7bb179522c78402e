"""Workers of a dask cluster: each flight comes back once, by a worker that flies what the client would."""

from itertools import pairwise

import pytest

pytest.importorskip("distributed")

from distributed import CancelledError, KilledWorker

from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.dask_pool import CampaignPlugin, DaskPool, connect_client
from planfly.campaigns.flight_requests import LOST_REASON, FlightRequest, WorkerError
from planfly.campaigns.flight_row import FlightRow, make_lost_row
from planfly.campaigns.tables import is_same_flight
from planfly.campaigns.worker_pool import Workers, worker_pool
from tests.planfly.campaigns.made_campaigns import made_flight
from tests.soak import only_in_soak


@pytest.mark.filterwarnings("default")
def test_each_flight_comes_back_once_and_a_foreign_worker_is_refused(
    base: CampaignBase, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with connect_client(scheduler) as client:
        orders = iter(range(12))
        pool = DaskPool(client, base, made_flight)
        flown = list(pool.fly(lambda: next((FlightRequest(k) for k in orders), None)))
        pool.close()
        assert sorted(one.request.index for one in flown) == list(range(12))
        for request, row in flown:
            assert is_same_flight(row, made_flight(base, request.index))
            assert "://" in row.worker

        monkeypatch.setattr("planfly.campaigns.dask_pool.fingerprint", lambda name: {"planfly": "0.0.1"})
        other = DaskPool(client, base, made_flight)
        once = iter([FlightRequest(0)])
        with pytest.raises(WorkerError, match=r"worker .*://.*: planfly .* expected 0.0.1 as in this process"):
            list(other.fly(lambda: next(once, None)))
        other.close()


class GivenUp:
    """A flight at its end: as it was flown, or as dask gave it up, at once or when its result was to be fetched."""

    def __init__(self, key: object, row: FlightRow | None, status: str) -> None:
        self.key, self._row = key, row
        self.status = "finished" if row else status

    def result(self) -> FlightRow:
        if self._row is None:
            raise self.exception()
        return self._row

    def exception(self) -> Exception:
        return CancelledError("x") if self.status == "cancelled" else KilledWorker("x", None, 2)

    def release(self) -> None:
        pass


class OneWorker:
    """A client whose worker dies on flight 1 so many times."""

    loop, status = None, "running"

    def __init__(self, base: CampaignBase, times: int, status: str) -> None:
        self._base, self._left, self._status = base, times, status
        self.sent: list[int] = []

    def register_plugin(self, _plugin: CampaignPlugin) -> None:
        pass

    def nthreads(self) -> dict[str, int]:
        return {"a": 1}

    def submit(self, _task: object, _name: str, request: FlightRequest, *, key: object, pure: bool) -> GivenUp:
        self.sent.append(request.index)
        dies = request.index == 1 and self._left > 0
        self._left -= dies
        return GivenUp(key, None if dies else made_flight(self._base, request.index), self._status)


class InTurn(list[GivenUp]):
    """Futures are done in the order in which they are sent."""

    def add(self, future: GivenUp) -> None:
        self.append(future)

    def __next__(self) -> GivenUp:
        return self.pop(0)


class LastFirst(InTurn):
    """Of the futures that are there the last is done first: the first of all stays to the end."""

    def __next__(self) -> GivenUp:
        return self.pop()


class TwoWorkers(OneWorker):
    """A client of two that remembers the names of tasks."""

    def __init__(self, base: CampaignBase) -> None:
        super().__init__(base, 0, "finished")
        self.names: list[object] = []

    def nthreads(self) -> dict[str, int]:
        return {"a": 1, "b": 1}

    def submit(self, _task: object, _name: str, request: FlightRequest, *, key: object, pure: bool) -> GivenUp:
        self.names.append(key)
        return super().submit(_task, _name, request, key=key, pure=pure)


def test_names_come_again_but_for_one_that_is_flying(base: CampaignBase, monkeypatch: pytest.MonkeyPatch) -> None:
    """Dask keeps 100,000 names; and of two flights of one name it would fly one."""
    monkeypatch.setattr("distributed.as_completed", lambda loop: LastFirst())
    monkeypatch.setattr("planfly.campaigns.dask_pool._TASK_NAME_COUNT", 4)
    client, orders = TwoWorkers(base), iter(range(40))
    flown = list(DaskPool(client, base).fly(lambda: next((FlightRequest(k) for k in orders), None)))
    assert sorted(one.request.index for one in flown) == list(range(40))
    assert flown[-1].request.index == 0
    assert len(set(client.names)) == 4
    assert client.names[0] not in client.names[1:]
    assert all(one != other for one, other in pairwise(client.names))


@only_in_soak
@pytest.mark.filterwarnings("default")
def test_dask_flies_what_comes_under_a_name_that_was_flown(
    base: CampaignBase, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("planfly.campaigns.dask_pool._TASK_NAME_COUNT", 16)
    orders = iter(range(200))
    with worker_pool(Workers(None, scheduler), base, made_flight) as pool:
        flown = list(pool.fly(lambda: next((FlightRequest(k) for k in orders), None)))
    assert sorted(one.request.index for one in flown) == list(range(200))
    assert all(is_same_flight(row, made_flight(base, request.index)) for request, row in flown)


@pytest.mark.parametrize("status", ["error", "finished", "cancelled"])
@pytest.mark.parametrize("times", [0, 1, 2, 3])
def test_a_flight_is_lost_that_is_given_up_three_times(
    base: CampaignBase, monkeypatch: pytest.MonkeyPatch, times: int, status: str
) -> None:
    """Before that it may be another's doing, and also of one that was flown, but whose result died with its worker."""
    monkeypatch.setattr("distributed.as_completed", lambda loop: InTurn())
    client, orders = OneWorker(base, times, status), iter(range(3))
    flown = list(DaskPool(client, base).fly(lambda: next((FlightRequest(k) for k in orders), None)))
    assert client.sent == [0, *[1] * (1 + min(times, 2)), 2]
    assert [one.request.index for one in flown] == [0, 1, 2]
    assert flown[1].row == (made_flight(base, 1) if times < 3 else make_lost_row(base, 1, LOST_REASON))


def test_a_flight_that_is_cancelled_as_the_scheduler_went_ends_the_campaign(
    base: CampaignBase, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("distributed.as_completed", lambda loop: InTurn())
    client, orders, flown = OneWorker(base, 1, "cancelled"), iter(range(3)), list[int]()
    client.status = "connecting"
    monkeypatch.setattr(client, "cancel", lambda *_, **__: None, raising=False)
    with pytest.raises(OSError, match="the scheduler was lost"):
        flown.extend(
            one.request.index for one in DaskPool(client, base).fly(lambda: next(map(FlightRequest, orders), None))
        )
    assert flown == [0]
    assert client.sent == [0, 1]
