"""A verdict on a terminal's one line, and as a notebook shows it."""

from dataclasses import replace
from xml.etree import ElementTree

from logs.verdict.findings import Verdict, make_finding
from logs.verdict.notebooks.verdict_table import verdict_html
from logs.verdict.places import Change, Place

TURN = Place("waypoint", 1)
FAILS = make_finding("turn", TURN, ok=False, reason="turns 90° <of 60°>", planned=90.0, limit=60.0)
PASSES = make_finding("turn", Place("waypoint", 2), ok=True, reason="turns 10°")
UNKNOWN = make_finding("clearance", Place("leg", 0), ok=None, reason="no terrain")
VERDICT = Verdict((FAILS, PASSES, UNKNOWN), flyable=False, complete=True, lines=("not flyable: turn",), level="flown")


def test_a_verdict_prints_in_a_line_whatever_it_holds() -> None:
    assert repr(VERDICT) == "<Verdict flown: not flyable; 3 findings, 1 failed>"
    many = Verdict((PASSES,) * 500, flyable=True, complete=True, lines=("flyable",), level="geometric")
    assert repr(many) == "<Verdict geometric: flyable; 500 findings, 0 failed>"
    cut = Verdict((PASSES,), flyable=False, complete=False, lines=(), level="flown")
    assert repr(cut) == "<Verdict flown: incomplete; 1 findings, 0 failed>"


def test_a_notebook_shows_each_rule_and_what_fails_of_it() -> None:
    page = ElementTree.fromstring(VERDICT._repr_html_())
    rows = [[cell.text or "" for cell in row] for row in page.find("table/tbody") or ()]
    assert rows == [
        ["turns", "1 of 2 ok", "", ""],
        ["", "waypoint 1", "turns 90° <of 60°>", ""],
        ["clearance", "not judged", "", ""],
    ]
    assert page.findtext("strong") == "not flyable: turn"


def test_what_would_pass_stands_beside_what_fails() -> None:
    change = Change("turn", TURN, 90.0, 60.0, "deg")
    failing = make_finding("turn", TURN, ok=False, reason="too far")
    mended = replace(failing, suggestions=((change,),))
    text = verdict_html(Verdict((mended,), flyable=False, complete=True, lines=("no",), level="flown"))
    assert "turn at most 60.0° there" in text


def test_the_failed_findings_are_at_hand() -> None:
    assert VERDICT.failed == (FAILS,)
