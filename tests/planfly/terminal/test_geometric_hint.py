"""A verdict without any suggestion says where there are some, if there are."""

from dataclasses import replace

import pytest

from logs.verdict.findings import make_finding
from logs.verdict.judge_geometry import judge_geometry
from logs.verdict.places import FLIGHT, Change, DecidingParameter, LevelAnswer, Place
from logs.verdict.verdict import Verdict
from planfly.terminal.verdict_lines import verdict_lines
from tests.logs.verdict.judging import ROUTE, judge
from tests.synthetic import fly_path, make_setup

FLOWN_TEXT = "no change was found with which a simulated flight would pass"
HINT = f"{FLOWN_TEXT}; planfly check --geometry suggests changes for the planned route"
FAILS = LevelAnswer("geometry", False, "not flyable")


def without_suggestions(verdict: Verdict) -> Verdict:
    return replace(verdict, findings=tuple(replace(finding, suggestions=()) for finding in verdict.findings))


def texts(verdict: Verdict, *, suggests: bool) -> list[str]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("planfly.terminal.verdict_lines.has_geometric_suggestion", lambda _setup: suggests)
        lines = verdict_lines(verdict, (), make_setup(ROUTE))
    return [text for line in lines for label in ("would pass: ", "no remedy: ") for text in line.split(label)[1:]]


@pytest.mark.parametrize(
    ("geometry", "suggests", "expected"),
    [
        (FAILS, True, [HINT]),
        (FAILS, False, [FLOWN_TEXT]),
        (LevelAnswer("geometry", False, "not judged", undecided=True), True, []),
        (LevelAnswer("geometry", True, "flyable"), True, []),
    ],
)
def test_the_hint_of_a_flight(geometry: LevelAnswer, suggests: bool, expected: list[str]) -> None:
    setup = make_setup(ROUTE, limits={"max_turn_deg": 60.0})
    verdict = judge(setup, fly_path(setup))
    assert any(finding.suggestions for finding in verdict.failed)
    assert not any(FLOWN_TEXT in text for text in texts(replace(verdict, levels=(FAILS,)), suggests=True))
    assert texts(replace(without_suggestions(verdict), levels=(geometry,)), suggests=suggests) == expected


def test_a_parameter_that_decides_is_a_remedy() -> None:
    setup = make_setup(ROUTE, limits={"max_turn_deg": 60.0})
    verdict = replace(without_suggestions(judge(setup, fly_path(setup))), levels=(FAILS,))
    finding = verdict.failed[0]
    deciding = DecidingParameter("NAV_ACC_RAD", 90.0, 40.0, "m", finding.rule, finding.place)
    assert texts(replace(verdict, deciding=deciding), suggests=False) == []


def test_a_verdict_by_geometry_refers_neither_to_flights_nor_to_itself() -> None:
    verdict = judge_geometry(make_setup(ROUTE, limits={"max_turn_deg": 60.0}))
    assert verdict.failed
    assert texts(without_suggestions(verdict), suggests=True) == ["no change was found with which it would pass"]


def test_a_suggestion_of_another_than_the_worst_finding_names_its_place() -> None:
    higher = ((Change("height", Place("leg", 5), None, 12.0, "m"),),)
    worst, other = (
        make_finding("clearance", Place("leg", leg), ok=False, reason="low", limit=30.0, margin=margin, at_least=True)
        for leg, margin in ((1, -80.0), (5, -11.0))
    )
    verdict = replace(judge_geometry(make_setup(ROUTE)), findings=(worst, replace(other, suggestions=higher)))
    assert texts(verdict, suggests=True) == ["at leg 5: raise both ends of leg 5 by 12 m"]
    verdict = replace(verdict, findings=(replace(worst, suggestions=higher), other))
    assert texts(verdict, suggests=True) == ["raise both ends of leg 5 by 12 m"]


def test_required_returns_that_fail_refer_to_their_own_suggestions() -> None:
    unsafe = make_finding("return", FLIGHT, ok=False, reason="3 returns hit the ground", source="scenario")
    verdict = replace(judge_geometry(make_setup(ROUTE)), findings=(unsafe,))
    hint = "would help: planfly returns --suggest looks for a remedy"
    assert any(line.endswith(hint) for line in verdict_lines(verdict, ()))
    assert texts(verdict, suggests=True) == []
    own_end = replace(unsafe, place=Place("waypoint", 4), limit_source="none")
    verdict = replace(verdict, findings=(own_end,))
    assert not any(line.endswith(hint) for line in verdict_lines(verdict, ()))
    # The reason of the return after the last item says what prevents it.
    assert texts(verdict, suggests=True) == []
    high = make_finding("clearance", Place("leg", 1), ok=False, reason="low")
    assert texts(replace(verdict, findings=(high, own_end)), suggests=True) == [
        "no change was found with which it would pass"
    ]
