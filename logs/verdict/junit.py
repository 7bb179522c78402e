"""Write verdicts as JUnit XML for continuous integration, with a test case for each finding and for the answer."""

from collections import Counter
from collections.abc import Mapping
from xml.etree import ElementTree

from logs.verdict.findings import Finding
from logs.verdict.presentation import Presentation
from logs.verdict.rule_words import rule_word


def junit_text(verdicts: Mapping[str, Presentation]) -> str:
    """Return the text of a JUnit file with a test suite for each verdict.

    verdicts: verdicts by name of the judged plan or flight.

    A failed finding is a failure, and an unjudged finding is skipped.  The test case ``verdict`` fails if the answer is
    not "flyable", also if nothing failed but a part was not judged.

    `logs.verdict.verdict.Verdict.to_junit` writes one verdict.
    """
    root = ElementTree.Element("testsuites")
    for name, verdict in verdicts.items():
        cases = [_answer_case(verdict), *_finding_cases(verdict.findings)]
        counts = Counter(child.tag for case in cases for child in case)
        suite = ElementTree.SubElement(
            root,
            "testsuite",
            name=_without_control_characters(name),
            tests=str(len(cases)),
            failures=str(counts["failure"]),
            errors="0",
            skipped=str(counts["skipped"]),
        )
        suite.extend(cases)
        ElementTree.SubElement(suite, "system-out").text = _without_control_characters(
            "\n".join([verdict.headline, *verdict.details]), keep="\n"
        )
    return _document_text(root)


def junit_error_text(name: str, message: str) -> str:
    """Return the text of a JUnit file for a plan or a flight that could not be judged: one test case, an error.

    name: name of the plan or flight.
    message: reason in one line.
    """
    root = ElementTree.Element("testsuites")
    suite = ElementTree.SubElement(
        root, "testsuite", name=_without_control_characters(name), tests="1", failures="0", errors="1", skipped="0"
    )
    case = ElementTree.SubElement(suite, "testcase", classname="planfly", name="verdict")
    ElementTree.SubElement(case, "error", message=_without_control_characters(message))
    return _document_text(root)


def _document_text(root: ElementTree.Element) -> str:
    """Return the indented XML text of a document."""
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _answer_case(verdict: Presentation) -> ElementTree.Element:
    """Make the test case of the verdict's answer, which fails if the answer is not "flyable"."""
    case = ElementTree.Element("testcase", classname="planfly", name="verdict")
    if verdict.state != "ok":
        ElementTree.SubElement(case, "failure", message=_without_control_characters(verdict.headline))
    return case


def _finding_cases(findings: tuple[Finding, ...]) -> list[ElementTree.Element]:
    """Make a test case with a unique name for each finding: failed, skipped if it was not judged, or passed."""
    counts: Counter[tuple[str, str]] = Counter()
    cases = []
    for finding in findings:
        place = _without_control_characters(finding.where)
        counts[finding.rule, place] += 1
        # Names of cases must be unique.
        number = counts[finding.rule, place]
        name = place if number == 1 else f"{place} ({number})"
        case = ElementTree.Element("testcase", classname=f"planfly.{finding.rule}", name=name)
        if finding.ok is False:
            message = _without_control_characters(f"{rule_word(finding.rule)}: {finding.reason}")
            failure = ElementTree.SubElement(case, "failure", message=message)
            if finding.suggestions:
                failure.text = _without_control_characters(f"would pass: {finding.suggestion}")
        elif finding.ok is None:
            ElementTree.SubElement(
                case, "skipped", message=_without_control_characters(f"not judged: {finding.reason}")
            )
        cases.append(case)
    return cases


def _without_control_characters(text: str, keep: str = "") -> str:
    """Replace each non-printable character that is not in `keep` with a space; XML 1.0 permits few of them."""
    return "".join(character if character.isprintable() or character in keep else " " for character in text)
