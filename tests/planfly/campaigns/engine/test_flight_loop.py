"""Each flight comes back once, by a worker that flies what the client would."""

from contextlib import nullcontext

import pytest

from planfly.campaigns.engine.cluster import Workers, connected
from planfly.campaigns.engine.fingerprint import WorkerError
from planfly.campaigns.engine.flight_loop import Order, Pilots, hired_pilots
from planfly.campaigns.engine.flight_tasks import CampaignPlugin
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.storage.row_values import same_flight
from tests.planfly.campaigns.made_campaigns import made_flight
from world.interruption import Interrupted


@pytest.mark.filterwarnings("default")
def test_each_flight_comes_back_once_and_a_foreign_worker_is_refused(
    base: CampaignBase, monkeypatch: pytest.MonkeyPatch
) -> None:
    with connected(Workers(2)) as client:
        orders = iter(range(12))
        pilots = Pilots(client, base, made_flight)
        flown = list(pilots.fly(lambda: next((Order(k) for k in orders), None)))
        pilots.close()
        assert sorted(one.order.index for one in flown) == list(range(12))
        for order, row in flown:
            assert same_flight(row, made_flight(base, order.index))
            assert row.worker.startswith("tcp://127.0.0.1")

        monkeypatch.setattr("planfly.campaigns.engine.flight_loop.fingerprint", lambda name: {"planfly": "0.0.1"})
        other = Pilots(client, base, made_flight)
        once = iter([Order(0)])
        with pytest.raises(WorkerError, match=r"worker tcp://127.0.0.1:\d+: planfly .* not 0.0.1 as here"):
            list(other.fly(lambda: next(once, None)))
        other.close()


@pytest.mark.parametrize(
    ("error", "scheduler", "told_twice"),
    [
        (ZeroDivisionError(), None, True),
        (Interrupted(2), "tcp://127.0.0.1:8786", True),
        # They end with this process, and are not asked to.
        (Interrupted(2), None, False),
    ],
)
def test_workers_that_live_on_forget_a_campaign(
    base: CampaignBase,
    monkeypatch: pytest.MonkeyPatch,
    error: BaseException,
    scheduler: str | None,
    told_twice: bool,
) -> None:
    told: list[str] = []

    class Client:
        def register_plugin(self, plugin: CampaignPlugin) -> None:
            told.append(plugin.name)

        def unregister_worker_plugin(self, name: str) -> None:
            told.append(name)

    monkeypatch.setattr("planfly.campaigns.engine.flight_loop.connected", lambda _: nullcontext(Client()))
    with pytest.raises(type(error)), hired_pilots(Workers(1, scheduler), base, made_flight):
        raise error
    assert told == told[:1] * (2 if told_twice else 1)
