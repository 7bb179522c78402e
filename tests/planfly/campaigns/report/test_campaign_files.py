"""The folder of a campaign."""

import json
import re
from pathlib import Path

import pytest

from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.flight_row import fly_one
from planfly.campaigns.report.campaign_files import AskedFolder, clear_campaign, fly_row_again, write_files
from planfly.campaigns.storage.store import DATABASE
from tests.planfly.campaigns.made_campaigns import made_flight
from tests.planfly.campaigns.report.made_report import made_report
from world.errors import MissionError, PlanflyError


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


def asked(folder: Path, *, resume: bool = False, overwrite: bool = False) -> AskedFolder:
    return AskedFolder(folder, DATABASE, resume, overwrite)


@pytest.mark.parametrize(
    ("lies_there", "words"),
    [
        (DATABASE, "holds a campaign; resume=True goes on with it, overwrite=True replaces it"),
        ("winds.sqlite", "holds another campaign; overwrite=True replaces it"),
        ("mine.txt", "exists and is not empty; overwrite=True replaces its results"),
    ],
)
def test_what_lies_there_is_replaced_only_where_that_is_said(
    base: CampaignBase, tmp_path: Path, lies_there: str, words: str
) -> None:
    (tmp_path / lies_there).write_bytes(b"")
    with pytest.raises(PlanflyError, match=re.escape(f"{tmp_path}: {words}")):
        asked(tmp_path).open(lambda _: base)
    assert [path.name for path in tmp_path.iterdir()] == [lies_there]
    assert asked(tmp_path, overwrite=True).open(lambda _: base) is base
    assert [path.name for path in tmp_path.iterdir()] == (["mine.txt"] if lies_there == "mine.txt" else [])


def test_a_mission_that_cannot_be_opened_leaves_what_lies_there(tmp_path: Path) -> None:
    def not_opened(_planned: Path | None) -> CampaignBase:
        raise MissionError("x")

    (tmp_path / DATABASE).write_bytes(b"")
    with pytest.raises(MissionError):
        asked(tmp_path, overwrite=True).open(not_opened)
    assert (tmp_path / DATABASE).exists()


def test_only_a_campaign_is_gone_on_with_and_by_its_own_plan(base: CampaignBase, tmp_path: Path) -> None:
    with pytest.raises(PlanflyError, match=r"campaign.sqlite: no campaign there to go on with"):
        asked(tmp_path, resume=True).open(lambda _: base)
    (tmp_path / DATABASE).write_bytes(b"")
    planned: list[Path | None] = []

    def noted(path: Path | None) -> CampaignBase:
        planned.append(path)
        return base

    asked(tmp_path, resume=True).open(noted)
    assert planned == [tmp_path / "plan.json"]
    assert (tmp_path / DATABASE).exists()
    with pytest.raises(PlanflyError, match="is a file; a folder is expected"):
        asked(tmp_path / DATABASE).open(lambda _: base)
