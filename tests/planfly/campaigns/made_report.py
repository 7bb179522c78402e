"""A campaign of real and made flights, summarised."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.flight_row import fly_one, make_lost_row
from planfly.campaigns.fly_campaign import open_store
from planfly.campaigns.statistics.decision import Estimator, Goal
from planfly.campaigns.summary import CampaignSummary, summarise_campaign
from planfly.campaigns.tables import Store
from tests.planfly.campaigns.made_campaigns import made_flight


@contextmanager
def made_report(base: CampaignBase, folder: Path, flights: int = 60) -> Iterator[tuple[Store, CampaignSummary]]:
    """Flights 0 and 1 flown, 2 to 58 made, 59 lost; or only the first of these."""
    goal = Goal(0.8, False, flights)
    with open_store(base, goal, folder, resume=False) as store:
        for k in range(flights):
            store.add(
                fly_one(base, k) if k < 2 else made_flight(base, k) if k < 59 else make_lost_row(base, k, "lost: x")
            )
        yield store, summarise_campaign(base, goal, Estimator(goal).estimate(store.tally()), store)
