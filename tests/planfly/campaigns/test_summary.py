"""The summary: counts by rule and place, and the same text for any number of workers."""

import json
from pathlib import Path

from logs.verdict.places import Place
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.summary import campaign_lines, summary_json
from tests.planfly.campaigns.made_campaigns import made_flight
from tests.planfly.campaigns.made_report import made_report


def test_it_counts_what_failed_and_names_what_was_lost(base: CampaignBase, tmp_path: Path) -> None:
    failed = sum(made_flight(base, k).outcome != "flyable" for k in range(2, 59))
    assert failed > 0
    with made_report(base, tmp_path) as (_, summary):
        tally = summary.estimate.tally
        assert (tally.flyable, tally.failed, tally.lost) == (59 - failed, failed, 1)
        assert [(one.rule, one.flights, one.places) for one in summary.by_rule] == [
            ("clearance", failed, ((Place("leg", 1), failed),))
        ]
        assert summary.lost == (59,)
        assert summary.deciding == "clearance"
        assert summary.worst[0].outcome == "lost"
        assert all(row.outcome == "not flyable" for row in summary.worst[1 : 1 + min(failed, 9)])
        data = json.loads(summary_json(summary))
        assert data["lost"] == [59]
        assert data["failed_by_rule"][0]["places"][0]["where"] == "leg 1"
        assert data["probability"] == round((59 - failed) / 60, 9)
        assert not {"seconds", "worker"} & set(json.dumps(data).split('"'))
        text = "\n".join(campaign_lines(summary))
        assert f"{59 - failed} of 60 flights are flyable" in text
        assert "lost    1" in text
