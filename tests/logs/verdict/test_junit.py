"""JUnit XML of a verdict: counted, named once each, and read by a parser whatever a reason holds."""

from xml.etree import ElementTree

import pytest

from logs.verdict.findings import Finding, make_finding
from logs.verdict.junit import suites_text
from logs.verdict.places import FLIGHT, Place
from logs.verdict.verdict import Verdict


def verdict(*findings: Finding, flyable: bool, line: str) -> Verdict:
    return Verdict(findings, flyable=flyable, complete=True, lines=(line, "Start: in the air"), level="flown")


def text_of(verdicts: dict[str, Verdict]) -> str:
    return suites_text(verdict.junit_suite(name) for name, verdict in verdicts.items())


def cases(text: str) -> dict[tuple[str, str], ElementTree.Element]:
    root = ElementTree.fromstring(text)
    suite = root[0]
    found = {(case.get("classname", ""), case.get("name", "")): case for case in suite.iter("testcase")}
    assert suite.get("tests") == str(len(found))
    for kind, key in (("failure", "failures"), ("skipped", "skipped")):
        assert suite.get(key) == str(len(list(suite.iter(kind))))
    return found


def test_each_finding_is_a_case_and_the_answer_one_more() -> None:
    leg = Place("leg", 1, to_item=3)
    found = (
        make_finding("slope", leg, ok=False, reason='climbs at 9° & more than <8°> on "leg"\x1b[2J', margin=-1.0),
        make_finding("slope", leg, ok=True, reason=""),
        make_finding("clearance", FLIGHT, ok=None, reason="no terrain"),
    )
    made = cases(text_of({"a & b.waypoints": verdict(*found, flyable=False, line="not flyable: slope")}))
    assert len(made) == 4
    failed, passed, unknown, answer = (
        made["planfly.a & b_waypoints.slope", "leg 1 (to item 3)"],
        made["planfly.a & b_waypoints.slope", "leg 1 (to item 3) (2)"],
        made["planfly.a & b_waypoints.clearance", "flight"],
        made["planfly.a & b_waypoints", "verdict"],
    )
    assert failed[0].get("message") == 'slope: climbs at 9° & more than <8°> on "leg" [2J'
    assert len(passed) == 0
    assert (unknown[0].tag, unknown[0].get("message")) == ("skipped", "not judged: no terrain")
    assert answer[0].get("message") == "not flyable: slope"


def test_a_failure_has_the_words_of_the_terminal_and_its_class_those_of_data() -> None:
    lost = make_finding("departure", FLIGHT, ok=False, reason="bank 80° at 3.0 s")
    made = cases(text_of({"m": verdict(lost, flyable=False, line="no")}))
    assert made["planfly.m.departure", "flight"][0].get("message") == "loss of control: bank 80° at 3.0 s"


@pytest.mark.parametrize(("flyable", "failures"), [(True, 0), (False, 1)])
def test_what_was_not_judged_in_full_is_no_success(flyable: bool, failures: int) -> None:
    """Nothing failed, but slopes are too close to the limit to judge: exit code 3, and no green case."""
    text = text_of({"m": verdict(flyable=flyable, line="not judged in full: slopes")})
    assert len(list(ElementTree.fromstring(text).iter("failure"))) == failures


def test_each_of_several_verdicts_is_a_suite() -> None:
    text = text_of({"m by a": verdict(flyable=True, line="flyable"), "m by b": verdict(flyable=False, line="no")})
    suites = {suite.get("name"): suite.get("failures") for suite in ElementTree.fromstring(text)}
    assert suites == {"m by a": "0", "m by b": "1"}


def test_cases_of_two_missions_have_different_classes() -> None:
    made = verdict(make_finding("slope", FLIGHT, ok=True, reason=""), flyable=True, line="flyable")
    root = ElementTree.fromstring(text_of({"north/a.plan": made, "south/a.plan": made}))
    assert [case.get("classname") for case in root.iter("testcase")] == [
        "planfly.north/a_plan",
        "planfly.north/a_plan.slope",
        "planfly.south/a_plan",
        "planfly.south/a_plan.slope",
    ]
