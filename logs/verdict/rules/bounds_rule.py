"""The bounds rule: judge the distance of the path from the area's edges, floor and ceiling."""

import math

import numpy as np

from logs.verdict.findings import Finding, make_finding
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.suggestions import suggest_staying_inside
from logs.verdict.tolerances import ROUNDING_M
from logs.verdict.wording import place_text
from world.arrays import Floats


def bounds_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge with one finding the minimum distance inside the area's edges, floor and ceiling.

    The finding is not judged for a mission without a scenario, which has no area.

    geometric: True to judge the planned path only.
    """
    scenario = requirements.setup.scenario
    if scenario.external:
        reason = "the mission came without a scenario, so there is no area to stay in"
        return [make_finding("bounds", FLIGHT, ok=None, reason=reason, unit="m")]
    planned_margin, edge, row = _min_distance_inside(requirements, requirements.points)
    margin, where_text = planned_margin, f"at {place_text(requirements.waypoint_place(row))}"
    ok: bool | None = planned_margin >= -ROUNDING_M
    flown_margin = math.nan
    if not geometric and aligned is None:
        ok, where_text = None, "nothing was flown"
    elif aligned is not None:
        margin, edge, row = _min_distance_inside(requirements, aligned.track.position)
        flown_margin, ok = margin, margin >= -ROUNDING_M
        where_text = f"at {aligned.track.time[row]:.1f} s"
    margin_text = f"{abs(margin):.0f} m {'inside' if margin >= 0.0 else 'beyond'} the {edge} {where_text}"
    return [
        make_finding(
            "bounds",
            FLIGHT,
            ok=ok,
            reason=margin_text if ok is not None else where_text,
            planned=planned_margin,
            flown=flown_margin,
            limit=0.0,
            at_least=True,
            source="scenario",
            tolerance=ROUNDING_M,
            margin=margin if ok is not None else None,
            unit="m",
            method="minimum distance inside the box",
        )
    ]


def _min_distance_inside(requirements: RouteRequirements, points: Floats) -> tuple[float, str, int]:
    """Find the point that is closest to an edge of the area, or farthest outside it.

    Return this distance (m, negative outside the area), the name of the edge, and the row of the point.
    points: positions (east, north, up), m, (n, 3).
    """
    scenario = requirements.setup.scenario
    (west, east), (south, north) = scenario.bounds
    distances = {
        "western edge": points[:, 0] - west,
        "eastern edge": east - points[:, 0],
        "southern edge": points[:, 1] - south,
        "northern edge": north - points[:, 1],
        "floor": points[:, 2] - scenario.floor,
        "ceiling": scenario.ceiling - points[:, 2],
    }
    edge = min(distances, key=lambda name: float(distances[name].min()))
    row = int(np.argmin(distances[edge]))
    return float(distances[edge][row]), edge, row


RULE = Rule(
    name="bounds",
    tolerances=("ROUNDING_M",),
    judge=bounds_findings,
    judges_whole_flight=True,
    suggest=suggest_staying_inside,
    log=LogNeeds(("heights",)),
)
