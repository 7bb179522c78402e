"""Through a whole command every stage is entered once: airframe, limits and plan are made there and handed on."""

import sys
from collections import Counter
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from planfly.cli import main
from planfly.commands.registry import COMMAND_NAMES, find_command

STAGES = (
    "planfly.airframe:load_airframe",
    "flight.dynamics.envelope_tables:load_envelope",
    "flight.simulation.flight_setup:make_limits",
    "planner.search.plan_path:plan_path",
    "flight.mission.from_plan:plan_mission",
    "flight.mission.routing:make_route",
    "planfly.pipeline:make_setup",
    "flight.simulation.simulate:simulate",
    "logs.verdict.judge_flight:judge_flight",
    "logs.verdict.judge_flight:judge_geometry",
)
OURS = ("planfly", "logs", "flight", "planner", "world", "aircraft")
ONCE = dict.fromkeys(("load_airframe", "load_envelope", "make_limits"), 1)
FLIGHT = {"plan_mission": 1, "make_route": 1, "make_setup": 1, "simulate": 1, "judge_flight": 1}

Count = Callable[..., dict[str, int]]


def counted(function: Callable[..., Any], entered: Counter[str]) -> Callable[..., Any]:
    def entry(*args: Any, **named: Any) -> Any:
        entered[function.__name__] += 1
        return function(*args, **named)

    return entry


@pytest.fixture
def count(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Count:
    """Give a command; get the stages that it entered, and how often each."""
    # What a command imports by itself would keep the counting function after the test.
    for name in COMMAND_NAMES:
        find_command(name)
    entered: Counter[str] = Counter()
    for stage in STAGES:
        home, _, name = stage.partition(":")
        function = getattr(import_module(home), name)
        counting = counted(function, entered)
        for module in [module for key, module in sys.modules.items() if key.partition(".")[0] in OURS]:
            if vars(module).get(name) is function:
                monkeypatch.setattr(module, name, counting)
    monkeypatch.chdir(tmp_path)

    def carry_out(*argv: str, code: int) -> dict[str, int]:
        entered.clear()
        assert main(argv) == code
        return dict(entered)

    return carry_out


def test_run_makes_everything_once(count: Count) -> None:
    assert count("run", "tight", code=4) == ONCE | FLIGHT | {"plan_path": 1}


def test_a_round_more_makes_only_what_its_tighter_limits_change(count: Count) -> None:
    twice = dict.fromkeys(("plan_path", *FLIGHT), 2)
    assert count("run", "tight", "--refine", "1", code=4) == ONCE | twice | {"make_limits": 2}


def test_plan_loads_the_airframe_alone(count: Count) -> None:
    assert count("plan", "tight", code=0) == ONCE | {"plan_path": 1}


def test_a_plan_is_opened_once_to_be_flown_judged_or_exported(count: Count, flight: Path) -> None:
    plan = str(flight / "plan.json")
    assert count("fly", plan, code=4) == ONCE | FLIGHT
    opened = ONCE | {"plan_mission": 1, "make_route": 1, "make_setup": 1}
    assert count("check", plan, code=4) == opened | {"judge_geometry": 1}
    assert count("export", plan, "a.plan", code=0) == ONCE | {"plan_mission": 1}
    assert count("export", plan, "a.kml", "b.plan", code=0) == opened


@pytest.mark.parametrize("command", ["check", "report"])
def test_a_log_holds_its_airframe_and_its_route(count: Count, flight: Path, command: str) -> None:
    assert count(command, str(flight / "flight.mcap"), code=4) == {"make_limits": 1, "judge_flight": 1}
