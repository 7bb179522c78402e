"""The end of a campaign in a process of its own."""

import multiprocessing
from pathlib import Path

import pytest

from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.fly_campaign import open_store
from planfly.campaigns.report.finish_campaign import finish_campaign
from planfly.campaigns.report.summary import campaign_lines
from planfly.campaigns.statistics.decision import Estimator, Goal
from planfly.campaigns.storage.held_table import StoreError
from tests.planfly.campaigns.made_campaigns import all_fly

GOAL = Goal(0.9, False, 40, 0.95)


def test_the_summary_comes_back_and_no_process_stays(base: CampaignBase, tmp_path: Path) -> None:
    with open_store(base, GOAL, tmp_path, resume=False) as store:
        for index in range(40):
            store.add(all_fly(base, index))
        estimate = Estimator(GOAL).estimate(store.tally())
    children = multiprocessing.active_children()
    # The made flights come out otherwise when they are flown: the error of the other process is this one's.
    with pytest.raises(Exception, match="flight 0 comes out otherwise"):
        finish_campaign(base, GOAL, estimate, tmp_path, "planfly campaign x")
    assert multiprocessing.active_children() == children
    with open_store(base, GOAL, tmp_path, resume=True) as store, pytest.raises(StoreError, match="held by another"):
        finish_campaign(base, GOAL, estimate, tmp_path, "planfly campaign x")


def test_progress_and_files_are_the_other_processs(base: CampaignBase, tmp_path: Path) -> None:
    from planfly.campaigns.flights.flight_row import fly_one

    with open_store(base, GOAL, tmp_path, resume=False) as store:
        for index in range(2):
            store.add(fly_one(base, index))
        estimate = Estimator(GOAL).estimate(store.tally())
    told: list[float] = []
    summary = finish_campaign(base, GOAL, estimate, tmp_path, "planfly campaign x", lambda done, *_: told.append(done))
    assert told == [1.0, 2.0]
    assert "2 of 2 flights are flyable" in campaign_lines(summary)[0]
    assert len(list((tmp_path / "worst").iterdir())) == 2
    assert (tmp_path / "report.html").is_file()
    assert (tmp_path / "summary.json").is_file()
