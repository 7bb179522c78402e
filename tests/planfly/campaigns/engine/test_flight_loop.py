"""A flight that kills its worker is lost alone; any other comes back."""

import pytest

from planfly.campaigns.engine.cluster import Workers, connected
from planfly.campaigns.engine.fingerprint import WorkerError
from planfly.campaigns.engine.flight_loop import Order, Pilots
from planfly.campaigns.flights.campaign_base import CampaignBase
from tests.planfly.campaigns.made_campaigns import deadly_flight, made_flight


@pytest.mark.filterwarnings("default")
def test_a_deadly_flight_is_lost_alone_and_a_foreign_worker_refused(
    base: CampaignBase, monkeypatch: pytest.MonkeyPatch
) -> None:
    with connected(Workers(2)) as client:
        orders = iter(range(12))
        pilots = Pilots(client, base, deadly_flight)
        flown = {one.order.index: one.row for one in pilots.fly(lambda: next((Order(k) for k in orders), None))}
        pilots.close()
        assert sorted(flown) == list(range(12))
        assert [k for k, row in flown.items() if row.outcome == "lost"] == [5]
        assert flown[5].draw == made_flight(base, 5).draw
        assert all(flown[k].margins == made_flight(base, k).margins for k in flown if k != 5)
        assert all(flown[k].worker.startswith("tcp://127.0.0.1") for k in flown if k != 5)

        monkeypatch.setattr("planfly.campaigns.engine.flight_loop.fingerprint", lambda name: {"planfly": "0.0.1"})
        other = Pilots(client, base, made_flight)
        once = iter([Order(0)])
        with pytest.raises(WorkerError, match=r"worker tcp://127.0.0.1:\d+: planfly .* not 0.0.1 as here"):
            list(other.fly(lambda: next(once, None)))
        other.close()
