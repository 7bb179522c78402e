"""Numbers keep their value and unit as text, and rows of findings their order."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from logs.report.text import badge_of, finding_rows, number, quantity, rule_rows
from logs.verdict.findings import Finding, Verdict
from logs.verdict.places import FLIGHT, Place
from logs.verdict.wording import place_text
from tests.logs.report.report_data import FINDINGS, finding


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
def test_badge_states_the_verdict(
    flyable: bool, complete: bool, level: str, findings: tuple[Finding, ...], label: str
) -> None:
    badge = badge_of(Verdict(findings, flyable, complete, (), level))
    assert badge.word == label
    assert badge.state == ("pass" if flyable else "fail")


@given(st.floats(-1e9, 1e9))
def test_numbers_keep_their_value(value: float) -> None:
    text = number(value)
    back = float(text.replace("\u2009", "").replace("−", "-"))
    half_a_last_digit = 5.1e-5 if abs(value) < 0.01 else 5.1e-4 if abs(value) < 0.1 else 5.1e-3
    assert back == pytest.approx(value, rel=0.006, abs=half_a_last_digit)
    assert number(value, signed=True).lstrip("+−") == text.lstrip("−")
    assert not text.startswith(("−0.0000", "-"))
    assert text.lstrip("−0.").strip() or not text.startswith("−")


def test_numbers_are_shown_with_their_units() -> None:
    assert number(None) == number(math.nan) == number(math.inf) == "–"
    assert number(12345.6) == "12\u2009346"
    assert number(-0.001, digits=1) == "0.0"
    assert quantity(math.pi / 6, "rad") == "30.0°"
    assert quantity(4.0, "m/s") == "4.00\u00a0m/s"
    (row,) = finding_rows([finding("turn", Place("waypoint", 1), True, 0.1, unit="rad", planned=0.5, tolerance=0.01)])
    assert (row.planned, row.margin, row.unit) == ("28.6", "+5.73", "°")
    assert row.method == "least squares (±\u00a00.57°)"


@given(st.lists(st.tuples(st.sampled_from([True, False, None]), st.floats(-10, 10)), min_size=1, max_size=12))
def test_rules_show_their_worst_finding(kinds: list[tuple[bool | None, float]]) -> None:
    findings = [finding("slope", Place("leg", k), ok, margin) for k, (ok, margin) in enumerate(kinds)]
    (row,) = rule_rows(findings)
    judged = [item for item in findings if item.ok is not None]
    failed = [item for item in judged if item.ok is False]
    assert row.state == ("fail" if failed else "pass" if judged else "unjudged")
    if judged:
        worst = min(item.margin or 0.0 for item in (failed or judged))
        assert row.where in [place_text(item.place) for item in findings if item.margin == worst]
    states = [item.state for item in finding_rows(findings)]
    assert states == sorted(states, key=["fail", "pass", "unjudged"].index)
