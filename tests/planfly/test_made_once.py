"""Through a whole command every stage is entered once, and what it made is handed on.

Limits, UAV, plan, path, local map, the route's requirements and the track's alignment are each made there alone.
"""

import json
import sys
from collections import Counter
from collections.abc import Callable
from importlib import import_module
from multiprocessing import Pipe
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest

import planfly
from flight.live.flight_process import (
    EndFlight,
    FlightJudged,
    JudgeMission,
    StartFlight,
    read_event,
    serve_flights,
)
from logs.views import drawing
from planfly.cli import build_parser, main
from planfly.live.served_flights import ServedFlights, ServeOptions
from planfly.workflow import suggestion_trials
from tests.planfly.conftest import FIELD
from tests.setups import waypoint_mission
from tests.world.made.elevation_files import from_origin, write_raster
from world.scenario import load_scenario

STAGES = (
    "planfly.workflow.uav:load_uav",
    "flight.dynamics.envelope_tables:load_envelope",
    "flight.simulation.setup:make_limits",
    "planner.search.plan_path:plan_path",
    "flight.mission.from_plan:plan_mission",
    "flight.mission.itinerary:make_itinerary",
    "flight.mission.placing:place_stops",
    "flight.mission.route:route_through_stops",
    "planfly.workflow.open_flight:make_setup",
    "flight.guidance.path:fly_by_path",
    "flight.simulation.simulate:LocalMap.around",
    "flight.simulation.simulate:Flight.__init__",
    "logs.verdict.judge_flight:judge_flight",
    "logs.verdict.judge_flight:judge_geometry",
    "logs.verdict.measures.route_requirements:route_requirements",
    "logs.verdict.measures.track_alignment:align_track",
)
OURS = ("planfly", "logs", "flight", "planner", "world", "aircraft")
# A flight that fails is judged by geometry, too, for what its last line says of `check --geometry`.
HINT = {"judge_geometry": 1, "route_requirements": 2}
ONCE = dict.fromkeys(("load_uav", "load_envelope", "make_limits"), 1)
ROUTED = dict.fromkeys(("make_itinerary", "place_stops", "route_through_stops", "make_setup", "fly_by_path"), 1)
OPENED = ROUTED | {"plan_mission": 1}
ALIGNED = dict.fromkeys(("route_requirements", "align_track"), 1)
FLIGHT = OPENED | ALIGNED | dict.fromkeys(("around", "__init__", "judge_flight"), 1)
# A reference flight is at true airspeeds along a path of its own, and judged like the setup's flight.
REFERENCE = dict.fromkeys(("fly_by_path", "around", "__init__", "route_requirements", "align_track", "judge_flight"), 2)
LOG = ALIGNED | dict.fromkeys(("make_limits", "fly_by_path"), 1)
MISSION = Path(__file__).parents[1] / "flight" / "missions" / "by_hand.waypoints"

Count = Callable[..., dict[str, int]]


def counted(function: Callable[..., Any], entered: Counter[str]) -> Callable[..., Any]:
    def entry(*args: Any, **named: Any) -> Any:
        entered[function.__name__] += 1
        return function(*args, **named)

    return entry


@pytest.fixture
def entered(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Stages entered since the test began, and how often each."""
    # What a command imports by itself would keep the counting function after the test.
    build_parser()
    for name in planfly.__all__:
        getattr(planfly, name)
    for room in ("logs.views.report.page", "logs.views.replay.timeline"):
        import_module(room)
    # Each suggestion that is tried has a mission of its own; trials are counted in test_suggestion_trials.py.
    monkeypatch.setattr(suggestion_trials, "MAX_TRIED_FINDINGS", 0)
    # What is drawn enters stages as ever; to render it takes longer than all of them.
    monkeypatch.setattr(drawing, "png_bytes", lambda figure: b"")
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
    return entered


@pytest.fixture
def count(entered: Counter[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Count:
    """Give a command; get the stages that it entered, and how often each."""
    monkeypatch.chdir(tmp_path)

    def carry_out(*argv: str, code: int) -> dict[str, int]:
        entered.clear()
        assert main(argv) == code
        return dict(entered)

    return carry_out


def test_run_makes_everything_once(count: Count) -> None:
    assert count("run", "tight", code=4) == ONCE | FLIGHT | {"plan_path": 1}


@pytest.mark.usefixtures("blank_pictures")
def test_a_round_more_makes_only_what_its_tighter_limits_change(count: Count) -> None:
    """And where no round flies, each of them is shown not to."""
    twice = {"plan_path": 2} | {stage: 2 * number for stage, number in FLIGHT.items()}
    assert count("run", "tight", "--refine", "1", "--out", "out", code=4) == ONCE | twice | {"make_limits": 2}
    rounds = json.loads(Path("out", "rounds.json").read_text(encoding="utf-8"))
    assert [entry["flyable"] for entry in rounds] == [False, False]
    assert rounds[-1]["next"].startswith("ended: ")


def test_plan_loads_the_airframe_alone(count: Count) -> None:
    # Its expected failures are judged by the UAV, which a plan does not hold.
    again = {"load_uav": 2, "load_envelope": 2, "make_limits": 2}
    assert count("plan", "tight", code=0) == ONCE | {"plan_path": 1} | again


def test_a_plan_is_opened_once_to_be_flown_judged_or_exported(count: Count, flight: Path) -> None:
    plan = str(flight / "plan.json")
    assert count("fly", plan, code=4) == ONCE | FLIGHT | HINT
    assert count("check", plan, code=4) == ONCE | FLIGHT | HINT
    judged = ONCE | OPENED | {"judge_geometry": 1, "route_requirements": 1}
    assert count("check", plan, "--geometry", code=4) == judged
    # Its fence is what the planned path keeps to.
    assert count("export", plan, "a.plan", code=0) == ONCE | OPENED | {"route_requirements": 1}
    # The map's returns begin on the planned path.
    with_returns = ONCE | OPENED | {"route_requirements": 2}
    assert count("export", plan, "a.kml", "b.plan", "b.fence", code=0) == with_returns


@pytest.mark.parametrize("command", ["check", "report"])
def test_a_log_holds_its_airframe_and_its_route(count: Count, flight: Path, command: str) -> None:
    hint = HINT if command == "check" else {}
    assert count(command, str(flight / "flight.mcap"), code=4) == LOG | {"judge_flight": 1} | hint


def test_a_replay_aligns_its_track_once(count: Count, flight: Path) -> None:
    assert count("replay", str(flight / "flight.mcap"), "--at-once", code=0) == LOG


def test_a_mission_that_a_person_brought_is_flown_or_judged_along_one_path(count: Count) -> None:
    flown = {key: number for key, number in (ONCE | FLIGHT).items() if key != "plan_mission"}
    assert count("fly", str(MISSION), "--terrain", "jacksboro", code=0) == flown
    explained = count("fly", str(MISSION), "--terrain", "jacksboro", "--levels", code=0)
    assert explained == flown | REFERENCE
    judged = ONCE | ROUTED | {"judge_geometry": 1, "route_requirements": 1}
    assert count("check", "--geometry", str(MISSION), "--terrain", "jacksboro", code=0) == judged
    assert count("check", "--geometry", str(MISSION), "--scenario", "jacksboro-air", code=4) == judged


def test_a_log_judged_over_another_terrain_keeps_its_path(count: Count, flight: Path, tmp_path: Path) -> None:
    level = np.full((100, 100), 5.0, dtype=np.float32)
    ground = write_raster(tmp_path / "level.tif", level, "EPSG:4326", from_origin(7.98, 46.02, 8e-4, 4e-4))
    elsewhere = count("check", str(flight / "flight.mcap"), "--terrain", str(ground), code=4)
    assert elsewhere == LOG | {"judge_flight": 1} | HINT


def test_a_served_mission_is_prepared_once_and_flown_from_that(entered: Counter[str], tmp_path: Path) -> None:
    (tmp_path / "field.toml").write_text(FIELD, encoding="utf-8")
    field = str(tmp_path / "field.toml")
    flights = ServedFlights(ServeOptions("", 100.0, tmp_path / "logs", {"scenario": field}))
    assert dict(entered) == ONCE
    entered.clear()
    points = np.array([[0.0, 0.0, 150.0], [500.0, 0.0, 150.0]])
    level = waypoint_mission(points, np.array([25.0]), load_scenario(field).origin)
    link_end, flying_end = Pipe()
    process = Thread(target=serve_flights, args=(flying_end, flights))
    process.start()
    for order in (JudgeMission(level, 1), StartFlight()):
        link_end.send(order)
    while not isinstance(read_event(link_end.recv_bytes()), FlightJudged):
        pass
    link_end.send(EndFlight(quit=True))
    process.join(20.0)
    # The mission is judged before its flight, too.
    judged = ALIGNED | dict.fromkeys(("around", "judge_geometry", "judge_flight"), 1)
    # One tick of a flight of its own shows whether the flight can start.
    assert dict(entered) == ROUTED | judged | {"route_requirements": 2, "__init__": 2}
