"""Findings as text: by how much each failed, what would have passed, and numbers with their units."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight.simulation.setup import MissionStretch
from logs.recording.example_log import example_log
from logs.verdict.findings import Finding, make_finding
from logs.verdict.imported.flown_legs import flown_legs
from logs.verdict.imported.model_comparison import Spread, compare_with_model
from logs.verdict.places import FLIGHT, Change, DecidingParameter, LevelAnswer, Place
from logs.verdict.presentation import FindingRow, finding_words, findings_by_rule, number_texts
from logs.verdict.verdict import Verdict
from logs.verdict.wording import place_text, suggestions_text
from logs.views.report.text import (
    describe_model_trust,
    list_not_reflown,
    refly_lines,
)
from tests.logs.views.report.report_data import FINDINGS, finding
from world.scenario import with_wind
from world.wording import format_number, format_quantity

LEG = Place("leg", 4)
DECIDING = DecidingParameter("TECS_HDEM_TCONST", 3.0, 1.2, "s", "clearance", LEG, -8.2)


def failed(rule: str, flown: float | None, limit: float, margin: float | None, place: Place = LEG) -> Finding:
    # The margin of values that pass at a limit of at least or at most some value.
    at_least = flown is not None and margin is not None and abs(flown - limit - margin) < 1e-9
    return make_finding(rule, place, ok=False, reason="", flown=flown, limit=limit, margin=margin, at_least=at_least)


@pytest.mark.parametrize(
    ("rule", "flown", "limit", "margin", "tolerance", "missed"),
    [
        ("completion", 2.0, 3.0, -1.0, 0.0, "1 leg"),
        ("clearance", 52.0, 60.0, -8.0, None, "8.00\u00a0m"),
        # Beyond the limit by 1.5 m, of which 0.5 m are tolerated.
        ("corridor", 61.5, 60.0, -1.5, 0.5, "1.00\u00a0m"),
        # It fails by other evidence than its number.
        ("turn", 6.9, 15.6, None, None, ""),
    ],
)
def test_a_failed_finding_states_by_how_much_it_missed(
    rule: str, flown: float, limit: float, margin: float | None, tolerance: float | None, missed: str
) -> None:
    item = replace(
        failed(rule, flown, limit, margin), tolerance=tolerance, unit="legs" if rule == "completion" else "m"
    )
    assert (FindingRow(item).excess, FindingRow(replace(item, ok=True)).excess) == (missed, "")


def test_tables_call_a_rule_as_the_terminal_does() -> None:
    lost = make_finding(
        "departure", FLIGHT, ok=False, reason="bank 80°", flown=80.0, limit=75.0, margin=-5.0, unit="deg"
    )
    (rule,) = findings_by_rule([lost])
    assert rule.cells[0] == finding_words(lost).word == "loss of control"


def test_the_parameter_stands_at_the_finding_that_it_decides_alone() -> None:
    low = failed("clearance", 52.0, 60.0, -8.0)
    remedy_text = Verdict((low,), False, True, (), "flown", deciding=DECIDING).remedy_text
    assert remedy_text(low) == "the plan as it is, with TECS_HDEM_TCONST 1.2\u00a0s instead of 3"
    assert remedy_text(failed("clearance", 52.0, 60.0, -8.0, Place("leg", 5))) == ""
    assert remedy_text(failed("height", 52.0, 60.0, -8.0)) == ""
    change = (Change("height", LEG, None, 9.0, "m"),)
    both = remedy_text(replace(low, suggestions=(change,)))
    assert both == f"{suggestions_text((change,))}; {remedy_text(low)}"


@pytest.mark.parametrize(("clearance", "advised"), [(-0.02, "clearance"), (20.0, "slope")])
def test_the_remedy_of_a_ground_contact_comes_first(clearance: float, advised: str) -> None:
    changes = {rule: (Change("height", Place("leg", 7), None, 78.0, "m"),) for rule in ("slope", "clearance")}
    findings = tuple(
        replace(failed(rule, flown, limit, flown - limit), suggestions=(changes[rule],))
        for rule, flown, limit in (("slope", -6.0, -4.6), ("clearance", clearance, 30.0))
    )
    first = Verdict(findings, False, True, (), "flown").first_remedied
    assert first is not None
    assert first.rule == advised


# ----------------------------------------------------------------------
# Numbers keep their value and unit as text, and rows of findings their order.


@pytest.mark.parametrize(
    ("flyable", "complete", "level", "findings", "label"),
    [
        (True, True, "flown", FINDINGS[:2], "Flyable"),
        (True, True, "geometric", FINDINGS[:2], "Flyable on paper, not flown"),
        (False, True, "flown", FINDINGS, "Not flyable"),
        (False, False, "flown", FINDINGS, "Not flyable, and incomplete"),
        (False, False, "flown", (finding("completion", FLIGHT, False, None),), "Incomplete, so not flyable"),
        (False, False, "plan", FINDINGS, "Not flyable: no feasible plan"),
    ],
)
def test_title_states_the_verdict(
    flyable: bool, complete: bool, level: str, findings: tuple[Finding, ...], label: str
) -> None:
    shown = Verdict(findings, flyable, complete, (), level)
    assert shown.title == label
    assert shown.state == ("ok" if flyable else "fail")


@given(st.floats(-1e9, 1e9))
def test_numbers_keep_their_value(value: float) -> None:
    text = format_number(value)
    back = float(text.replace("\u2009", "").replace("−", "-"))
    half_a_last_digit = 5.1e-5 if abs(value) < 0.01 else 5.1e-4 if abs(value) < 0.1 else 5.1e-3
    assert back == pytest.approx(value, rel=0.006, abs=half_a_last_digit)
    assert format_number(value, signed=True).lstrip("+−") == text.lstrip("−")
    assert not text.startswith(("−0.0000", "-"))
    assert text.lstrip("−0.").strip() or not text.startswith("−")


def test_numbers_are_shown_with_their_units() -> None:
    assert format_number(None) == format_number(math.nan) == format_number(math.inf) == "–"
    assert format_number(12345.6) == "12\u2009346"
    assert format_number(-0.001, digits=1) == "0.0"
    assert format_quantity(math.pi / 6, "rad") == "30.0°"
    assert format_quantity(4.0, "m/s") == "4.00\u00a0m/s"
    row = number_texts(finding("turn", Place("waypoint", 1), True, 0.1, unit="rad", planned=0.5, tolerance=0.01))
    # 0.1 rad of margin and 0.01 rad of tolerance.
    assert (row.planned, row.margin, row.unit) == ("28.6", "+6.30", "°")


@given(st.lists(st.tuples(st.sampled_from([True, False, None]), st.floats(-10, 10)), min_size=1, max_size=12))
def test_rules_show_their_worst_finding(kinds: list[tuple[bool | None, float]]) -> None:
    findings = [finding("slope", Place("leg", k), ok, margin) for k, (ok, margin) in enumerate(kinds)]
    (rule,) = findings_by_rule(findings)
    judged = [item for item in findings if item.ok is not None]
    failed = [item for item in judged if item.ok is False]
    assert rule.state == ("fail" if failed else "ok" if judged else "unjudged")
    if judged:
        worst = min(item.margin or 0.0 for item in (failed or judged))
        assert rule.cells[3] in [place_text(item.place) for item in findings if item.margin == worst]


LOG = example_log()
FLOWN = flown_legs(LOG.setup, LOG.track, MissionStretch(0.0, 36.5, "AUTO", "log"))
assert FLOWN is not None
AGAIN = compare_with_model(LOG.setup, FLOWN, LOG.track, "completed")


def test_a_row_a_leg_and_a_turn() -> None:
    lines = refly_lines(AGAIN)
    assert [line.split()[:2] for line in lines if line.startswith(("leg", "waypoint"))] == [
        ["leg", "0"],
        ["leg", "1"],
        ["waypoint", "1"],
    ]


def test_what_is_not_known_is_a_dash() -> None:
    silent = replace(AGAIN.legs[0], energy=(math.nan, 2.0))
    assert "- / 2.0" in refly_lines(replace(AGAIN, legs=(silent,)))[2]


def test_the_trust_is_a_line_with_medians() -> None:
    spread = (Spread("cross_track", "m", 0.5, 2.0),)
    line = describe_model_trust(replace(AGAIN, spreads=spread))
    blown = "Median difference (95 %) between the flight and model aerosonde in 0.0 m/s of wind, no gusts: "
    assert line == f"{blown}cross-track 0.50 m (2.00 m)"
    scenario = with_wind(AGAIN.setup.scenario, 4.0, 0.0, "light")
    gusty = replace(AGAIN, setup=replace(AGAIN.setup, scenario=scenario))
    assert "in 4.0 m/s of wind, light turbulence: cross-track" in describe_model_trust(gusty)
    assert "used because no aircraft was named" in describe_model_trust(replace(AGAIN, stands_in=True))
    assert "ended early: departure" in describe_model_trust(replace(AGAIN, ended="departure"))
    assert "no part in common" in describe_model_trust(replace(AGAIN, spreads=()))


def test_what_was_not_flown_again_is_named_with_its_reason() -> None:
    other = MissionStretch(50.0, 60.0, "AUTO", "log")
    assert list_not_reflown((AGAIN,), (AGAIN.stretch,), 9) == []
    (line,) = list_not_reflown((AGAIN,), (AGAIN.stretch, other), 9)
    assert line == "Not flown again: AUTO from 50.0 s to 60.0 s: it did not pass two waypoints in order"
    (line,) = list_not_reflown((AGAIN,), (AGAIN.stretch, other), 1)
    assert line.endswith("in order, or 1 longer stretches were flown again")


def test_a_verdict_that_leaves_something_open_neither_passes_nor_fails() -> None:
    lines = (
        "not judged in full: slope on leg 1 is too close to the limit to judge, because the aircraft's"
        " limits are uncertain",
    )
    levels = (LevelAnswer("geometry", False, lines[0], undecided=True),)
    shown = Verdict((), False, True, lines, "geometric", levels, unjudged="slope on leg 1")
    assert (shown.state, shown.title, shown.reasons) == ("open", "Not judged in full", lines[0].partition(": ")[2])
