"""Through a whole command every stage is entered once, and what it made is handed on.

Limits, airframe, plan, path, local map, the route's demands and the track's alignment are each made there alone.
"""

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
    "flight.guidance.fly_by_path:fly_by_path",
    "flight.simulation.local_map:LocalMap.around",
    "flight.simulation.simulate:simulate",
    "logs.verdict.judge_flight:judge_flight",
    "logs.verdict.judge_flight:judge_geometry",
    "logs.verdict.measures.route_demands:route_demands",
    "logs.verdict.measures.track_alignment:lay_track",
)
OURS = ("planfly", "logs", "flight", "planner", "world", "aircraft")
ONCE = dict.fromkeys(("load_airframe", "load_envelope", "make_limits"), 1)
OPENED = dict.fromkeys(("plan_mission", "make_route", "make_setup", "fly_by_path"), 1)
ALIGNED = dict.fromkeys(("route_demands", "lay_track"), 1)
FLIGHT = OPENED | ALIGNED | dict.fromkeys(("around", "simulate", "judge_flight"), 1)
LOG = ALIGNED | dict.fromkeys(("make_limits", "fly_by_path"), 1)
MISSION = Path(__file__).parents[1] / "flight" / "missions" / "qgc.waypoints"

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
    for room in ("logs.report.page", "logs.replay.timeline"):
        import_module(room)
    entered: Counter[str] = Counter()
    for stage in STAGES:
        home, _, name = stage.partition(":")
        owner, _, method = name.partition(".")
        function = getattr(import_module(home), owner)
        if method:
            monkeypatch.setattr(function, method, counted(getattr(function, method), entered))
            continue
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
    assert count("check", plan, code=4) == ONCE | OPENED | {"judge_geometry": 1, "route_demands": 1}
    assert count("export", plan, "a.plan", code=0) == ONCE | {"plan_mission": 1}
    assert count("export", plan, "a.kml", "b.plan", code=0) == ONCE | OPENED


@pytest.mark.parametrize("command", ["check", "report"])
def test_a_log_holds_its_airframe_and_its_route(count: Count, flight: Path, command: str) -> None:
    assert count(command, str(flight / "flight.mcap"), code=4) == LOG | {"judge_flight": 1}


def test_a_replay_aligns_its_track_once(count: Count, flight: Path) -> None:
    assert count("replay", str(flight / "flight.mcap"), "--at-once", code=0) == LOG


def test_a_mission_that_a_person_brought_is_flown_or_judged_along_one_path(count: Count) -> None:
    flown = count("fly", str(MISSION), "--terrain", "jacksboro", code=0)
    # The scenario that is made around it needs the route's ends and heights before there are any limits.
    assert flown.pop("make_route") == 2
    assert flown == {key: n for key, n in (ONCE | FLIGHT).items() if key not in ("plan_mission", "make_route")}
    judged = count("check", str(MISSION), "--terrain", "jacksboro", code=0)
    assert {key: n for key, n in judged.items() if n != 1} == {"make_route": 2}
    assert judged["fly_by_path"] == judged["route_demands"] == 1
