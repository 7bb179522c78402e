"""Workers of another version or model are refused by name, and each unpacks its campaign once."""

import pytest

from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.flight_requests import (
    CampaignCopy,
    FlightRequest,
    WorkerError,
    check_fingerprint,
    code_hash,
    fingerprint,
)
from tests.planfly.campaigns.made_campaigns import made_flight


def test_the_same_is_let_in_and_each_difference_is_named() -> None:
    mine = fingerprint("aerosonde")
    check_fingerprint(mine, dict(mine), "w")
    for name in ("planfly", "sources", "model", "jsbsim", "numpy"):
        with pytest.raises(WorkerError, match=f"worker tcp://w:1: {name} other, expected"):
            check_fingerprint(mine, mine | {name: "other"}, "tcp://w:1")


def test_aircraft_differ_and_a_missing_one_is_no_error_here() -> None:
    assert fingerprint("aerosonde")["model"] != fingerprint("c172x")["model"]
    assert "none" in fingerprint("nothing")["model"]
    assert len(code_hash()) == 16


def test_it_is_unpacked_once_with_the_model_of_this_machine(base: CampaignBase) -> None:
    copy = CampaignCopy(base, fingerprint("aerosonde"), made_flight)
    ready, fly = copy.unpack("w")
    assert ready.inputs_hash() == base.inputs_hash()
    assert fly(ready, 3, None) == made_flight(base, 3)
    assert copy.unpack("w")[0] is ready
    assert copy.fly(FlightRequest(3), "w").worker == "w"


def test_another_model_is_refused_by_name(base: CampaignBase) -> None:
    copy = CampaignCopy(base, fingerprint("aerosonde") | {"model": "other"}, made_flight)
    with pytest.raises(WorkerError, match="worker tcp://w:9: model"):
        copy.fly(FlightRequest(0), "tcp://w:9")
