"""Define the verdict: the findings, whether the plan is flyable, and whether it was flown to its end."""

import json
from dataclasses import asdict, dataclass
from typing import Any

from flight.autopilots.autopilot import AutopilotProgram, Parameters
from logs.verdict.conditions import Conditions
from logs.verdict.document import (
    SCHEMA,
    VerdictDocument,
    deciding_document,
    finding_document,
    level_document,
    parameters_document,
)
from logs.verdict.findings import APART_FROM_FLIGHT, Finding, State, closest_to_limit, undecided_findings
from logs.verdict.junit import JunitSuite, suites_text, verdict_suite
from logs.verdict.places import DecidingParameter, LevelAnswer
from logs.verdict.presentation import (
    RESULT_COLUMNS,
    STATE_SIGNS,
    FindingRow,
    RuleFindings,
    findings_by_rule,
)
from logs.verdict.wording import strip_prefix
from world.extras import require_extra
from world.html_table import html_table
from world.wording import count_text


@dataclass(frozen=True, slots=True, repr=False)
class Verdict:
    """Answer to the question whether a plan can really be flown, with a finding for every rule and place.

    findings: findings of all rules, in the order in which they are listed.
    flyable: True if the verdict is complete and no finding failed.
    complete: True if the plan was feasible, flown to its end, and recorded in full; at the geometric level, True unless
    planfly made the plan and found none that is feasible.
    lines: the summary for a person; its first line, the headline, answers the question.
    level: "flown", "geometric" (from the envelope, without a flight) or "plan" (no feasible plan, so nothing was
    flown).
    levels: the answers of the judged levels, geometry first, the verdict's own answer last; empty for a plan that was
    not flown.
    deciding: the autopilot parameter that decides, if the airframe passes and the flight fails because of one
    parameter.
    notes: items that are not flown as the mission states them; the lines name them, too.
    leg_ends: times (s) at which the flight passed each waypoint between the first and the last, inf from the first
    waypoint that it did not reach; empty if too little was recorded.
    program: the SITL program that flew, or None.
    parameters: the parameters of the autopilot that flew, or None.
    unjudged: text on the part that was not judged, because of which the verdict is undecided although nothing failed,
    such as mission items that are missing in an imported log, or slopes near the limit of an uncertain aircraft; "" if
    there is none.
    imported: True for a flight logged by another program; its answer is "flown as planned" or "not flown as planned".
    conditions: aircraft, speed, weather, navigation, autopilot and ground of the verdict; the lines name them, too.

    >>> verdict = Verdict((), flyable=True, complete=True, lines=("flyable", "Start: not stated"), level="flown")
    >>> verdict.headline, verdict.summary.count("Start")
    ('flyable', 1)
    >>> verdict
    <Verdict flown: flyable; 0 findings, 0 failed>
    """

    findings: tuple[Finding, ...]
    flyable: bool
    complete: bool
    lines: tuple[str, ...]
    level: str
    levels: tuple[LevelAnswer, ...] = ()
    deciding: DecidingParameter | None = None
    notes: tuple[str, ...] = ()
    leg_ends: tuple[float, ...] = ()
    program: AutopilotProgram | None = None
    parameters: Parameters | None = None
    unjudged: str = ""
    imported: bool = False
    conditions: Conditions | None = None

    @property
    def answer(self) -> str:
        """Answer in a few words: "flyable", "not flyable" or "not judged in full".

        For an imported flight, they are "flown as planned", "not flown as planned" or "not judged in full".

        >>> Verdict((), flyable=False, complete=True, lines=(), level="flown", imported=True).answer
        'not flown as planned'
        """
        if self.undecided:
            return "not judged in full"
        success = "flown as planned" if self.imported else "flyable"
        return success if self.flyable else f"not {success}"

    @property
    def state(self) -> State:
        """Answer as a key for colors: "ok", "open" (nothing failed, but a part was not judged) or "fail"."""
        return "ok" if self.flyable else "open" if self.undecided else "fail"

    @property
    def undecided(self) -> bool:
        """True if nothing failed, but a part of the mission was not judged."""
        return bool(self.unjudged) and not self.failed

    @property
    def flies(self) -> bool:
        """True if the verdict is flyable, or if only checks that a flight cannot decide are open.

        The flight must then be complete.

        These checks are `APART_FROM_FLIGHT`: paths from and to the ground, returns to launch and glides, and the common
        area of photos.

        >>> from dataclasses import replace
        >>> from logs.verdict.findings import GROUND_PATH, make_finding
        >>> from logs.verdict.places import Place
        >>> open_way = make_finding("climbout", Place("waypoint", 0), ok=None, reason="", check=GROUND_PATH)
        >>> verdict = Verdict((open_way,), flyable=False, complete=True, lines=(), level="flown", unjudged="a way")
        >>> verdict.flies, replace(verdict, complete=False).flies
        (True, False)
        """
        is_apart_from_flight = all(finding.check in APART_FROM_FLIGHT for finding in undecided_findings(self.findings))
        return self.flyable or (self.complete and self.undecided and is_apart_from_flight)

    @property
    def headline(self) -> str:
        """Answer in one line."""
        return self.lines[0] if self.lines else ""

    @property
    def summary(self) -> str:
        """All lines as one text."""
        return "\n".join(self.lines)

    @property
    def failed(self) -> tuple[Finding, ...]:
        """Failed findings."""
        return tuple(finding for finding in self.findings if finding.ok is False)

    @property
    def closest(self) -> dict[str, Finding]:
        """Failed finding furthest beyond its limit, or else the finding closest to its limit, by rule.

        Rules without a finding that failed or was judged by a number are left out.

        >>> from logs.verdict.findings import make_finding
        >>> from logs.verdict.places import Place
        >>> near, far = (make_finding("slope", Place("leg", 1), ok=True, reason="", margin=m) for m in (4.0, 9.0))
        >>> verdict = Verdict((far, near), flyable=True, complete=True, lines=(), level="flown")
        >>> verdict.closest["slope"].margin
        4.0
        """
        rules = dict.fromkeys(finding.rule for finding in self.findings)
        closest = {
            rule: closest_to_limit([finding for finding in self.findings if finding.rule == rule]) for rule in rules
        }
        return {name: finding for name, finding in closest.items() if finding is not None}

    def to_pandas(self) -> Any:
        """Return a `pandas.DataFrame` with a row for each finding, and NaN for missing numbers.

        Columns: rule, place and index (of the leg, turn or threat), then as in `Finding`: planned, flown, limit,
        tolerance, margin, unit, limit_source, method, ok (None if not judged) and reason; and nearest, the distance
        outside the nearest missile's sphere or the nearest zone of a fence, m, negative inside.
        Raises `planfly.MissingExtraError`, which is an ImportError, without the extra ``planfly[tables]``.
        """
        require_extra("tables", "to_pandas() needs")
        # Imported here: pandas is an extra.
        import pandas as pd

        numbers = ("planned", "flown", "limit", "tolerance", "margin")
        names = (*numbers, "unit", "limit_source", "method", "ok", "reason")
        rows = [
            [
                *(finding.rule, finding.place.kind, finding.place.index),
                *(getattr(finding, name) for name in names),
                finding.nearest_distance,
            ]
            for finding in self.findings
        ]
        frame = pd.DataFrame(rows, columns=["rule", "place", "index", *names, "nearest"])
        return frame.astype(dict.fromkeys((*numbers, "nearest"), float))

    def __repr__(self) -> str:
        counts = f"{count_text(len(self.findings), 'finding')}, {len(self.failed)} failed"
        return f"<Verdict {self.level}: {self.answer}; {counts}>"

    def document(self) -> VerdictDocument:
        """Return the content of ``verdict.json``: the verdict with its places and suggestions in words."""
        return VerdictDocument(
            schema=SCHEMA,
            level=self.level,
            flyable=self.flyable,
            complete=self.complete,
            answer=self.answer,
            undecided=self.undecided,
            summary=self.summary,
            conditions=self.conditions,
            flown_by=self.program,
            parameters=None if self.parameters is None else parameters_document(self.parameters),
            levels=tuple(map(level_document, self.levels)),
            deciding_parameter=None if self.deciding is None else deciding_document(self.deciding),
            findings=tuple(map(finding_document, self.findings)),
        )

    @property
    def details(self) -> tuple[str, ...]:
        """Lines of the summary without the headline."""
        return self.lines[1:]

    @property
    def rules(self) -> tuple[RuleFindings, ...]:
        """Findings by rule, in the order of `logs.verdict.rule_words.RULE_WORDS`."""
        return findings_by_rule(self.findings)

    @property
    def is_only_incomplete(self) -> bool:
        """True if the only thing that failed is the completion of the flight."""
        is_flight = self.state == "fail" and self.level != "plan" and not self.complete
        return is_flight and all(finding.rule == "completion" for finding in self.failed)

    @property
    def title(self) -> str:
        """Answer as a title, with the level or the incompleteness of the flight."""
        answer = self.answer.capitalize()
        if self.state == "ok":
            return answer + ("" if self.level == "flown" else " on paper, not flown")
        if self.level == "plan":
            return f"{answer}: no feasible plan"
        if self.is_only_incomplete:
            return f"Incomplete, so {self.answer}"
        return answer + ("" if self.complete or self.state == "open" else ", and incomplete")

    @property
    def sign(self) -> str:
        """Sign of the state, or "!" if the only thing that failed is the completion of the flight."""
        return "!" if self.is_only_incomplete else STATE_SIGNS[self.state]

    @property
    def reasons(self) -> str:
        """Headline without the title or the answer at its beginning."""
        return strip_prefix(self.headline, (self.title, self.answer))

    @property
    def failed_rules(self) -> tuple[RuleFindings, ...]:
        """The rules with failed findings, the most urgent first, as in the headline."""
        failed = [rule for rule in self.rules if rule.failed]
        return tuple(sorted(failed, key=lambda rule: -rule.words.urgency))

    @property
    def undecided_findings(self) -> tuple[Finding, ...]:
        """The findings that leave the verdict undecided."""
        return undecided_findings(self.findings)

    def remedy_text(self, finding: Finding) -> str:
        """Return alternative changes of the plan, as text, that would make a failed finding pass.

        The deciding parameter is named at the finding that it decides.  Return "" if no change is known.
        """
        if finding.state != "fail":
            return ""
        parts, deciding = [finding.suggestion] if finding.suggestions else [], self.deciding
        if deciding is not None and (deciding.rule, deciding.place) == (finding.rule, finding.place):
            unit = f"\u00a0{deciding.unit}" if deciding.unit else ""
            values_text = f"{deciding.name} {deciding.passing:g}{unit} instead of {deciding.current:g}"
            parts.append(f"the plan as it is, with {values_text}")
        return "; ".join(parts)

    def row(self, finding: Finding) -> FindingRow:
        """Return a finding with its texts, including its remedy."""
        return FindingRow(finding, self.remedy_text(finding))

    @property
    def first_remedied(self) -> Finding | None:
        """First failed finding with a remedy; a finding on ground contact comes before all others.

        None if no failed finding has a remedy.
        """
        worst_findings = [rule.failed[0] for rule in self.failed_rules]
        # A ground contact comes first, because it ended the flight.  The sort keeps the order of the others.
        worst_findings.sort(
            key=lambda finding: finding.rule != "clearance" or finding.flown is None or finding.flown > 0.0
        )
        return next((finding for finding in worst_findings if self.remedy_text(finding)), None)

    def findings_to_list(self, max_failed_and_undecided: int) -> list[tuple[int, Finding]]:
        """Return the findings for a short list, each with its index in `findings`.

        They are the failed and undecided findings, and then, for each rule whose closest finding passed, that finding.

        max_failed_and_undecided: maximum number of failed and undecided findings in the list.
        """
        undecided = {id(finding) for finding in self.undecided_findings}
        closest = {id(rule.closest) for rule in self.rules}
        numbered = list(enumerate(self.findings))
        listed_findings = [(k, finding) for k, finding in numbered if finding.ok is False or id(finding) in undecided]
        closest_findings = [(k, finding) for k, finding in numbered if finding.ok is True and id(finding) in closest]
        return [*listed_findings[:max_failed_and_undecided], *closest_findings]

    def junit_suite(self, name: str) -> JunitSuite:
        """Return the verdict as a JUnit test suite.

        name: name of the judged plan or flight.
        """
        return verdict_suite(name, self.lines, map(self.row, self.findings), passes=self.flyable)

    def to_junit(self, name: str) -> str:
        """Return the verdict as JUnit XML for continuous integration.

        name: name of the judged plan or flight.
        """
        return suites_text([self.junit_suite(name)])

    def _repr_html_(self) -> str:
        """Return the verdict as a table for a notebook.

        It has a row for each failed finding, and for each rule that passes.
        """
        rows: list[tuple[str, ...]] = []
        for rule in self.rules:
            word, state, tally, *_ = rule.cells
            rows += [
                (word, state, tally, row.finding.where, *row.numbers, row.finding.reason, row.remedy)
                for row in map(self.row, rule.failed)
            ] or [(*rule.cells, "", "")]
        return html_table(self.headline, rows, (*RESULT_COLUMNS, "reason", "would pass"))


def verdict_json(verdict: Verdict) -> str:
    """Return the verdict as the text of a ``verdict.json``.

    >>> from logs.verdict.findings import make_finding
    >>> from logs.verdict.places import Place
    >>> finding = make_finding("turn", Place("waypoint", 1, item=2), ok=True, reason="turns 30.0°", planned=30.0)
    >>> written = json.loads(verdict_json(Verdict((finding,), True, True, ("flyable",), "flown")))
    >>> written["schema"], written["summary"], written["findings"][0]["where"], written["findings"][0]["place"]["index"]
    ('planfly.verdict/3', 'flyable', 'waypoint 1 (item 2)', 1)
    """
    return json.dumps(asdict(verdict.document()), indent=1, allow_nan=False) + "\n"
