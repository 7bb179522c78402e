"""Campaigns for Python."""

from pathlib import Path

import pytest

import planfly
from planfly.campaigns.campaign_result import MOST_FLIGHTS, USUAL_FLIGHTS, CampaignResult, make_goal
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.track_shape import STATIONS
from planfly.campaigns.storage.read_table import read_table
from planfly.campaigns.storage.store import DATABASE
from tests.planfly.campaigns.report.made_report import made_report


def test_the_public_name_is_the_package_s() -> None:
    assert planfly.campaign.__name__ == "campaign"
    assert planfly.CampaignResult is CampaignResult


def test_what_it_tells(base: CampaignBase, tmp_path: Path) -> None:
    with made_report(base, tmp_path) as (store, summary):
        tally = store.tally()
    result = CampaignResult(summary, read_table(tmp_path / DATABASE), tmp_path / DATABASE)
    assert result.probability == tally.flyable / 60
    assert result.interval.low < result.probability < result.interval.high
    assert result.bounds.low > result.interval.low
    assert result.by_rule == {"clearance": tally.failed}
    flights = result.flights
    assert list(flights["flight"]) == list(range(60))
    assert list(flights["outcome"]).count("lost") == 1
    assert "clearance" not in flights
    assert result.shapes()["clearance"].shape == (60, STATIONS)
    with pytest.raises(ValueError, match="kept no folder; give it one by out"):
        CampaignResult(summary, result.columns).shapes()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((None, 0.9, 0.9, 0.95), "one of them"),
        ((None, 1.0, None, 0.95), "prove: 1.0"),
        ((None, None, 0.4, 0.95), "at_least: 0.4"),
        ((None, None, None, 1.0), "confidence: 1.0"),
        ((0, None, None, 0.95), "flights: 0"),
    ],
)
def test_numbers_that_are_none(given: tuple[int | None, float | None, float | None, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make_goal(*given)


def test_how_many_flights_are_meant() -> None:
    assert make_goal(None, None, None, 0.95).flights == USUAL_FLIGHTS
    assert make_goal(None, 0.99, None, 0.95).flights == MOST_FLIGHTS
    assert make_goal(7, None, 0.9, 0.95).target == 0.9
