"""Two campaigns compared: in pairs where the draws are the same, else as two samples."""

import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

import planfly
from logs.verdict.places import Place
from planfly.campaigns.campaign_base import CampaignBase, open_campaign
from planfly.campaigns.compare_campaigns import comparison_lines
from planfly.campaigns.dispersions import default_dispersions
from planfly.campaigns.fly_campaign import open_store
from planfly.campaigns.statistics.decision import Goal, Tally
from planfly.cli import main
from planfly.flight_options import MissionOptions
from tests.planfly.campaigns.made_campaigns import all_fly, write_short
from tests.planfly.terminal.answers.checked_answers import answered


def fly(base: CampaignBase, folder: Path, flights: int, failed: dict[int, str], goal: Goal | None = None) -> Path:
    """A campaign of so many flights, of which those named fail their rule."""
    folder.mkdir()
    with open_store(base, goal or Goal(None, False, flights), folder, resume=False) as store:
        for index in range(flights):
            row = all_fly(base, index)
            if index in failed:
                row = replace(row, outcome="not flyable", failed=((failed[index], Place("leg", 1)),))
            store.add(row)
    return folder


def test_flights_with_the_same_draws_are_pairs(
    base: CampaignBase, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Flights 0 and 1 fail in both; 12 more fail in the second campaign, and 2 that fly there in the first."""
    first = fly(base, tmp_path / "a", 50, {0: "slope", 1: "slope", 2: "slope", 3: "energy"})
    failed = dict.fromkeys([0, 1, *range(10, 22)], "clearance")
    mission, scenario = write_short(tmp_path)
    options: MissionOptions = {"scenario": scenario, "seed": 1, "wind": (9.0, 250.0)}
    windier = open_campaign(str(mission), default_dispersions(), options)
    second = fly(windier, tmp_path / "b", 50, failed)
    found = planfly.compare_campaigns(first, second / "campaign.sqlite")
    assert (found.pairs, found.only_first, found.only_second) == (50, 12, 2)
    assert found.difference.value == pytest.approx(-0.2)
    assert found.answer == "less likely"
    assert found.rules == [("clearance", 0, 14), ("slope", 3, 0), ("energy", 1, 0)]
    assert found.inputs == ("wind.speed_mps 9.0 instead of 5.0",)
    lines = comparison_lines(found)
    assert lines[0].startswith(
        "flights of the second campaign are less likely to be flyable: the probability differs by -0.2000 (95 %"
        " interval: -0.3447 to"
    )
    assert (
        "  fails   clearance more often in the second campaign: 14 of 50 flights, and 0 of 50 in the first"
        " (+28.0 percentage points)" in lines
    )
    assert (
        "  fails   slopes less often in the second campaign: 0 of 50 flights, and 3 of 50 in the first (-6.0"
        " percentage points)" in lines
    )
    answer = answered(capsys, 0, "compare", str(first), str(second))
    assert (answer["answer"], answer["pairs"], answer["campaigns"][1]["flyable"]) == ("less likely", 50, 36)


def test_one_line_says_which_method_decides_where_two_disagree(base: CampaignBase, tmp_path: Path) -> None:
    """Of 40 pairs five are flyable in the second campaign only: p = 2 / 2 ** 5, but the score interval excludes 0."""
    first = fly(base, tmp_path / "a", 40, dict.fromkeys(range(5), "slope"))
    found = planfly.compare_campaigns(first, fly(base, tmp_path / "b", 40, {}))
    assert (found.answer, found.difference.p_value) == ("more likely", 0.0625)
    note = (
        "the interval shows a difference, but McNemar's exact test shows none (p = 0.062, limit 0.05); the interval"
        " decides the answer"
    )
    assert found.notes == (note,)
    assert comparison_lines(found)[-1] == f"  note    {note}"
    sure = planfly.compare_campaigns(first, fly(base, tmp_path / "c", 40, dict.fromkeys(range(5, 30), "slope")))
    assert sure.difference.p_value < 0.01
    assert sure.notes == ()


def test_other_draws_are_other_samples(base: CampaignBase, tmp_path: Path) -> None:
    first = fly(base, tmp_path / "a", 80, dict.fromkeys(range(32), "slope"))
    second = fly(replace(base, seed=2), tmp_path / "b", 70, dict.fromkeys(range(14), "slope"))
    found = planfly.compare_campaigns(first, second)
    assert found.pairs == 0
    (hint,) = [line for line in comparison_lines(found) if line.startswith("  paired  no: ")]
    assert hint.endswith(
        ". Campaigns with the same --seed and --spread are compared in pairs, which shows smaller differences"
    )
    assert [round(bound, 4) for bound in found.difference.interval] == [0.0524, 0.3339]
    assert found.answer == "more likely"
    assert found.inputs == ("seed 2 instead of 1",)


def test_the_flights_that_both_have_are_compared_and_a_stopped_campaign_is_noted(
    base: CampaignBase, tmp_path: Path
) -> None:
    first = fly(base, tmp_path / "a", 20, {})
    second = fly(base, tmp_path / "b", 30, {}, Goal(0.9, True, 5000))
    found = planfly.compare_campaigns(first, second)
    assert (found.pairs, found.answer, found.inputs) == (20, "no difference shown", ())
    assert found.notes[0] == (
        "the difference and the counts by rule compare only the 20 flights that both campaigns have"
    )
    assert "only approximate" in found.notes[1]
    assert "  differs no input; planfly's code may differ" in comparison_lines(found)


def test_a_campaign_is_compared_with_a_campaign_only(
    base: CampaignBase, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = fly(base, tmp_path / "a", 2, {})
    empty = fly(base, tmp_path / "b", 0, {})
    for argv, words in (
        ([str(first), "flight.mcap"], "flight.mcap: no campaign; expected a folder with a campaign.sqlite"),
        ([str(first), str(empty)], "no flight of this campaign was flown"),
        ([str(first), str(first), "--svg"], "--svg: allowed only with two flight logs"),
    ):
        assert main(["compare", *argv]) == 2
        assert words in capsys.readouterr().err


def test_undecided_flights_fail_no_rule_and_are_noted(base: CampaignBase, tmp_path: Path) -> None:
    first = fly(base, tmp_path / "a", 20, {})
    with open_store(base, Goal(None, False, 20), _made(tmp_path / "b"), resume=False) as store:
        for index in range(20):
            row = all_fly(base, index)
            open_row = replace(row, outcome="undecided", failed=(("slope", Place("leg", 1)),), undecided_text="slopes")
            store.add(open_row if index < 3 else row)
    found = planfly.compare_campaigns(first, tmp_path / "b")
    assert found.second.tally == Tally(17, 0, 0, 3)
    assert found.rules == []
    assert "the difference counts 3 flights not judged in full as not flyable" in found.notes


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder


def test_rules_are_compared_on_the_flights_that_both_campaigns_have(base: CampaignBase, tmp_path: Path) -> None:
    """Of 40 flights the first 10 were flown twice, with the same 4 failures; the other 30 fail only in the first."""
    same = dict.fromkeys(range(4), "clearance")
    first = fly(base, tmp_path / "a", 40, same | dict.fromkeys(range(10, 40), "slope"))
    found = planfly.compare_campaigns(first, fly(base, tmp_path / "b", 10, same))
    assert (found.difference.value, found.only_first, found.only_second) == (0.0, 0, 0)
    assert found.rules == [("clearance", 4, 4)]
    assert (
        "  fails   clearance as often in the second campaign: 4 of 10 flights, and 4 of 10 in the first (+0.0"
        " percentage points)" in comparison_lines(found)
    )


def test_a_table_whose_rows_were_changed_is_not_compared(base: CampaignBase, tmp_path: Path) -> None:
    first, second = fly(base, tmp_path / "a", 6, {}), fly(base, tmp_path / "b", 6, {})
    with closing(sqlite3.connect(second / "campaign.sqlite")) as connection, connection:
        connection.execute("UPDATE flights SET outcome = 'not flyable' WHERE flight IN (2, 5)")
    with pytest.raises(planfly.PlanflyError, match=r"2 rows damaged or changed by another program \(flights 2, 5\)"):
        planfly.compare_campaigns(first, second)
