"""Units of small work: each calls kernels that the others do not call, with the types that all commands use."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flight.mission_files.formats import parse_mission
from logs.recording.recorder import Recorder
from planfly.airframe import Airframe, load_airframe
from planfly.pipeline import fly_and_judge, make_setup
from planner.evaluation.certify import certify
from planner.evaluation.encoding import ENCODINGS, Encoding, rotated_frame, rotated_vectors
from planner.evaluation.graded_scores import graded_scores
from planner.evaluation.paper_scores import paper_scores
from planner.evaluation.problem import Problem, make_problem
from planner.search.score_table import best_first, score_table
from planner.seeding.grid_routes import GridRoute, grid_route, make_grid
from planner.seeding.path_shortening import evenly, shorten_path
from planner.seeding.pattern_search import search_patterns
from planner.seeding.side_routes import optimistic_grid, side_routes
from planner.seeding.waypoint_fitting import fit_waypoints
from world.scenario import Scenario, from_spec
from world.scenario_file import parse_scenario

Floats = NDArray[np.float64]

FIELD = """
name = "field"
[terrain]
kind = "flat"
amsl_m = 0
[area]
east_m = [-3000, 3000]
north_m = [-3000, 3000]
ceiling_amsl_m = 600
[start]
east_m = -1500
north_m = 0
height_m = 100
[destination]
east_m = 1500
north_m = 0
height_m = 100
[[threats]]
name = "post"
east_m = 0
north_m = 0
amsl_m = 50
kill_radius_m = 100
kill_scale_m = 50
[wind]
speed_mps = 3
from_deg = 250
turbulence = "light"
[limits]
min_clearance_m = 50
"""
MISSION = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t46.0\t8.0\t0.0\t1
1\t0\t3\t16\t0\t0\t0\t0\t46.0\t8.0\t100.0\t1
2\t0\t3\t16\t0\t0\t0\t0\t46.004\t8.0\t110.0\t1
3\t0\t3\t16\t0\t0\t0\t0\t46.004\t8.006\t110.0\t1
"""
WAYPOINTS = 8
STAGES, MOST_ROUTES, FEW = 12, 2, 4


class _Task(NamedTuple):
    """A small problem, and a path (w, 3) about its threat."""

    problem: Problem
    encoding: Encoding
    path: Floats


def _world() -> tuple[Scenario, Airframe]:
    scenario = from_spec(parse_scenario(FIELD, "field"), "field")
    return scenario, load_airframe(scenario)


def _task() -> _Task:
    scenario, airframe = _world()
    problem = make_problem(scenario, airframe.limits)
    space = problem.space
    aside = 0.5 * (space.start + space.destination) + [0.0, 300.0, 20.0]
    path = evenly(np.array([space.start, aside, space.destination]), WAYPOINTS)
    return _Task(problem, ENCODINGS["rotated"](space, WAYPOINTS), path)


def _score() -> None:
    task = _task()
    scores = score_table(*graded_scores(task.problem.search, np.stack([task.path, task.path])))
    best_first(scores)
    vector = rotated_vectors(task.problem.space, task.encoding, task.path[None])[0]
    search_patterns(task.problem.search, task.encoding, vector, FEW)


def _certify() -> None:
    task = _task()
    certify(task.problem, task.path)


def _shorten() -> None:
    task = _task()
    shorten_path(task.problem.search, task.path)


def _route() -> None:
    task = _task()
    data, space, lower, upper = task.problem.search, task.problem.space, task.encoding.lower, task.encoding.upper
    frame = rotated_frame(space.start, space.destination)
    span = (float(lower[1::3].min()), float(upper[1::3].max()))
    found = grid_route(data, frame, make_grid(data, frame, span, STAGES))
    for route in [found] if isinstance(found, GridRoute) else []:
        fit_waypoints(data, frame, route.points, WAYPOINTS)
    grid = optimistic_grid(data, frame, span, STAGES, shrink=0.5, spread=0.2, ratio=0.5)
    side_routes(data, frame, grid, 2.0 * frame.length, MOST_ROUTES)


def _score_as_the_paper() -> None:
    task = _task()
    paper_scores(task.problem.certified, task.path[None])


def _fly() -> None:
    scenario, airframe = _world()
    setup = make_setup(scenario, airframe, parse_mission(MISSION, "field.waypoints"), 1)
    flown = fly_and_judge(setup, airframe, None)
    with Recorder(Path(os.devnull), setup) as recorder:
        recorder.write(flown.track)
        recorder.finish(flown.ended, flown.verdict)


UNITS: dict[str, Callable[[], None]] = {
    "scores": _score,
    "certificates": _certify,
    "shortening": _shorten,
    "routes": _route,
    "paper": _score_as_the_paper,
    "flight": _fly,
}
