"""Several autopilots' verdicts on one mission, as a table."""

from logs.verdict.findings import Finding, make_finding
from logs.verdict.places import Place
from logs.verdict.verdict import Verdict
from planfly.terminal.verdict_lines import autopilot_lines


def of(rule: str, leg: int, ok: bool | None) -> Finding:
    return make_finding(rule, Place("leg", leg), ok=ok, reason="r")


def test_each_rule_has_a_row_and_each_autopilot_a_column() -> None:
    good = (of("corridor", 0, True), of("corridor", 1, True), of("clearance", 0, None))
    bad = (of("corridor", 0, True), of("corridor", 1, False))
    flies = Verdict(good, flyable=False, complete=True, lines=("in part",), level="flown", unjudged="terrain")
    fails = Verdict(bad, flyable=False, complete=True, lines=("not flyable", "105 would pass"), level="flown")
    assert autopilot_lines({"ardupilot": flies, "px4-1.17": fails}) == [
        "             ardupilot           px4-1.17",
        "  verdict    not judged in full  not flyable",
        "  clearance  1 not judged",
        "  corridor   2 ok                1 of 2 fail",
        "ardupilot: in part",
        "px4-1.17: not flyable; 105 would pass",
    ]


def test_photo_lines_and_their_overlap_have_a_row_each() -> None:
    """Both are findings of the rule "survey"."""
    overlap = make_finding("survey", Place("flight"), ok=True, reason="r", check="side overlap")
    verdict = Verdict((of("survey", 0, False), overlap), False, True, ("not flyable",), "flown")
    rows = autopilot_lines({"px4": verdict})
    assert rows[2:4] == ["  photo lines    1 of 1 fail", "  photo overlap  1 ok"]
