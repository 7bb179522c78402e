"""What a worker holds: unpacked once, and nothing of it where the worker flies otherwise."""

import pytest

from planfly.campaigns.engine.fingerprint import WorkerError, fingerprint
from planfly.campaigns.engine.flight_tasks import CampaignPlugin
from planfly.campaigns.flights.campaign_base import CampaignBase
from tests.planfly.campaigns.made_campaigns import made_flight


def test_it_is_unpacked_once_with_the_model_of_this_machine(base: CampaignBase) -> None:
    plugin = CampaignPlugin("c", base, fingerprint("aerosonde"), made_flight)
    ready, fly = plugin.ready("w")
    assert ready.world_hash() == base.world_hash()
    assert fly(ready, 3, None) == made_flight(base, 3)
    assert plugin.ready("w")[0] is ready


def test_another_model_is_refused_by_name(base: CampaignBase) -> None:
    plugin = CampaignPlugin("c", base, fingerprint("aerosonde") | {"model": "other"}, made_flight)
    with pytest.raises(WorkerError, match="worker tcp://w:9: model"):
        plugin.ready("tcp://w:9")
