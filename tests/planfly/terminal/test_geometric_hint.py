"""A verdict without any suggestion points to the suggestions for the planned route, if that fails too."""

from dataclasses import replace

import pytest

from logs.verdict.places import LevelAnswer
from planfly.terminal.verdict_lines import verdict_lines
from tests.logs.verdict.judging import ROUTE, judge
from tests.synthetic import fly_path, make_setup

HINT = "planfly check --geometry suggests changes"


@pytest.mark.parametrize(
    ("geometry", "has_suggestions", "is_hinted"),
    [
        (LevelAnswer("geometry", False, "not flyable"), False, True),
        (LevelAnswer("geometry", False, "not flyable"), True, False),
        (LevelAnswer("geometry", False, "not judged", undecided=True), False, False),
        (LevelAnswer("geometry", True, "flyable"), False, False),
    ],
)
def test_the_hint(geometry: LevelAnswer, has_suggestions: bool, is_hinted: bool) -> None:
    setup = make_setup(ROUTE, limits={"max_turn_deg": 60.0})
    verdict = judge(setup, fly_path(setup))
    assert any(finding.ok is False and finding.suggestions for finding in verdict.findings)
    if not has_suggestions:
        verdict = replace(verdict, findings=tuple(replace(finding, suggestions=()) for finding in verdict.findings))
    lines = verdict_lines(replace(verdict, levels=(geometry,)), ())
    assert any(HINT in line for line in lines) == is_hinted
