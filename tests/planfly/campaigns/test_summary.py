"""The summary: counts by rule and place, and the same text for any number of workers."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from aircraft.uncertainty import Draws
from logs.verdict.junit import suites_text
from logs.verdict.places import Place
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.dispersions import draw_flight
from planfly.campaigns.failure_counts import count_failures
from planfly.campaigns.flight_row import FlightRow, MinimumMargin, Outcome
from planfly.campaigns.fly_campaign import open_store
from planfly.campaigns.report import campaign_page
from planfly.campaigns.statistics.decision import Answer, Estimator, Goal
from planfly.campaigns.summary import (
    CampaignSummary,
    campaign_lines,
    campaign_suite,
    closest_text,
    summarise_campaign,
    summary_json,
)
from tests.planfly.campaigns.made_campaigns import made_flight
from tests.planfly.campaigns.made_report import made_report


def test_it_counts_what_failed_and_names_what_was_lost(base: CampaignBase, tmp_path: Path) -> None:
    failed = sum(made_flight(base, k).outcome != "flyable" for k in range(2, 59))
    assert failed > 0
    with made_report(base, tmp_path) as (_, summary):
        tally = summary.estimate.tally
        assert (tally.flyable, tally.failed, tally.lost) == (59 - failed, failed, 1)
        assert repr(summary) == f"<CampaignSummary {base.name}: {59 - failed} of 60 flights are flyable>"
        assert [(one.rule, one.flights, one.places) for one in summary.by_rule] == [
            ("clearance", failed, ((Place("leg", 1), failed),))
        ]
        assert summary.lost == (59,)
        assert [entry.rule for entry in summary.deciding] == ["clearance"]
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


def test_the_target_and_each_failed_rule_are_cases_of_continuous_integration(
    base: CampaignBase, tmp_path: Path
) -> None:
    with made_report(base, tmp_path) as (_, summary):
        failed = summary.by_rule[0].flights
        results = {"reached": "passed", "missed": "failure", "undecided": "failure", "no target": "skipped"}
        for answer, result in results.items():
            estimate = replace(summary.estimate, answer=cast(Answer, answer))
            suite = campaign_suite("m.waypoints", replace(summary, estimate=estimate))
            assert [(case.classname, case.name, case.result) for case in suite.cases] == [
                ("planfly", "verdict", result),
                ("planfly.clearance", "flights", result),
            ]
            assert suite.cases[1].message == f"{failed} of 60 flights failed"
            count = "1 flight" if failed == 1 else f"{failed} flights"
            assert suite.cases[1].text == f"failed  clearance in {count}: leg 1 in {count}"
            assert suites_text([suite]).count("<failure") == (2 if result == "failure" else 0)


def test_a_campaign_without_a_target_says_so_in_its_answer(base: CampaignBase, tmp_path: Path) -> None:
    with made_report(base, tmp_path) as (_, summary):
        untargeted = replace(
            summary,
            goal=replace(summary.goal, target=None),
            estimate=replace(summary.estimate, answer="no target"),
        )
        assert campaign_lines(untargeted)[0].startswith("no target is set (--prove P or --at-least P): ")


def test_whose_flights_they_are_stands_behind_the_answer(base: CampaignBase, tmp_path: Path) -> None:
    """The aircraft of 11 kg and its 25 m/s are of the published Aerosonde; the rest the scenario states."""
    with made_report(base, tmp_path) as (store, summary):
        aircraft, world, pilot = campaign_lines(summary)[4:7]
        assert aircraft.startswith("  Aircraft: aerosonde, 11 kg, 25 m/s")
        assert world.startswith(
            "  Conditions: wind 5 m/s from 250 degrees, light turbulence (vertical gusts: 0.77 m/s RMS); navigation "
        )
        assert world.endswith("; terrain flat at 100 m, heights above mean sea level")
        assert pilot.startswith("  Flown by: ")
        named = replace(summary, dispersions={"wind_speed": {}, "battery": {}})
        assert campaign_lines(named)[7] == (
            "  Varied around these conditions: wind speed, battery; the same in every flight: wind direction, wind"
            " gradient, turbulence, mass, drag, control power, terrain height, start position east,"
            " start position north, start altitude"
        )
        data = json.loads(summary_json(summary))["conditions"]
        assert (data["aircraft"], data["mass_kg"], data["airspeed_mps"]) == ("aerosonde", 11.0, 25.0)
        assert (data["wind_mps"], data["wind_from_deg"], data["turbulence"]) == (5.0, 250.0, "light")
        page = campaign_page(base, summary, store, "planfly campaign").decode()
        assert page.count("Aircraft: aerosonde, 11 kg, 25 m/s") == 1


def with_margins(base: CampaignBase, index: int, *rules: tuple[str, float], failed: tuple[str, ...] = ()) -> FlightRow:
    """A flight with these margins, m, at leg 1, that failed these rules at leg 2."""
    margins = tuple((rule, MinimumMargin(margin, "m", Place("leg", 1))) for rule, margin in rules)
    outcome: Outcome = "not flyable" if failed else "flyable"
    places = tuple((rule, Place("leg", 2)) for rule in failed)
    return replace(made_flight(base, index), outcome=outcome, margins=margins, failed=places)


def test_failed_rules_come_first_in_the_ranking_also_without_a_margin(base: CampaignBase, tmp_path: Path) -> None:
    """Slope fails twice for a reason without a number; waypoints pass by 4 m, and clearance by its tolerance only."""
    goal = Goal(None, False, 4)
    with open_store(base, goal, tmp_path, resume=False) as store:
        store.add(with_margins(base, 0, ("clearance", 30.0), ("waypoint", 4.0), failed=("slope",)))
        store.add(with_margins(base, 1, ("clearance", 0.7), ("waypoint", 14.0), failed=("slope",)))
        store.add(with_margins(base, 2, ("clearance", 3.0), ("corridor", -2.0), failed=("corridor",)))
        store.add(with_margins(base, 3, ("clearance", 0.5), ("height", 40.0)))
        summary = summarise_campaign(base, goal, Estimator(goal).estimate(store.tally()), store)
        ranked = [
            (entry["rule"], entry["failed"], entry["smallest_margin"])
            for entry in json.loads(summary_json(summary))["closest_rules"]
        ]
    assert ranked == [
        ("slope", 2, None),
        ("corridor", 1, -2.0),
        ("clearance", 0, 0.5),
        ("waypoint", 0, 4.0),
        ("height", 0, 40.0),
    ]
    lines = campaign_lines(summary)
    assert [line for line in lines if line.startswith(("  failed", "  narrow"))] == [
        "  failed  slopes in 2 flights: leg 2 in 2 flights",
        "  failed  corridor in 1 flight: leg 2 in 1 flight",
        "  narrow  clearance: the smallest margin of all flights, including the tolerance, is +0.5 m",
        "  narrow  waypoints: the smallest margin of all flights, including the tolerance, is +4.0 m",
    ]
    closest = {row.draw.index: closest_text(row) for row in summary.worst}
    assert closest == {
        0: "slopes failed at leg 2 by an unknown margin",
        1: "slopes failed at leg 2 by an unknown margin",
        2: "corridor at leg 1: -2.0 m",
        3: "clearance at leg 1: +0.5 m",
    }


def test_flights_inside_a_missile_range_are_ranked_by_how_deep_they_were(base: CampaignBase, tmp_path: Path) -> None:
    """Flight 3 is of a table without the distance as a margin.  A tenth of the way from -5.24 to -2 m is -4.92 m."""
    goal, deepest = Goal(None, False, 4), (-0.5, -5.24, -2.0)
    with open_store(base, goal, tmp_path, resume=False) as store:
        for index, distance in enumerate(deepest):
            store.add(with_margins(base, index, ("threat", distance), ("clearance", 0.1), failed=("threat",)))
        known = summarise_campaign(base, goal, Estimator(goal).estimate(store.tally()), store)
        store.add(with_margins(base, 3, failed=("threat",)))
        summary = summarise_campaign(base, goal, Estimator(goal).estimate(store.tally()), store)
    assert [row.draw.index for row in summary.worst] == [1, 2, 0, 3]
    assert [closest_text(row) for row in summary.worst] == [
        "threats at leg 1: -5.2 m",
        "threats at leg 1: -2.0 m",
        "threats at leg 1: -0.5 m",
        "threats failed at leg 2 by an unknown margin",
    ]
    ranked = summary.ranking[0]
    assert (ranked.rule, ranked.failed, ranked.lowest, ranked.unit) == ("threat", 4, -5.24, "m")
    assert "threats: 5 % of the flights have a margin below -4.92 m" in "\n".join(campaign_lines(known))


def summary_of_margins(
    base: CampaignBase, folder: Path, flights: Sequence[tuple[float | None, bool]]
) -> CampaignSummary:
    """A campaign of flights with these slope margins, deg, None if it is unknown, that failed the rule or not."""
    goal = Goal(None, False, len(flights))
    with open_store(base, goal, folder, resume=False) as store:
        for index, (margin, has_failed) in enumerate(flights):
            row = with_margins(base, index, failed=("slope",) if has_failed else ())
            known = (("slope", MinimumMargin(margin, "deg", Place("leg", 1))),) if margin is not None else ()
            store.add(replace(row, margins=known))
        return summarise_campaign(base, goal, Estimator(goal).estimate(store.tally()), store)


def test_a_flight_that_failed_by_an_unknown_margin_counts_as_beyond_the_limit(
    base: CampaignBase, tmp_path: Path
) -> None:
    """16 of 40 fail without a number; with one of 41, two flights of the lowest 5 % are between -inf and 0.5."""
    passed = [(0.5 + 0.1 * k, False) for k in range(40)]
    unknown = "16 of 40 flights fail this rule, by an unknown margin"
    cases = {
        "many": ([*passed[:24], *[(None, True)] * 16], unknown, None, None),
        "one": ([*passed, (None, True)], "5 % of the flights have a margin below 0.6°", 0.6, None),
        "known": ([*passed, (-2.0, True)], "5 % of the flights have a margin below 0.6°", 0.6, -2.0),
        # A leg may pass by 3 degrees where another one fails without a number.
        "other leg": (
            [*passed[:24], *[(3.0, True)] * 16],
            "16 of 40 flights fail this rule, by an unknown margin",
            None,
            None,
        ),
    }
    for name, (flights, text, low_margin, lowest) in cases.items():
        (tmp_path / name).mkdir()
        summary = summary_of_margins(base, tmp_path / name, flights)
        line = campaign_lines(summary)[-1]
        assert (
            line == f"  decides slopes: {text}. None of the varied quantities has a significant effect on this margin"
        )
        data = json.loads(summary_json(summary))
        assert (data["margin_of_one_in_twenty"], data["margin_unit"]) == (low_margin, "deg")
        assert (data["closest_rules"][0]["smallest_margin"], data["closest_rules"][0]["unit"]) == (lowest, "deg")


def test_only_what_is_shown_to_explain_the_margin_is_named_also_of_the_aircraft(
    base: CampaignBase, tmp_path: Path
) -> None:
    """The margin of 40 flights is the drawn thrust, of which the table has no column; eleven others are noise."""
    thrust = np.random.default_rng(5).normal(1.0, 0.1, 64)
    names = ("ident/thrust", "ident/lift-slope")
    draws = Draws(names, np.column_stack((thrust, np.random.default_rng(6).normal(1.0, 0.1, 64))), "draws.csv")
    drawn = replace(base, dispersions=base.dispersions.with_draws(draws))
    seeds = [draw_flight(drawn.dispersions, drawn.seed, index).seed for index in range(40)]
    summary = summary_of_margins(drawn, tmp_path, [(5.0 * float(thrust[seed % 64]), False) for seed in seeds])
    assert [driver.quantity for driver in summary.deciding[0].drivers] == ["ident/thrust"]
    assert ". Causes of the margin's variance: the aircraft's thrust (" in campaign_lines(summary)[-1]
    sensitivities = {entry["quantity"]: entry for entry in json.loads(summary_json(summary))["sensitivities"]}
    assert {name for name, entry in sensitivities.items() if entry["shown"]} == {"ident/thrust"}
    assert {"ident/lift-slope", "mass", "wind_speed"} < set(sensitivities)
    # The index of noise is often above 5 %.
    assert max(entry["first_order"] for name, entry in sensitivities.items() if name != "ident/thrust") > 0.05


def test_all_rules_that_most_flights_fail_are_explained(base: CampaignBase, tmp_path: Path) -> None:
    """Five of 40 flights fail the slope, five others the clearance, whose margin is the drawn height of the terrain."""
    goal = Goal(None, False, 40)
    heights = [draw_flight(base.dispersions, base.seed, index).values["terrain_height"] for index in range(40)]
    highest = sorted(range(40), key=heights.__getitem__)[-5:]
    steep = [index for index in range(40) if index not in highest][:5]
    with open_store(base, goal, tmp_path, resume=False) as store:
        for index, height in enumerate(heights):
            failed = ("clearance",) if index in highest else ("slope",) if index in steep else ()
            low = sorted(heights)[-5] - height - 1e-3
            store.add(with_margins(base, index, ("clearance", low), ("corridor", 9.0), failed=failed))
        summary = summarise_campaign(base, goal, Estimator(goal).estimate(store.tally()), store)
    assert [entry.rule for entry in summary.deciding] == ["slope", "clearance"]
    slope, clearance = (line for line in campaign_lines(summary) if line.startswith("  decides"))
    assert "slopes: 5 of 40 flights fail this rule, by an unknown margin" in slope
    assert "Causes of the margin's variance: terrain height (" in clearance
    data = json.loads(summary_json(summary))
    assert (data["deciding_rule"], [entry["deciding_rule"] for entry in data["tied_rules"]]) == ("slope", ["clearance"])


def test_an_undecided_target_names_the_flights_that_would_decide_it(base: CampaignBase, tmp_path: Path) -> None:
    """0.95 ** 58 is 0.051 and 0.95 ** 59 is 0.0485; and without a home the first line says what is not judged."""
    goal = Goal(0.95, False, 20)
    with open_store(base, goal, tmp_path, resume=False) as store:
        for index in range(20):
            store.add(with_margins(base, index, ("clearance", 9.0)))
        summary = summarise_campaign(base, goal, Estimator(goal).estimate(store.tally()), store)
    assert summary.estimate.answer == "undecided"
    assert "  59 flights without a failure would decide the target" in campaign_lines(summary)
    assert json.loads(summary_json(summary))["deciding_flights"] == 59
    assert summary.unjudged_return == ""
    lines = campaign_lines(replace(summary, unjudged_return="the mission has no home"))
    assert lines[0].endswith("; return not judged")
    assert "  Not judged: return (the mission has no home)" in lines


def test_too_few_flights_show_no_sensitivities(base: CampaignBase, tmp_path: Path) -> None:
    """Eight flights cannot say what a margin depends on, and are not drawn as eleven times 0 %."""
    with made_report(base, tmp_path, flights=8) as (store, summary):
        assert [entry.rule for entry in summary.deciding] == ["clearance"]
        assert summary.deciding[0].sensitivities == ()
        assert (
            ". At least 20 judged flights are needed to find what the margin depends on" in campaign_lines(summary)[-1]
        )
        assert "What the smallest margin depends on" not in campaign_page(base, summary, store, "").decode()


def test_what_ends_a_flight_comes_before_what_it_then_misses() -> None:
    flight = [(rule, Place("waypoint", 1)) for rule in ("waypoint", "slope", "completion", "departure", "launch")]
    assert [failures.rule for failures in count_failures([flight])] == [
        *("launch", "departure", "completion", "slope", "waypoint")
    ]


def test_corners_of_one_loiter_are_one_place() -> None:
    """Flights fail at different corners; a person reads of one leg to the loiter."""
    flights = [[("clearance", Place("leg", index, to_item=4, number=2))] for index in (2, 5, 9)]
    (clearance,) = count_failures(flights)
    assert [(place.number, count) for place, count in clearance.places] == [(2, 3)]


def summary_of_outcomes(
    base: CampaignBase, folder: Path, goal: Goal, flyable: int, failed: int, undecided: int
) -> CampaignSummary:
    """A campaign of flights that fly, flights that fail the mission, and flights that leave it open."""
    whole = (("mission", Place("mission")),)
    with open_store(base, goal, folder, resume=False) as store:
        for index in range(flyable + failed + undecided):
            row = with_margins(base, index, ("clearance", 9.0))
            if index >= flyable + failed:
                row = replace(row, outcome="undecided", failed=whole, undecided_text=f"mission (open {index})")
            elif index >= flyable:
                row = replace(row, outcome="not flyable", failed=whole)
            store.add(row)
        return summarise_campaign(base, goal, Estimator(goal).estimate(store.tally()), store)


@pytest.mark.parametrize(
    ("counts", "answer"),
    [
        # 0.95 ** 59 is 0.0485: 59 flights without a failure show 0.95.
        ((59, 0, 0), "reached"),
        ((59, 0, 1), "undecided"),
        ((0, 0, 20), "undecided"),
        ((1, 19, 0), "missed"),
        # Even if both were flyable.
        ((1, 17, 2), "missed"),
    ],
)
def test_undecided_flights_leave_a_target_open_unless_it_holds_either_way(
    base: CampaignBase, tmp_path: Path, counts: tuple[int, int, int], answer: str
) -> None:
    summary = summary_of_outcomes(base, tmp_path, Goal(0.95, False, sum(counts)), *counts)
    assert summary.estimate.answer == answer


def test_undecided_flights_are_no_failures_and_name_the_reason_of_the_first(base: CampaignBase, tmp_path: Path) -> None:
    summary = summary_of_outcomes(base, tmp_path, Goal(0.9, False, 20), 1, 0, 19)
    lines = campaign_lines(summary)
    assert lines[0] == (
        "it is undecided whether the probability of a flyable flight is at least 0.9: 1 of 20 flights is"
        " flyable, 19 not"
        " judged in full, a share of 0.0500 to 1.0000"
    )
    assert "  Not judged in full: 19 of 20 flights; the first for this reason: mission (open 1)" in lines
    assert not any(line.startswith("  failed") for line in lines)
    assert not any("decides mission" in line for line in lines)
    data = json.loads(summary_json(summary))
    assert (data["flyable"], data["not_flyable"], data["undecided"]) == (1, 0, 19)
    assert data["not_judged"] == "mission (open 1)"
    assert (data["failed_by_rule"], data["worst"][0]["failed"]) == ([], [])
    assert data["deciding_flights"] is None


def test_a_mission_that_fails_as_a_whole_is_named_once(base: CampaignBase, tmp_path: Path) -> None:
    summary = summary_of_outcomes(base, tmp_path, Goal(None, False, 4), 1, 3, 0)
    failed_lines = [line for line in campaign_lines(summary) if line.startswith("  failed")]
    assert failed_lines == ["  failed  mission in 3 flights"]
    named = replace(summary, mission_fault="starts with landing")
    assert "  failed  mission in 3 flights: starts with landing" in campaign_lines(named)
