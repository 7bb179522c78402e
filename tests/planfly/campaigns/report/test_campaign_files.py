"""The folder of a campaign."""

import json
from pathlib import Path

import pytest

from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.flight_row import fly_one
from planfly.campaigns.report.campaign_files import clear_campaign, fly_row_again, write_files
from tests.planfly.campaigns.made_campaigns import made_flight
from tests.planfly.campaigns.report.made_report import made_report
from world.errors import PlanflyError


def test_files_are_written_and_cleared_and_no_others(
    base: CampaignBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "planfly.campaigns.report.campaign_files.fly_row_again", lambda base, row, log: log.write_bytes(b"")
    )
    (tmp_path / "worst").mkdir()
    (tmp_path / "worst" / "flight-000777.mcap").write_bytes(b"of before")
    (tmp_path / "mine.txt").write_text("stays")
    with made_report(base, tmp_path) as (store, summary):
        write_files(tmp_path, base, summary, store, "planfly campaign x")
        logs = {path.name for path in (tmp_path / "worst").iterdir()}
        assert logs == {f"flight-{row.draw.index:06d}.mcap" for row in summary.worst if row.duration > 0.0}
    assert json.loads((tmp_path / "summary.json").read_text())["flights"] == 60
    assert (tmp_path / "report.html").read_bytes().startswith(b"<!DOCTYPE html>")
    clear_campaign(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.txt", "worst"]
    assert list((tmp_path / "worst").iterdir()) == []


def test_a_flight_that_comes_out_otherwise_is_told(base: CampaignBase, tmp_path: Path) -> None:
    row = fly_one(base, 1)
    fly_row_again(base, row, tmp_path / "a.mcap")
    with pytest.raises(PlanflyError, match="comes out otherwise"):
        fly_row_again(base, made_flight(base, 1), tmp_path / "a.mcap")
