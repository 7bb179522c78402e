"""No program of ours reads a verdict's words: they may all be another language, and nothing else changes."""

import ast
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict import findings, wording
from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_flight, judge_geometry
from logs.verdict.rules.registry import RULES
from logs.verdict.verdict import Verdict, verdict_json
from logs.views.failures import collect_failures
from logs.views.turns import list_place_values
from planfly.workflow.tighten_plan import tighten_limits
from tests.mission_lines import setup_of, wp
from tests.synthetic import bump, edited, fly_path, make_setup

ROOT = Path(__file__).parents[3]
PACKAGES = ("planfly", "logs", "flight", "planner", "aircraft", "world")
MUTE = "¤"
# What words are made by, and the fields that hold some.
MAKERS = (
    *("place_text", "threat_text", "change_text", "suggestion_text", "suggestions_text", "disagreement_text"),
    "tightening_text",
)
FIELDS = ("reason", "brief", "headline", "summary", "lines", "details", "suggestion")
TAKE_APART = (
    *("split", "rsplit", "splitlines", "partition", "rpartition", "startswith", "endswith", "removeprefix"),
    *("removesuffix", "find", "rfind", "index", "rindex", "count", "strip", "lstrip", "rstrip"),
)
THREAT = {"name": "Alfa", "east_m": 300.0, "north_m": 1000.0, "amsl_m": 300.0, "kill_radius_m": 500.0}
ROUTE = [[0, 0, 300], [0, 2000, 300], [0, 3000, 600], [150, 3000, 600], [150, 5000, 250]]


def loiter_setup() -> FlightSetup:
    setup = setup_of(wp(0, 500), wp(0, 1500, command=18, p="2 0 40 0"), wp(1500, 1500))
    return replace(setup, scenario=replace(setup.scenario, wind=replace(setup.scenario.wind, speed=8.0)))


def flown_setup() -> tuple[FlightSetup, Track]:
    setup = make_setup(ROUTE, threats=[THREAT | {"kill_scale_m": 200.0}])
    track = fly_path(setup, rate=20.0, across=bump(1000.0, 30.0, 60.0), airspeed=lambda s: -3.0 * (s > 4000.0))
    return setup, edited(track, position=track.position - [0.0, 0.0, 290.0])


def data_of(verdict: Verdict) -> dict[str, Any]:
    """Everything of a verdict but its words."""
    return {
        "findings": [asdict(replace(item, reason="", brief="")) for item in verdict.findings],
        "whole": (verdict.flyable, verdict.complete, verdict.level),
        "levels": [(level.name, level.flyable, level.disagreements) for level in verdict.levels],
    }


def used(verdict: Verdict, setup: FlightSetup) -> list[Any]:
    """What figures, report and the next round of planning take from a verdict, without words."""
    shown = verdict
    rows = [(rule.state, *rule.cells[:3], *(rule.cells[k] for k in (4, 5, 7))) for rule in shown.rules]
    tighter, changes = tighten_limits(setup.scenario, verdict)
    values = [list_place_values(verdict.findings, rule) for rule in RULES]
    return [
        collect_failures(verdict, len(setup.route.points)),
        values,
        rows,
        (shown.state, shown.title),
        changes,
        tighter.to_json(),
    ]


@pytest.fixture
def muted(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Makes every maker of words, and every finding, mute, in each module that has them."""

    def everywhere(name: str, original: object, other: object) -> None:
        for module in list(sys.modules.values()):
            if getattr(module, "__name__", "").split(".")[0] in PACKAGES and getattr(module, name, None) is original:
                monkeypatch.setattr(module, name, other)

    def mute() -> None:
        for name in MAKERS:
            if hasattr(wording, name):
                everywhere(name, getattr(wording, name), lambda *_: MUTE)
        make = findings.make_finding

        def mute_finding(*arguments: Any, **named: Any) -> Finding:
            return replace(make(*arguments, **named), reason=MUTE, brief=MUTE)

        everywhere("make_finding", make, mute_finding)
        everywhere("shorten_statement", wording.shorten_statement, lambda _: MUTE)

    return mute


def test_a_flight_is_judged_and_used_the_same_without_words(muted: Callable[[], None]) -> None:
    setup, track = flown_setup()
    spoken = judge_flight(setup, track, "ground contact")
    assert len({item.rule for item in spoken.findings if item.suggestions}) >= 4
    assert len({item.rule for item in spoken.findings if item.ok is False}) >= 7
    taken = used(spoken, setup)
    muted()
    silent = judge_flight(setup, track, "ground contact")
    assert {item.reason for item in silent.findings} == {MUTE}
    assert data_of(silent) == data_of(spoken)
    assert used(silent, setup) == taken


def test_a_loiter_is_judged_the_same_without_words(muted: Callable[[], None]) -> None:
    setup = loiter_setup()
    spoken = judge_geometry(setup)
    assert [item.ok for item in spoken.findings if item.rule == "loiter"] == [False]
    muted()
    assert data_of(judge_geometry(setup)) == data_of(spoken)


@pytest.mark.parametrize("name", ["threatening hill", "threat 1", "radar (item 2)"])
def test_what_a_threat_is_called_changes_its_name_alone(name: str) -> None:
    def written(called: str) -> str:
        threat = THREAT | {"kill_scale_m": 200.0, "name": called}
        verdict = judge_geometry(make_setup([[0, 0, 300], [0, 2000, 300]], threats=[threat]))
        assert f"missile {called}" in verdict.headline
        return verdict_json(verdict).replace(called, MUTE)

    assert written(name) == written("Alfa")


def modules() -> Iterator[tuple[Path, ast.Module]]:
    """Modules of ours that know verdicts."""
    for package in PACKAGES:
        for file in sorted((ROOT / package).rglob("*.py")):
            text = file.read_text(encoding="utf-8")
            if "logs.verdict" in text:
                yield file, ast.parse(text)


def holds_words(node: ast.AST) -> bool:
    """Whether an expression holds words of a verdict, or the name that a user gave to a place."""
    for part in ast.walk(node):
        match part:
            case ast.Attribute(attr=attr) if attr in FIELDS:
                return True
            case ast.Attribute(attr="name", value=ast.Name(id="place") | ast.Attribute(attr="place")):
                return True
            case ast.Name(id=name) if name in MAKERS:
                return True
    return False


def test_no_module_that_knows_verdicts_takes_their_words_apart() -> None:
    found = []
    for file, tree in modules():
        for node in ast.walk(tree):
            match node:
                case ast.Call(func=ast.Attribute(value=value, attr=method)) if method in TAKE_APART:
                    apart = holds_words(value)
                # A text has one index, an array of label lines two.
                case ast.Subscript(value=ast.Attribute() as value, slice=index) if not isinstance(index, ast.Tuple):
                    apart = holds_words(value)
                case ast.Compare(ops=[ast.In() | ast.NotIn()], comparators=[value]):
                    apart = holds_words(value)
                case _:
                    continue
            if apart:
                found.append(f"{file.relative_to(ROOT)}:{node.lineno}")
    # A verdict's first line is its headline.
    assert [one for one in found if not one.startswith("logs/verdict/verdict.py")] == []


def test_no_module_that_knows_verdicts_has_regular_expressions() -> None:
    for file, tree in modules():
        names = [alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names]
        froms = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        assert "re" not in [*names, *froms], file
