"""Fly a mission, try the suggestions of its findings, or plan a path in the studio's worker processes.

Arguments are pickled, and results are plain data.  Returns and campaigns, which take longer, are in
`planfly.studio.long_worker_tasks`.
"""

import math
import pickle
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from flight.mission.items import Mission
from flight.simulation.track import Track
from logs.verdict.judge_geometry import with_passing_suggestions
from logs.views.failures import track_distance
from planfly.planning.pareto_plans import make_pareto_plans
from planfly.studio.changes import flight_figures
from planfly.studio.edit_context import EditContext
from planfly.studio.pilot import Advance
from planfly.studio.states import place_states
from planfly.studio.view_model import findings_json, rounded, states_json, verdict_json
from planfly.workflow.airframe import Airframe
from planfly.workflow.apply_suggestion import can_apply
from planfly.workflow.make_plan import make_plan
from planfly.workflow.mission_context import JudgedMission
from planfly.workflow.pipeline import fly_and_judge
from planfly.workflow.suggestion_trials import MAX_TRIAL_FLIGHTS, SuggestionTrials, tried_suggestions
from planner.search.plan_front import FrontPlan
from world.arrays import Floats
from world.scenario import Scenario, from_spec

# Maximum duration of a search for one path, for which a user waits, s.
SECONDS = 25.0
# Maximum duration of a search for several paths, s.
SECONDS_FOR_SEVERAL = 60.0
# Maximum number of rows of a flown track that the page draws.
_MAX_DRAWN_ROWS = 1_500


def fly(payload: tuple[EditContext, Mission], advance: Advance) -> dict[str, Any]:
    """Fly a mission with its simulated autopilot, judge the flight, and return the results as page data.

    Its findings are without suggestions, which `try_suggestions` tries: a failed flight's "judged" is for it, pickled.
    """
    desk, mission = payload
    setup = desk.setup(mission)
    flown = fly_and_judge(setup, desk.airframe, None, advance, reference="never")
    judged = JudgedMission(mission, setup, flown.requirements, flown.verdict)
    untried = replace(flown.verdict, findings=with_passing_suggestions(flown.verdict.findings, ()))
    states = place_states(flown.requirements, flown.verdict.findings)
    seconds = round(float(flown.track.time[-1]), 1) if len(flown.track) else 0.0
    return {
        "verdict": verdict_json(flown.verdict),
        "findings": findings_json(untried),
        "judged": pickle.dumps(judged) if flown.verdict.failed else b"",
        "states": states_json(states, 0, setup.route.legs),
        "violated": {"threats": sorted(states.threats), "zones": sorted(states.zones)},
        "ended": flown.ended,
        "autopilot": setup.autopilot.title,
        "seconds": seconds,
        "figures": flight_figures(mission, setup.route, flown.verdict.findings, seconds),
        **_track_json(setup.route.waypoints, flown.track, flown.verdict.leg_ends),
    }


def try_suggestions(payload: tuple[EditContext, bytes], advance: Advance) -> dict[str, Any]:
    """Return the findings of a flight as page data, with the suggestions that pass a trial flight, and their missions.

    The missions are by numbers of finding and suggestion; a suggestion that changes no item has none.
    """
    desk, pickled = payload
    judged: JudgedMission = pickle.loads(pickled)

    def report() -> bool:
        advance(0.0, MAX_TRIAL_FLIGHTS, "trying suggestions")
        return False

    passed = SuggestionTrials(desk, judged, report).passing()
    findings = with_passing_suggestions(judged.verdict.findings, tried_suggestions(passed))
    missions = {
        (number, which): one.setup.mission
        for number, item in enumerate(judged.verdict.findings)
        for which, suggestion in enumerate(findings[number].suggestions)
        for one in passed
        if one.finding is item and one.suggestion == suggestion and can_apply(suggestion)
    }
    return {"findings": findings_json(replace(judged.verdict, findings=findings)), "missions": missions}


def _track_json(route: Floats, track: Track, leg_ends: Sequence[float]) -> dict[str, Any]:
    """Return a flown track for the map, and its progress along the route for the profile.

    leg_ends: time at which each leg but the last ended, by the verdict, s; these times replace the guidance's record.
    """
    if not len(track):
        return {"track": [], "along": []}
    if len(leg_ends) == len(route) - 2:
        track = replace(track, leg=np.searchsorted(np.array(leg_ends), track.time).astype(track.leg.dtype))
    rows = np.union1d(np.arange(0, len(track), max(1, len(track) // _MAX_DRAWN_ROWS)), [len(track) - 1])
    along = np.asarray(track_distance(route, track))
    return {"track": rounded(track.position[rows]), "along": rounded(along[rows]), "time": rounded(track.time[rows])}


# ----------------------------------------------------------------------
# Plan paths.


@dataclass(frozen=True, slots=True)
class PlanAsked:
    """Request to plan between two places in the world of a scenario.

    ends: start and destination, (2, 3), m; None for the ends of the scenario.
    algorithm: name of the algorithm; None for the default.
    ways: maximum number of paths; if there are several, no path is better than another in all of length, exposure,
    clearance and energy.
    """

    scenario: Scenario
    airframe: Airframe
    seed: int
    algorithm: str | None = None
    ends: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    ways: int = 1


def plan(asked: PlanAsked, advance: Advance) -> list[FrontPlan]:
    """Plan one or several paths, the shortest first; if no path is safe, return the best one."""
    scenario = asked.scenario if asked.ends is None else between(asked.scenario, *asked.ends)
    seconds = SECONDS if asked.ways == 1 else SECONDS_FOR_SEVERAL
    airframe, seed, stop = asked.airframe, asked.seed, partial(_stop_reason, time.monotonic() + seconds)
    # Between two items of a mission, the path must join the leg after the second.
    onward = asked.ends is not None
    if asked.ways > 1:
        front = make_pareto_plans(scenario, airframe, seed, asked.ways, advance, stop=stop, continues=onward)
        return list(front.plans) or [front.default]
    made = make_plan(scenario, airframe, seed, asked.algorithm, advance, stop=stop, continues=onward)
    # A single path needs no comparison, so quantities that take longer to compute are left out.
    length = float(np.linalg.norm(np.diff(made.waypoints, axis=0), axis=1).sum())
    clearance = float(made.certificate.clearance) + scenario.limits.min_clearance_m
    return [FrontPlan(made, length, math.nan, clearance, math.nan, math.nan)]


def _stop_reason(deadline: float) -> str:
    """Return the reason to end a search, or "" to go on."""
    return "budget" if time.monotonic() > deadline else ""


def between(scenario: Scenario, start: tuple[float, ...], destination: tuple[float, ...]) -> Scenario:
    """Return a scenario with other ends in the air, without courses.  start, destination: (3,), m."""
    spec = scenario.to_json()
    for key, (east, north, up) in (("start", start), ("destination", destination)):
        spec[key] = {"east_m": east, "north_m": north, "amsl_m": up}
    for key in ("launch", "landing"):
        spec.pop(key, None)
    return from_spec(spec, scenario.name, ground=scenario.terrain, external=scenario.external)
