"""Write answers as JUnit XML for continuous integration.

A verdict has a case for its answer and for each finding.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple
from xml.etree import ElementTree

from logs.verdict.findings import State
from logs.verdict.presentation import FindingRow

JunitResult = Literal["passed", "failure", "skipped", "error"]
_RESULTS: dict[State, JunitResult] = {"ok": "passed", "fail": "failure", "open": "skipped", "unjudged": "skipped"}


class JunitCase(NamedTuple):
    """Test case of a JUnit file.

    classname: "planfly" for an answer, "planfly.RULE" for a rule; in the file, the name of the suite follows "planfly".
    message: reason of a result other than "passed".
    text: further text.
    """

    classname: str
    name: str
    result: JunitResult = "passed"
    message: str = ""
    text: str = ""


class JunitSuite(NamedTuple):
    """Test suite of a JUnit file.

    name: name of the plan or flight.
    output: lines for a person.
    """

    name: str
    cases: Sequence[JunitCase]
    output: str = ""


def suites_text(suites: Iterable[JunitSuite]) -> str:
    """Return test suites as the XML text of a JUnit file."""
    root = ElementTree.Element("testsuites")
    for suite in suites:
        counts = Counter(case.result for case in suite.cases)
        element = ElementTree.SubElement(
            root,
            "testsuite",
            name=_without_control_characters(suite.name),
            tests=str(len(suite.cases)),
            failures=str(counts["failure"]),
            errors=str(counts["error"]),
            skipped=str(counts["skipped"]),
        )
        for case in suite.cases:
            # The class name contains the suite, because many programs distinguish cases only by class and name.  Dots
            # in the suite's name are replaced, because these programs split a class at its dots.
            package, *rule = case.classname.split(".")
            class_name = ".".join([package, suite.name.replace(".", "_"), *rule])
            case_element = ElementTree.SubElement(
                element,
                "testcase",
                classname=_without_control_characters(class_name),
                name=_without_control_characters(case.name),
            )
            text = _without_control_characters(case.text, keep="\n") or None
            if case.result != "passed":
                message = _without_control_characters(case.message)
                ElementTree.SubElement(case_element, case.result, message=message).text = text
            elif text:
                ElementTree.SubElement(case_element, "system-out").text = text
        if suite.output:
            ElementTree.SubElement(element, "system-out").text = _without_control_characters(suite.output, keep="\n")
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def verdict_suite(name: str, lines: Sequence[str], rows: Iterable[FindingRow], *, passes: bool) -> JunitSuite:
    """Return the test suite of a verdict.

    name: name of the judged plan or flight.
    lines: lines of the summary, the headline first.

    A failed finding becomes a failure, and an unjudged finding a skipped test case.  The test case ``verdict`` fails
    unless the answer is "flyable", even if no finding failed and a part was just not judged.
    """
    cases = [answer_case("" if passes else "".join(lines[:1]))]
    counts: Counter[tuple[str, str]] = Counter()
    for row in rows:
        rule, place = row.finding.rule, _without_control_characters(row.finding.where)
        counts[rule, place] += 1
        # Names of cases must be unique.
        case_name = place if counts[rule, place] == 1 else f"{place} ({counts[rule, place]})"
        remedy = f"would pass: {row.remedy}" if row.remedy else ""
        cases.append(JunitCase(f"planfly.{rule}", case_name, _RESULTS[row.finding.state], row.message, remedy))
    return JunitSuite(name, cases, "\n".join(lines))


def junit_error_text(name: str, message: str) -> str:
    """Return the text of a JUnit file with one erroneous test case.

    It reports a plan or flight that could not be judged.

    name: name of the plan or flight.
    message: reason in one line.
    """
    return suites_text([JunitSuite(name, [JunitCase("planfly", "verdict", "error", message)])])


def answer_case(reason: str) -> JunitCase:
    """Make the test case named "verdict", which fails if a reason is given.

    reason: reason for the failure; "" if the test case passes.
    """
    return JunitCase("planfly", "verdict", "failure" if reason else "passed", reason)


def _without_control_characters(text: str, keep: str = "") -> str:
    """Replace non-printable characters, which XML mostly forbids, by spaces, except those in `keep`."""
    return "".join(character if character.isprintable() or character in keep else " " for character in text)
