"""The folder of a campaign."""

import json
import multiprocessing
import re
from dataclasses import replace
from pathlib import Path

import pytest

from logs.verdict.places import Place
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.failure_counts import RuleFailures
from planfly.campaigns.find_winds import MIN_FLIGHTS_PER_DIRECTION, CalmFailures, WindsGoal, WindsResult
from planfly.campaigns.flight_row import fly_one
from planfly.campaigns.fly_campaign import open_store
from planfly.campaigns.report import (
    OutputDirectory,
    chart_directions,
    clear_campaign,
    finish_campaign,
    fly_row_again,
    wind_lines,
    winds_suite,
    write_files,
    write_winds,
)
from planfly.campaigns.statistics.decision import Estimator, Goal
from planfly.campaigns.statistics.wind_boundary import WindBoundary
from planfly.campaigns.summary import campaign_lines
from planfly.campaigns.tables import CAMPAIGN_DATABASE, StoreError
from tests.planfly.campaigns.made_campaigns import all_fly, made_flight
from tests.planfly.campaigns.made_report import made_report
from world.errors import MissionError, PlanflyError


def test_files_are_written_and_cleared_and_no_others(
    base: CampaignBase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("planfly.campaigns.report.fly_row_again", lambda base, row, log: log.write_bytes(b""))
    (tmp_path / "worst").mkdir()
    (tmp_path / "worst" / "flight-000777.mcap").write_bytes(b"of before")
    (tmp_path / "mine.txt").write_text("stays")
    with made_report(base, tmp_path) as (store, summary):
        write_files(tmp_path, base, summary, store, "planfly campaign x")
        flown = [row for row in summary.worst if row.duration > 0.0]
        logs = {path.name for path in (tmp_path / "worst").iterdir()}
        assert logs == {f"flight-{row.draw.index:06d}.mcap" for row in flown[:3]}
    assert json.loads((tmp_path / "summary.json").read_text())["flights"] == 60
    assert (tmp_path / "report.html").read_bytes().startswith(b"<!DOCTYPE html>")
    clear_campaign(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.txt", "worst"]
    assert list((tmp_path / "worst").iterdir()) == []


def test_a_flight_that_comes_out_otherwise_is_told(base: CampaignBase, tmp_path: Path) -> None:
    row = fly_one(base, 1)
    fly_row_again(base, row, tmp_path / "a.mcap")
    with pytest.raises(PlanflyError, match=r"flight 1 differs from the stored flight.* differing columns: [a-z_]+"):
        fly_row_again(base, made_flight(base, 1), tmp_path / "a.mcap")


def asked(folder: Path, *, resume: bool = False, overwrite: bool = False) -> OutputDirectory:
    return OutputDirectory(folder, CAMPAIGN_DATABASE, resume, overwrite)


@pytest.mark.parametrize(
    ("lies_there", "words"),
    [
        (CAMPAIGN_DATABASE, "contains a campaign; resume=True continues it, overwrite=True replaces it"),
        ("winds.sqlite", "contains another campaign; overwrite=True replaces it"),
        ("mine.txt", "exists and is not empty; overwrite=True replaces its results"),
    ],
)
def test_what_lies_there_is_replaced_only_where_that_is_said(
    base: CampaignBase, tmp_path: Path, lies_there: str, words: str
) -> None:
    (tmp_path / lies_there).write_bytes(b"")
    with pytest.raises(PlanflyError, match=re.escape(f"{tmp_path}: {words}")):
        asked(tmp_path).open_base_and_clear(lambda _: base)
    assert [path.name for path in tmp_path.iterdir()] == [lies_there]
    assert asked(tmp_path, overwrite=True).open_base_and_clear(lambda _: base) is base
    assert [path.name for path in tmp_path.iterdir()] == (["mine.txt"] if lies_there == "mine.txt" else [])


def test_a_mission_that_cannot_be_opened_leaves_what_lies_there(tmp_path: Path) -> None:
    def not_opened(_planned: Path | None) -> CampaignBase:
        raise MissionError("x")

    (tmp_path / CAMPAIGN_DATABASE).write_bytes(b"")
    with pytest.raises(MissionError):
        asked(tmp_path, overwrite=True).open_base_and_clear(not_opened)
    assert (tmp_path / CAMPAIGN_DATABASE).exists()


def test_only_a_campaign_is_gone_on_with_and_by_its_own_plan(base: CampaignBase, tmp_path: Path) -> None:
    with pytest.raises(PlanflyError, match=r"campaign.sqlite: there is no campaign to continue"):
        asked(tmp_path, resume=True).open_base_and_clear(lambda _: base)
    (tmp_path / CAMPAIGN_DATABASE).write_bytes(b"")
    planned: list[Path | None] = []

    def noted(path: Path | None) -> CampaignBase:
        planned.append(path)
        return base

    asked(tmp_path, resume=True).open_base_and_clear(noted)
    assert planned == [tmp_path / "plan.json"]
    assert (tmp_path / CAMPAIGN_DATABASE).exists()
    with pytest.raises(PlanflyError, match="is a file; expected a folder"):
        asked(tmp_path / CAMPAIGN_DATABASE).open_base_and_clear(lambda _: base)


# ----------------------------------------------------------------------
# The go/no-go chart's files.

FOUND = WindsResult(
    WindsGoal(0.9, 0.95, 4, 20.0, 99),
    (*(WindBoundary(7.0 + k, 6.5 + k, 7.5 + k, False) for k in range(3)), WindBoundary(20.0, 18.0, 20.0, True)),
    ((0, 8.0, True), (0, 8.0, False), (1, 5.0, True), (2, 5.0, True), (3, 20.0, True)),
    (1,),
)
# The same boundaries by 150 flights of each direction.
ESTIMATED = replace(FOUND, flights=tuple((k, 5.0, True) for k in range(4) for _ in range(MIN_FLIGHTS_PER_DIRECTION)))


def test_flights_are_counted_by_wind() -> None:
    first = chart_directions(FOUND)[0]
    assert (first.from_deg, first.flights) == (0.0, ((8.0, 2, 1),))
    assert wind_lines(ESTIMATED)[1] == (
        "by the best estimate, flyable with a probability of at least 0.9 in wind up to 7.0 m/s from the worst"
        " direction, 0°"
        " (6.5 to 7.5 m/s at 95 %); highest: over 20 m/s from 270°"
    )
    alike = replace(ESTIMATED, boundaries=(*(WindBoundary(20.0, 18.0 + k, 20.0, True) for k in (1, 0, 1, 1)),))
    assert wind_lines(alike)[1] == (
        "by the best estimate, flyable with a probability of at least 0.9 in wind up to over 20 m/s from the"
        " worst direction, 90°"
        " (18.0 to over 20 m/s at 95 %)"
    )


def test_no_boundary_of_too_few_flights_is_stated(base: CampaignBase, tmp_path: Path) -> None:
    """Of 4 directions with a flight or two, and of one of 149 flights beside three of 150."""
    assert not any("by the best estimate" in line or "interval" in line for line in wind_lines(FOUND)[1:])
    assert repr(FOUND) == "<WindsResult 4 directions, 4 of them not judged; 5 flights>"
    assert all(case.text == "" for case in winds_suite("m", FOUND).cases)
    write_winds(tmp_path, base, FOUND, "planfly winds x")
    page = (tmp_path / "winds.html").read_text()
    assert page.count('<td class="n">not judged</td><td class="n"></td>') == 4
    assert "not judged, 1 to 2 flights" in page
    assert "no limit found" not in page
    partly = replace(ESTIMATED, flights=ESTIMATED.flights[:-1])
    assert repr(partly) == "<WindsResult 4 directions, 4 of them not judged, 7.0 m/s the lowest; 599 flights>"
    assert wind_lines(partly)[1].endswith("(6.5 to 7.5 m/s at 95 %); highest: 9.0 m/s from 180°")


def test_few_flights_say_what_they_show_of_each_direction(base: CampaignBase, tmp_path: Path) -> None:
    """Flown in 0° up to 6 and failed from 8 m/s, in 90° and 180° flown in 5, in 270° lost or failed in 9 m/s."""
    flights = ((0, 6.0, True), (0, 8.0, False), (0, 9.0, True), (1, 5.0, True), (2, 5.0, True), (3, 9.0, False))
    found = replace(FOUND, flights=flights, lost=())
    start = wind_lines(found).index("directions in which the boundary is not proven, with their own flights:")
    assert wind_lines(found)[start + 1 : start + 4] == [
        "  from 0°: no failure up to 6.0 m/s, weakest failure at 8.0 m/s (1 of 3 flights failed)",
        "  from 90° to 180°: no failure up to 5.0 m/s (0 of 2 flights failed)",
        "  from 270°: weakest failure at 9.0 m/s (1 of 1 flight failed)",
    ]
    assert "  from 270°: not enough flights (0 of 1 flight failed)" in wind_lines(replace(found, lost=(5,)))
    assert "  from 270°: not enough flights (0 of 1 flight failed)" in wind_lines(replace(found, undecided=((5, "x"),)))
    assert not any("without a boundary" in line for line in wind_lines(ESTIMATED))
    write_winds(tmp_path, base, found, "planfly winds x")
    directions = json.loads((tmp_path / "winds.json").read_text())["directions"]
    assert [one["flown_bounds_mps"] for one in directions] == [[6.0, 8.0], [5.0, None], [5.0, None], [None, 9.0]]


def test_rules_that_fail_in_calm_air_are_named_with_their_places() -> None:
    """Three of four flights in calm air fail clearance at leg 4, one of them slope, too; from W it flies in 2 m/s."""
    by_rule = (
        RuleFailures("slope", 1, ((Place("leg", 2), 1),)),
        RuleFailures("clearance", 3, ((Place("leg", 4), 3),)),
    )
    boundaries = (*(WindBoundary(0.0, 0.0, 0.3, False) for _ in range(3)), WindBoundary(2.0, 1.8, 2.2, False))
    found = replace(FOUND, boundaries=boundaries, calm=CalmFailures(0.0, 4, 3, by_rule))
    # The answer of calm air comes before the direction that is not judged, and is that of the other three.
    assert wind_lines(found)[0] == "not flyable with a probability of at least 0.9 even in calm air"
    assert wind_lines(found)[1].startswith("not judged in full: 1 of 4 directions has too few flights (1 flight); each")
    found = replace(found, flights=ESTIMATED.flights)
    assert wind_lines(found)[:4] == [
        "by the best estimate, not flyable with a probability of at least 0.9 even in light wind from 0°;"
        " from 270°, flyable in wind up to 2.0 m/s",
        "in calm air, 3 of 4 flights fail",
        "  failed  slopes in 1 flight: leg 2 in 1 flight",
        "  failed  clearance in 3 flights: leg 4 in 3 flights",
    ]
    # Four directions that fail in calm air need no flights in wind.
    nowhere = replace(
        found, flights=FOUND.flights, boundaries=boundaries[:1] * 4, calm=CalmFailures(0.3, 4, 3, by_rule[1:])
    )
    assert wind_lines(nowhere)[:2] == [
        "not flyable with a probability of at least 0.9 even in calm air",
        "in 0.3 m/s, the weakest wind flown, 3 of 4 flights fail",
    ]


def test_the_page_is_red_only_where_flights_show_that_calm_air_is_missed() -> None:
    """Of 4 flights none that flies shows P < 0.9 (at most 0.49 at 95 %), one of which fails does not."""
    settled = tuple((k, 5.0, True) for k in range(4) for _ in range(MIN_FLIGHTS_PER_DIRECTION))
    narrow = tuple(WindBoundary(5.0, 4.9, 5.1, False) for _ in range(4))
    assert FOUND.answer == "not judged"
    judged = replace(FOUND, flights=settled, boundaries=narrow)
    assert judged.answer == "judged"
    assert replace(judged, flights=settled[1:]).answer == "not judged in full"
    for failed, answer in ((4, "not flyable"), (1, "not judged"), (0, "not judged")):
        assert replace(FOUND, calm=CalmFailures(0.0, 4, failed, ())).answer == answer
    # A boundary of 0 m/s whose interval is narrow, from 150 flights, is an answer, too.
    assert replace(judged, calm=CalmFailures(0.0, 4, 1, ())).answer == "not flyable"


def test_the_rule_that_decides_is_named_for_each_direction(base: CampaignBase, tmp_path: Path) -> None:
    clearance, slope = (RuleFailures(rule, 3, ((Place("leg", 4), 3),)) for rule in ("clearance", "slope"))
    most = replace(slope, flights=4)
    found = replace(FOUND, failures=((clearance, most), (slope,), (clearance, slope), ()))
    line = "most frequent failure in winds up to the boundary: slopes from 0° to 90°; clearance from 180°"
    assert [one for one in wind_lines(found) if one.startswith("most frequent failure")] == [line]
    assert not any(one.startswith("most frequent failure") for one in wind_lines(FOUND))
    write_winds(tmp_path, base, found, "planfly winds x")
    directions = json.loads((tmp_path / "winds.json").read_text())["directions"]
    rules = [[(rule["rule"], rule["flights"]) for rule in one["failed_by_rule"]] for one in directions]
    assert rules == [[("clearance", 3), ("slope", 4)], [("slope", 3)], [("clearance", 3), ("slope", 3)], []]
    assert directions[1]["failed_by_rule"][0]["places"][0]["where"] == "leg 4"
    page = (tmp_path / "winds.html").read_text()
    cells = re.findall(r'<td class="n">([a-z]*)</td><td class="n">no: [^<]* of at least 150 flights</td></tr>', page)
    assert cells == ["slopes", "slopes", "clearance", ""]


def test_what_flights_show_by_themselves_where_none_failed() -> None:
    """Of 132 in the largest wind 0.05 ** (1 / 132) at 95 %; fewer of one direction show less."""
    flights = (*((3, 20.0, True) for _ in range(132)), (3, 10.0, True), (0, 20.0, False))
    (line,) = (one for one in wind_lines(replace(FOUND, flights=flights)) if " no flight failed" in one)
    assert line == (
        "in 1 of 4 directions no flight failed: at least 132 flights in 20 m/s from each of them show a"
        " probability of at least 0.978"
    )
    flights += tuple((2, 20.0, True) for _ in range(58))
    (line,) = (one for one in wind_lines(replace(FOUND, flights=flights)) if " no flight failed" in one)
    assert "in 2 of 4 directions no flight failed: at least 58 flights" in line
    assert line.endswith("probability of at least 0.95")
    failed = replace(FOUND, flights=((3, 20.0, False), (0, 10.0, True)))
    assert not any(" no flight failed" in one for one in wind_lines(failed))


def test_directions_for_which_flights_did_not_last_are_said() -> None:
    few = "not judged: 4 of 4 directions have too few flights (1 to 2 flights); each direction requires 150"
    assert wind_lines(FOUND)[0].startswith(few)
    boundary = WindBoundary(7.0, 6.8, 7.3, False)
    settled = WindsResult(FOUND.goal, (boundary,), tuple((0, 7.0, True) for _ in range(MIN_FLIGHTS_PER_DIRECTION)))
    assert not any("not judged" in line for line in wind_lines(settled))
    fewer = WindsResult(FOUND.goal, (boundary,), settled.flights[1:])
    assert wind_lines(fewer)[0].startswith("not judged: 1 of 1 direction has too few flights")
    flights = (*settled.flights, *((1, *flight[1:]) for flight in settled.flights))
    wide = replace(settled, boundaries=(boundary, WindBoundary(7.0, 6.5, 7.5, False)), flights=flights)
    assert wide.reasons == ("", "interval 1.00 m/s wide; at most 0.5 m/s is required")
    assert (wide.judged, wide.answer) == ((True, False), "not judged in full")
    assert repr(wide) == "<WindsResult 2 directions, 1 of them not judged, 7.0 m/s the lowest; 300 flights>"
    assert wind_lines(wide)[0].startswith("not judged in full: 1 of 2 directions has too few flights")


def test_the_cases_of_continuous_integration_are_the_answer_and_each_direction() -> None:
    """Of a search that judges nothing, the answer fails and the directions are skipped."""
    suite = winds_suite("m.waypoints", FOUND)
    answer, *directions = suite.cases
    assert (suite.name, answer.result, answer.message) == ("m.waypoints", "failure", wind_lines(FOUND)[0])
    assert [(case.name, case.result) for case in directions] == [
        (f"from {angle}°", "skipped") for angle in (0, 90, 180, 270)
    ]
    assert directions[0].message == "not judged: 2 of at least 150 flights"
    settled = tuple((k, 5.0, True) for k in range(4) for _ in range(MIN_FLIGHTS_PER_DIRECTION))
    narrow = tuple(WindBoundary(5.0, 4.9, 5.1, False) for _ in range(4))
    judged = winds_suite("m", replace(FOUND, flights=settled, boundaries=narrow))
    assert [case.result for case in judged.cases] == ["passed"] * 5
    assert judged.cases[1].text == "wind up to 5.0 m/s"
    # What fails in calm air fails from every direction.
    calm = (WindBoundary(0.0, 0.0, 0.0, False),) * 4
    flights = ((0, 0.0, False),) * 3
    failing = winds_suite("m", replace(FOUND, boundaries=calm, flights=flights, calm=CalmFailures(0.0, 3, 3, ())))
    assert [case.result for case in failing.cases] == ["failure"] * 5
    assert {case.message for case in failing.cases} == {
        "not flyable with a probability of at least 0.9 even in calm air"
    }


def test_data_picture_and_page(base: CampaignBase, tmp_path: Path) -> None:
    write_winds(tmp_path, base, ESTIMATED, "planfly winds x")
    page = (tmp_path / "winds.html").read_text()
    # Of a direction that is known, and of one whose interval ends beyond.
    # On a narrow screen its cells are broken into lines, and nothing is cut.
    assert "td.n, th.n, td.u { white-space: normal; }" in page[page.index("@media (max-width: 44rem)") :]
    assert '<td class="n">7.0 m/s</td><td class="n">6.5 to 7.5</td>' in page
    assert '<td class="n">over 20 m/s</td><td class="n">18.0 to over 20</td>' in page
    write_winds(tmp_path, base, FOUND, "planfly winds x")
    data = json.loads((tmp_path / "winds.json").read_text())
    assert [one["boundary_mps"] for one in data["directions"]] == [7.0, 8.0, 9.0, 20.0]
    assert data["directions"][3]["beyond"] is True
    assert (data["answer"], data["reason"]) == ("not judged", wind_lines(FOUND)[0])
    assert [(one["judged"], one["reason"]) for one in data["directions"]] == [
        (False, "2 of at least 150 flights"),
        *[(False, "1 of at least 150 flights")] * 3,
    ]
    assert data["lost"] == [1]
    assert (tmp_path / "winds.png").read_bytes()[:4] == b"\x89PNG"
    page = (tmp_path / "winds.html").read_text()
    assert '<div class="answer undecided">' in page
    assert re.search(r"\.undecided \{ border-color: var\(--open\)", page)
    assert f"<title>{base.name} – planfly winds</title>" in page
    assert "Repeat: <code>planfly winds x</code>" in page
    assert page.count('<svg role="img" aria-label="Go/no-go chart') == 2
    assert "lost      1 flight could not be flown" in page


def test_flights_that_could_not_be_flown_are_named() -> None:
    assert any(line.endswith("and count as not flyable: 1 (8.0 m/s from 0°)") for line in wind_lines(FOUND))
    assert not any("lost" in line for line in wind_lines(replace(FOUND, lost=())))


# ----------------------------------------------------------------------
# The end of a campaign in a process of its own.

GOAL = Goal(0.9, False, 40, 0.95)


def test_the_summary_comes_back_and_no_process_stays(base: CampaignBase, tmp_path: Path) -> None:
    with open_store(base, GOAL, tmp_path, resume=False) as store:
        for index in range(40):
            store.add(all_fly(base, index))
        estimate = Estimator(GOAL).estimate(store.tally())
    children = multiprocessing.active_children()
    # The made flights come out otherwise when they are flown: the error of the other process is this one's.
    with pytest.raises(Exception, match="flight 0 differs from the stored flight"):
        finish_campaign(base, GOAL, estimate, tmp_path, "planfly campaign x")
    assert multiprocessing.active_children() == children
    with open_store(base, GOAL, tmp_path, resume=True) as store, pytest.raises(StoreError, match="locked by another"):
        finish_campaign(base, GOAL, estimate, tmp_path, "planfly campaign x")


def test_progress_and_files_are_the_other_processs(base: CampaignBase, tmp_path: Path) -> None:
    from planfly.campaigns.flight_row import fly_one

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
