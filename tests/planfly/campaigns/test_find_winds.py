"""The boundary of made flights, whose truth is known."""

import pytest

from planfly.campaigns.engine.cluster import Workers
from planfly.campaigns.find_winds import ASKED, WindsGoal, find_winds
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.spread.spread_file import default_spread
from tests.planfly.campaigns.made_campaigns import made_flight


@pytest.mark.filterwarnings("default")
def test_the_boundary_is_found_in_each_direction(base: CampaignBase) -> None:
    goal = WindsGoal(0.9, 0.95, 4, 20.0, 400)
    found = find_winds(base, goal, Workers(1), fly=made_flight)
    # A flight fails from W + luck - 0.5 on, luck even in 0..1: one in ten has failed at W - 0.4.
    truth = [7.6, 7.6, 7.6, 11.6]
    for direction, boundary in enumerate(found.boundaries):
        assert boundary.estimate == pytest.approx(truth[direction], abs=0.5)
        assert boundary.low <= boundary.estimate <= boundary.high
        assert not boundary.beyond
    assert len(found.flights) <= 400
    assert found.from_deg(3) == 270.0


def test_the_wind_that_is_asked_about_does_not_vary() -> None:
    names = {one.quantity.name for one in default_spread().without(ASKED).varying}
    assert not names & {"wind_speed", "wind_from"}
