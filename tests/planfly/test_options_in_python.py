"""Python reaches all that the command line does: each option of each command is a keyword of the API."""

import argparse
import inspect
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, get_args, get_origin

import pytest

import planfly
from planfly.cli import build_parser

# The functions that each command calls.
FUNCTIONS = {
    "run": ("run",),
    "plan": ("plan", "replan", "plan_front"),
    "export": ("export",),
    "fly": ("fly",),
    "studio": ("open_studio",),
    "serve": ("serve",),
    "check": ("judge", "fly_by_each"),
    "returns": ("returns",),
    "link": ("link",),
    "survey": ("survey",),
    "report": ("report", "foxglove_layout"),
    "compare": ("compare",),
    "replay": ("replay", "timeline", "instruments", "movie", "play_to_foxglove", "play_to_stations"),
    "recover": ("recover",),
    "import": ("import_log", "guess_columns"),
    "refly": ("refly",),
    "predict": ("predict",),
    "campaign": ("campaign", "campaign_flight"),
    "winds": ("winds",),
    "battery": ("battery",),
    "window": ("window",),
    "ground-risk": ("ground_risk",),
    "paper": ("paper_tables",),
    "aircraft": ("aircraft", "describe_aircraft", "new_aircraft", "identify_aircraft"),
    "scenarios": ("scenarios",),
    "new": ("new_scenario",),
    "terrain": ("terrain",),
    "help": (),
    "completion": (),
}
# Options whose keyword has another name in the function named.
RENAMED = {
    ("plan", "front"): ("plan_front", "count"),
    ("report", "log"): ("report", "source"),
    ("report", "layout"): ("foxglove_layout", "file"),
    ("replay", "movie"): ("movie", "out"),
    ("campaign", "refly"): ("campaign_flight", "index"),
    ("plan", "flights"): ("campaign", "flights"),
    ("run", "flights"): ("campaign", "flights"),
}
# What only a terminal has, and what Python has in `Verdict.to_junit`; of a replay, how the timeline is printed, and
# that another function is meant; of a check, whether the file of --json is replaced.
TERMINAL_ONLY = {
    *("help", "json", "junit", "quiet", "schema", "topic", "shell"),
    *(("replay", "at_once"), ("replay", "foxglove"), ("check", "overwrite")),
}


def options() -> Iterator[tuple[str, argparse.Action]]:
    for name, parser in build_parser().commands.items():
        for action in parser._actions:
            if not {action.dest, (name, action.dest)} & TERMINAL_ONLY:
                yield name, action


def keywords(command: str) -> dict[str, inspect.Parameter]:
    found: dict[str, inspect.Parameter] = {}
    for name in FUNCTIONS[command]:
        found |= inspect.signature(getattr(planfly, name)).parameters
    return found


def test_every_command_calls_public_functions() -> None:
    assert set(FUNCTIONS) == set(build_parser().commands)
    assert {name for names in FUNCTIONS.values() for name in names} <= set(planfly.__all__)


@pytest.mark.parametrize(("command", "action"), [pytest.param(*one, id=f"{one[0]}-{one[1].dest}") for one in options()])
def test_an_option_is_a_keyword(command: str, action: argparse.Action) -> None:
    if (command, action.dest) in RENAMED:
        function, keyword = RENAMED[command, action.dest]
        assert keyword in inspect.signature(getattr(planfly, function)).parameters
        return
    assert action.dest in keywords(command), f"planfly {command} {action.option_strings or action.dest}"


@pytest.mark.parametrize(("command", "action"), [pytest.param(*one, id=f"{one[0]}-{one[1].dest}") for one in options()])
def test_a_default_is_the_same_in_python(command: str, action: argparse.Action) -> None:
    if action.default is None or action.required or (command, action.dest) in RENAMED:
        return
    mine: Any = [
        signature.parameters[action.dest].default
        for name in FUNCTIONS[command]
        if action.dest in (signature := inspect.signature(getattr(planfly, name))).parameters
    ]
    if action.dest == "overwrite":
        # Where a call always named its target, it is replaced.
        assert set(mine) <= {True, False}
    else:
        for one in mine:
            assert (list(one) if isinstance(action.default, list) else one) == action.default


def test_check_takes_what_judge_takes() -> None:
    check, judge = (list(inspect.signature(function).parameters) for function in (planfly.check, planfly.judge))
    assert check == judge


def text_parameters() -> Iterator[tuple[str, str]]:
    """Parameters of the public functions whose annotation names `str`: texts, paths, and data that a path may name."""
    for name in planfly.__all__:
        function = getattr(planfly, name)
        if inspect.isfunction(function):
            for parameter in inspect.signature(function).parameters.values():
                members = get_args(parameter.annotation) or (parameter.annotation,)
                # An array like numpy's may be of texts, too.
                is_of_classes = all(isinstance(one, type) or get_origin(one) is Sequence for one in members)
                if str in members and is_of_classes and get_origin(parameter.annotation) is not Sequence:
                    yield name, parameter.name


@pytest.mark.parametrize(("function", "keyword"), list(text_parameters()))
def test_an_argument_of_a_wrong_type_is_refused_in_a_line(function: str, keyword: str) -> None:
    """The check comes before all else, also before other arguments are missed."""
    is_several = (
        inspect.signature(getattr(planfly, function)).parameters[keyword].kind is inspect.Parameter.VAR_POSITIONAL
    )
    for value in (7, object(), {}, b"x"):
        with pytest.raises(planfly.PlanflyError, match=f"^{keyword} {type(value).__name__}: expected ") as refused:
            getattr(planfly, function)(
                *(["a.waypoints", value] if is_several else []), **({} if is_several else {keyword: value})
            )
        assert "\n" not in str(refused.value)


def test_a_sequence_of_files_is_taken_and_one_of_numbers_is_refused() -> None:
    with pytest.raises(planfly.PlanflyError, match=r"^fence list: expected text, a path or a list of these$"):
        planfly.check("a.waypoints", fence=[7])
    with pytest.raises(planfly.PlanflyError, match=r"none\.waypoints: cannot be read"):
        planfly.check("none.waypoints", fence=["none.fence", Path("none.kml")])


@pytest.mark.parametrize("value", [[], [10], ()])
def test_a_choice_is_one_word_or_number(value: object) -> None:
    with pytest.raises(planfly.PlanflyError, match=r"^log_hz .*: expected 60, 30, 20, 10$"):
        planfly.fly("a.waypoints", log_hz=value)
