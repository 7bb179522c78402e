"""Define a verdict in the order in which it is shown: findings by rule, failed findings first, undecided findings.

Terminal, report page, notebook, studio and JUnit read a `Presentation`, which `logs.verdict.verdict.Verdict.present`
makes.  A presentation holds data; `logs.verdict.wording` phrases places and suggestions.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from logs.verdict.findings import Finding, closest_to_limit, undecided_findings
from logs.verdict.rule_words import FRONT_OVERLAP, RULE_WORDS, SIDE_OVERLAP, Margin, RuleWords

# Words of the overlap of a survey's photos, which is shown apart from the photo lines: it is no share of a line.
_OVERLAP_WORDS = replace(
    RULE_WORDS["survey"],
    title="photo overlap",
    noun="photo overlap",
    question="Do the photos of a survey overlap as required?",
    margin=Margin("overlap", "%", 5.0),
)


@dataclass(frozen=True, slots=True)
class RuleFindings:
    """Findings of one rule, or of one part of a rule, in the verdict's order."""

    words: RuleWords
    findings: tuple[Finding, ...]

    @property
    def failed(self) -> tuple[Finding, ...]:
        """Failed findings, the worst first."""
        return tuple(
            sorted(
                (finding for finding in self.findings if finding.ok is False), key=lambda finding: finding.margin or 0.0
            )
        )

    @property
    def judged(self) -> int:
        """Number of findings that were judged."""
        return sum(finding.ok is not None for finding in self.findings)

    @property
    def closest(self) -> Finding | None:
        """The failed finding that is furthest beyond its limit, or else the finding closest to its limit."""
        return closest_to_limit(self.findings)

    @property
    def passed_otherwise(self) -> tuple[Finding, ...]:
        """Findings that pass although their number is beyond the limit; each states why."""
        return tuple(
            finding
            for finding in self.findings
            if finding.ok and finding.margin is None and None not in (finding.value, finding.limit)
        )

    @property
    def count_text(self) -> str:
        """Text such as "3 of 4 ok": the number of passed findings, and the number of judged findings."""
        return f"{self.judged - len(self.failed)} of {self.judged} ok" if self.judged else "not judged"


@dataclass(frozen=True, slots=True, kw_only=True)
class Presentation:
    """Verdict as it is shown to readers.

    headline: the answer in one line.
    details: the other lines of the summary.
    state: "ok", "open" (nothing failed, and a part was not judged) or "fail".
    findings: all findings, in the verdict's order.
    rules: the findings by rule, in the order of `RULE_WORDS`.
    zones: number of airspace zones that apply to the verdict.
    """

    headline: str
    details: tuple[str, ...]
    state: str
    findings: tuple[Finding, ...]
    rules: tuple[RuleFindings, ...]
    zones: int

    @property
    def failed_rules(self) -> tuple[RuleFindings, ...]:
        """The rules with failed findings, the most urgent first, as in the headline."""
        failed = [rule for rule in self.rules if rule.failed]
        return tuple(sorted(failed, key=lambda rule: -rule.words.urgency))

    @property
    def undecided(self) -> tuple[Finding, ...]:
        """The findings that leave the verdict undecided."""
        return undecided_findings(self.findings)

    def findings_to_list(self, max_failed_and_undecided: int) -> list[tuple[int, Finding]]:
        """Return the findings to show in a short list, each with its index in `findings`.

        These are failed and undecided findings, then for each rule the passed finding closest to its limit.

        max_failed_and_undecided: maximum number of failed and undecided findings.
        """
        undecided = {id(finding) for finding in self.undecided}
        closest = {id(rule.closest) for rule in self.rules}
        numbered = list(enumerate(self.findings))
        listed_findings = [(k, finding) for k, finding in numbered if finding.ok is False or id(finding) in undecided]
        closest_findings = [(k, finding) for k, finding in numbered if finding.ok is True and id(finding) in closest]
        return [*listed_findings[:max_failed_and_undecided], *closest_findings]


def findings_by_rule(findings: Sequence[Finding]) -> tuple[RuleFindings, ...]:
    """Group findings by rule in the order of `RULE_WORDS`; a rule without findings is left out.

    >>> from logs.verdict.findings import make_finding
    >>> from logs.verdict.places import Place
    >>> beyond = {0: 2.0, 1: 5.0}
    >>> slopes = [make_finding("slope", Place("leg", k), ok=False, reason="", margin=-m) for k, m in beyond.items()]
    >>> [[finding.place.index for finding in rule.failed] for rule in findings_by_rule(slopes)]
    [[1, 0]]
    """
    grouped: dict[str, list[Finding]] = {name: [] for name in RULE_WORDS}
    overlaps: list[Finding] = []
    for finding in findings:
        is_overlap = finding.rule == _OVERLAP_WORDS.name and finding.check in (FRONT_OVERLAP, SIDE_OVERLAP)
        (overlaps if is_overlap else grouped[finding.rule]).append(finding)
    rules = []
    for name, group in grouped.items():
        rules.append(RuleFindings(RULE_WORDS[name], tuple(group)))
        if name == _OVERLAP_WORDS.name:
            rules.append(RuleFindings(_OVERLAP_WORDS, tuple(overlaps)))
    return tuple(rule for rule in rules if rule.findings)
