"""Fly a mission, try the suggestions of its findings, or plan a path in the studio's worker processes.

Arguments are pickled, and results are plain data. Returns and campaigns, which take longer, are in
`planfly.studio.long_worker_tasks`.
"""

import math
import pickle
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flight.mission.items import Mission
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.rules.registry import with_passing_suggestions
from logs.views.failures import track_distance
from planfly.planning.pareto_plans import make_pareto_plans
from planfly.studio.changes import flight_results
from planfly.studio.edit_context import EditContext
from planfly.studio.states import place_states
from planfly.studio.view_model import can_apply_in_studio, findings_json, round_to_json, states_json, verdict_page_data
from planfly.studio.worker_process import Advance
from planfly.workflow.make_plan import make_plan
from planfly.workflow.mission_context import JudgedMission
from planfly.workflow.pipeline import FlightTask, fly_and_judge
from planfly.workflow.suggestion_trials import MAX_TRIAL_FLIGHTS, SuggestionTrials, finding_key, tried_suggestions
from planfly.workflow.uav import Uav
from planner.evaluation.certify import least_height
from planner.evaluation.problem import make_problem
from planner.search.plan_front import FrontPlan
from world.compile_events import COMPILE_TIMER
from world.scenario import Scenario, scenario_from_spec

# Maximum CPU time of a search for one path, for which a user waits, s.  CPU time, so that a busy machine finds the same
# path.
MAX_SEARCH_SECONDS = 25.0
# Maximum CPU time of a search for several paths, s.
MAX_SEARCH_SECONDS_FOR_SEVERAL = 60.0
# Maximum number of rows of a flown track that the page draws.
_MAX_DRAWN_ROWS = 1_500


def fly(payload: tuple[EditContext, Mission], advance: Advance) -> dict[str, Any]:
    """Fly a mission with its simulated autopilot, judge the flight, and return the results as page data.

    The findings have no suggestions.  "judged" is the pickled flight for `try_flown_suggestions`; it is empty if
    nothing failed.

    payload: the editing context, and the mission.
    """
    context, mission = payload
    setup = context.setup(mission)
    flight = fly_and_judge(setup, FlightTask(advance=advance, reference="never"))
    requirements = route_requirements(setup)
    judged_mission = JudgedMission(mission, setup, requirements, flight.verdict)
    states = place_states(requirements, flight.verdict.findings)
    seconds = round(float(flight.track.time[-1]), 1) if len(flight.track) else 0.0
    # Positions of the flown track, distances along the route for the profile, and times.
    track = flight.track
    track_data: dict[str, Any] = {"track": [], "along": []}
    if len(track):
        leg_ends = flight.verdict.leg_ends
        if len(leg_ends) == len(setup.route.positions) - 2:
            # The verdict's times at which legs ended replace the recorded leg numbers.
            track = replace(track, leg=np.searchsorted(np.array(leg_ends), track.time).astype(track.leg.dtype))
        rows = np.union1d(np.arange(0, len(track), max(1, len(track) // _MAX_DRAWN_ROWS)), [len(track) - 1])
        track_data = {
            "track": round_to_json(track.position[rows]),
            "along": round_to_json(np.asarray(track_distance(setup.route.positions, track))[rows]),
            "time": round_to_json(track.time[rows]),
        }
    return {
        "verdict": verdict_page_data(flight.verdict),
        "findings": findings_json(flight.verdict, ()),
        "judged": pickle.dumps(judged_mission) if flight.verdict.failed else b"",
        "states": states_json(states, 0, setup.route.legs),
        "violated": {"threats": sorted(states.threats), "zones": sorted(states.zones)},
        "ended": flight.ended,
        "early": not flight.verdict.complete,
        "autopilot": setup.autopilot.title,
        "seconds": seconds,
        "figures": flight_results(mission, setup.route, flight.verdict.findings, seconds),
        **track_data,
    }


def try_planned_suggestions(payload: tuple[EditContext, Mission], advance: Advance) -> dict[str, Any]:
    """Try the suggestions of a mission's geometric verdict, without flights.

    Return the same data as `try_flown_suggestions`.

    payload: the editing context, and the mission.
    """
    context, mission = payload
    return _try_suggestions(context, context.judge(mission), advance)


def try_flown_suggestions(payload: tuple[EditContext, bytes], advance: Advance) -> dict[str, Any]:
    """Try the suggestions of a failed flight in trial flights, and return the suggestions that passed.

    "findings" are all findings with these suggestions, as page data.  "changes" are the mission with a suggestion
    applied, and the suggestion, by (number of finding, number of suggestion), if the studio can apply the suggestion.

    payload: the editing context, and the pickled flight.
    """
    context, pickled = payload
    return _try_suggestions(context, pickle.loads(pickled), advance)


def _try_suggestions(context: EditContext, judged_mission: JudgedMission, advance: Advance) -> dict[str, Any]:
    """Try the suggestions of a verdict, and return the same data as `try_flown_suggestions`."""

    def report_and_continue() -> bool:
        """Report that suggestions are tried; return False, so that the trials are not aborted."""
        advance(0.0, MAX_TRIAL_FLIGHTS, "trying suggestions")
        return False

    verdict = judged_mission.verdict
    passed_trials = SuggestionTrials(context, judged_mission, report_and_continue).find_passing()
    tried = tried_suggestions(passed_trials)
    missions = {(finding_key(trial.finding), trial.suggestion): trial.setup.mission for trial in passed_trials}
    offered = with_passing_suggestions(verdict.findings, tried)
    changes = {
        (number, choice): (missions[finding_key(finding), suggestion], suggestion)
        for number, finding in enumerate(verdict.findings)
        if finding.ok is False
        for choice, suggestion in enumerate(offered[number].suggestions)
        if can_apply_in_studio(suggestion)
    }
    return {"findings": findings_json(verdict, tried), "changes": changes}


# ----------------------------------------------------------------------
# Plan paths.


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """Request to plan between two points of a scenario.

    ends: start and destination, (2, 3), m; None for the ends of the scenario.
    algorithm: name of the algorithm; None for the default.
    ways: maximum number of paths; several paths are a Pareto front of length, exposure, clearance and energy.
    """

    scenario: Scenario
    uav: Uav
    seed: int
    algorithm: str | None = None
    ends: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    ways: int = 1


def plan(request: PlanRequest, advance: Advance) -> list[FrontPlan]:
    """Plan one or several paths, and return them, the shortest first.

    If no path is safe, only the best path is returned.  A single path has NaN for the quantities of a comparison that
    take long to compute.
    """
    scenario = request.scenario if request.ends is None else with_ends(request.scenario, *request.ends)
    seconds = MAX_SEARCH_SECONDS if request.ways == 1 else MAX_SEARCH_SECONDS_FOR_SEVERAL
    uav, seed = request.uav, request.seed

    def measure_working_time() -> float:
        """Return the CPU time of this process without the compilation of kernels, s."""
        return time.process_time() - COMPILE_TIMER.seconds

    deadline = measure_working_time() + seconds

    def stop() -> str:
        """Return the reason to end the search after the deadline, and "" before it."""
        return "budget" if measure_working_time() > deadline else ""

    # Between two items of a mission, the path must join the leg after the second.
    joins_next_leg = request.ends is not None
    if request.ways > 1:
        front = make_pareto_plans(scenario, uav, seed, request.ways, advance, stop=stop, continues=joins_next_leg)
        return list(front.plans) or [front.default]
    new_plan = make_plan(scenario, uav, seed, request.algorithm, advance, stop=stop, continues=joins_next_leg)
    # A single path needs no comparison, so quantities that take longer to compute are omitted.
    length = float(np.linalg.norm(np.diff(new_plan.waypoints, axis=0), axis=1).sum())
    clearance = least_height(make_problem(scenario, uav.limits).certified, new_plan.waypoints)
    return [FrontPlan(new_plan, length, math.nan, clearance, math.nan, math.nan)]


def with_ends(scenario: Scenario, start: tuple[float, ...], destination: tuple[float, ...]) -> Scenario:
    """Return a scenario with another start and destination, both in the air and without a course.

    start, destination: east, north and altitude AMSL, (3,) m.
    """
    spec = scenario.to_json()
    for key, (east, north, altitude) in (("start", start), ("destination", destination)):
        spec[key] = {"east_m": east, "north_m": north, "amsl_m": altitude}
    for key in ("launch", "landing"):
        spec.pop(key, None)
    return scenario_from_spec(spec, scenario.name, ground=scenario.terrain, external=scenario.external)
