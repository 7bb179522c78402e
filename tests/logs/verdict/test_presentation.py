"""A verdict in the order in which it is shown, the same for terminal, report page, notebook, studio and JUnit."""

from xml.etree import ElementTree

from logs.verdict.findings import UNKNOWN_AIRCRAFT, Finding, make_finding
from logs.verdict.places import FLIGHT, Place
from logs.verdict.presentation import finding_heading, findings_by_rule
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.rules.registry import RULES
from logs.verdict.verdict import Verdict
from planfly.studio.view_model import findings_json
from planfly.terminal.verdict_lines import verdict_lines


def leg(
    index: int, *, ok: bool | None, margin: float | None = None, rule: str = "clearance", check: str = ""
) -> Finding:
    reason = f"{rule} on leg {index}"
    return make_finding(rule, Place("leg", index), ok=ok, reason=reason, margin=margin, limit=60.0, check=check)


# In the order of the rules: slope comes before clearance, and speed after it.
FINDINGS = (
    leg(0, ok=None, rule="slope", check=UNKNOWN_AIRCRAFT),
    leg(1, ok=False, rule="slope", margin=-1.0),
    leg(0, ok=False, margin=-2.0),
    leg(1, ok=False, margin=-8.0),
    leg(2, ok=True, margin=5.0),
    leg(0, ok=True, margin=9.0, rule="speed"),
    leg(1, ok=True, margin=3.0, rule="speed"),
    make_finding("completion", FLIGHT, ok=False, reason="ended early"),
)
VERDICT = Verdict(FINDINGS, flyable=False, complete=False, lines=("not flyable", "Start: in the air"), level="flown")

STATES = ((None, ""), (True, ""), (None, UNKNOWN_AIRCRAFT), (False, ""))


def test_every_rule_has_words_and_a_judge() -> None:
    assert list(RULES) == list(RULE_WORDS)
    assert {name: rule.name for name, rule in RULES.items()} == {name: name for name in RULE_WORDS}


def test_findings_stand_by_rule_in_the_order_of_the_rules() -> None:
    shown = findings_by_rule(FINDINGS[::-1])
    assert [rule.words.name for rule in shown] == ["slope", "clearance", "speed", "completion"]
    assert [rule.count_text for rule in shown] == ["0 of 1 ok", "1 of 3 ok", "2 of 2 ok", "0 of 1 ok"]


def test_what_ends_a_flight_is_named_first_and_of_a_rule_the_worst() -> None:
    failed = VERDICT.failed_rules
    # Urgencies: completion 3, slope 1, clearance 0.
    assert [rule.words.name for rule in failed] == ["completion", "slope", "clearance"]
    assert [finding.place.index for finding in failed[-1].failed] == [1, 0]


def test_the_list_has_what_failed_or_is_open_and_then_the_closest_of_each_other_rule() -> None:
    assert [number for number, _ in VERDICT.findings_to_list(60)] == [0, 1, 2, 3, 7, 6]
    # Of many failures as many as are asked for; a rule whose worst failure is left out has no other finding.
    assert [number for number, _ in VERDICT.findings_to_list(2)] == [0, 1, 6]


def test_the_state_is_open_where_nothing_failed_and_a_part_was_not_judged() -> None:
    def state(flyable: bool, unjudged: str, findings: tuple[Finding, ...] = ()) -> str:
        return Verdict(findings, flyable=flyable, complete=True, lines=("a",), level="flown", unjudged=unjudged).state

    assert state(True, "") == "ok"
    assert state(False, "slopes") == "open"
    assert state(False, "slopes", FINDINGS) == "fail"


def test_every_rendering_shows_the_same_failures_in_the_same_order() -> None:
    """Clearance: the worst on leg 1, then leg 0; one of three passes."""
    lines = verdict_lines(VERDICT, [])
    failing = [line.split()[1] for line in lines if "  failed  " in line]
    assert failing == ["completion:", "slope", "clearance:"]
    assert "1 of 3 ok" in next(line for line in lines if line.startswith("  clearance"))
    page = ElementTree.fromstring(VERDICT._repr_html_())
    cells = [[cell.text or "" for cell in row] for row in page.find("table/tbody") or ()]
    assert [row[:4] for row in cells[:4]] == [
        ["slope", "✗ fails", "1 of 1 fail, 1 not judged", "leg 1"],
        ["clearance", "✗ fails", "2 of 3 fail", "leg 1"],
        ["clearance", "✗ fails", "2 of 3 fail", "leg 0"],
        ["speed", "✓ ok", "2 ok", "leg 1"],
    ]
    listed = [(row["number"], row["ok"]) for row in findings_json(VERDICT, ()) if row["place"]["kind"] == "leg"]
    assert listed == [(0, None), (1, False), (2, False), (3, False), (6, True)]
    suite = ElementTree.fromstring(VERDICT.to_junit("m"))[0]
    # Four findings failed, and the verdict.
    assert suite.get("failures") == "5"
    assert suite.get("skipped") == "1"


def test_a_place_is_shown_with_the_value_that_fails_or_else_with_the_reason() -> None:
    """12.34 m to three significant figures; a value within its limit fails for another reason."""
    low = make_finding("clearance", Place("leg", 4), ok=False, reason="low", flown=12.34, limit=60.0, margin=-47.66)
    slow = make_finding("speed", Place("leg", 2), ok=False, reason="too slow", flown=16.5, limit=16.0, margin=0.5)
    assert (low.place_and_value, slow.place_and_value) == ("leg 4: 12.3", "leg 2: too slow")


def test_states_of_findings_and_of_their_rule() -> None:
    slopes = [leg(0, ok=ok, rule="slope", check=check) for ok, check in STATES]
    assert [finding.state for finding in slopes] == ["unjudged", "ok", "open", "fail"]
    # The worst state of a rule decides: of one finding, of the first two, of the first three, of all.
    assert [findings_by_rule(slopes[:k])[0].state for k in (1, 2, 3, 4)] == ["unjudged", "ok", "open", "fail"]
    assert [findings_by_rule(slopes[:k])[0].tally_text for k in (1, 2, 4)] == [
        "1 not judged",
        "1 ok, 1 not judged",
        "1 of 2 fail, 2 not judged",
    ]


def test_the_reasons_are_the_headline_without_its_answer() -> None:
    def shown(headline: str, *, complete: bool = True, level: str = "flown") -> tuple[str, str, str]:
        verdict = Verdict(FINDINGS, flyable=False, complete=complete, lines=(headline,), level=level)
        return verdict.title, verdict.sign, verdict.reasons

    assert shown("not flyable: slope on leg 1") == ("Not flyable", "✗", "slope on leg 1")
    assert shown("not flyable: slope", complete=False) == ("Not flyable, and incomplete", "✗", "slope")
    none = ("Not flyable: no feasible plan", "✗", "slope")
    assert shown("not flyable: no feasible plan: slope", complete=False, level="plan") == none


def test_a_fence_item_is_named_once_in_every_output() -> None:
    item = make_finding("fence", Place("exclusion", 0, name="fence item 0"), ok=False, reason="5 m inside")
    verdict = Verdict((item,), flyable=False, complete=True, lines=("not flyable",), level="flown")
    assert finding_heading(item) == "fence item 0 (exclusion)"
    assert "  failed  fence item 0 (exclusion): 5 m inside" in verdict_lines(verdict, [])


def test_the_overlap_of_photos_is_shown_apart_from_the_photo_lines() -> None:
    """16 lines, of which one fails, and two overlaps of -23 % and 70 %: no share of a line is below 0."""
    lines = [
        make_finding(
            "survey", Place("leg", k), ok=k > 0, reason="", margin=k - 0.5, flown=94.5 + k, limit=95.0, unit="%"
        )
        for k in range(16)
    ]
    overlaps = [
        make_finding(
            "survey", Place("leg", k), ok=flown > 0.0, reason="", margin=flown, flown=flown, unit="%", check=check
        )
        for k, (check, flown) in enumerate((("side overlap", -23.0), ("front overlap", 70.0)))
    ]
    of_lines, of_overlap = findings_by_rule([*lines, *overlaps])
    assert (of_lines.words.title, of_lines.count_text) == ("photo lines", "15 of 16 ok")
    assert (of_overlap.words.title, of_overlap.count_text) == ("photo overlap", "1 of 2 ok")
    assert of_overlap.words.margin is not None
    assert of_overlap.words.margin.quantity == "overlap"
    assert of_lines.closest is lines[0]
    assert of_overlap.closest is overlaps[0]
