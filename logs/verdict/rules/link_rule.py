"""The link rule: judge the radio link between the ground station and the aircraft along the path.

The link fails where less than the fade margin is left for longer than the scenario accepts, or for as long as the
autopilot needs to notice the loss and leave the mission.
"""

import math

import numpy as np

from flight.autopilots.parts import Cause
from logs.verdict.findings import Fact, Finding, make_finding, message
from logs.verdict.measures.link_outages import LinkAlongPath, Outage, link_along_path, station_antenna
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT
from logs.verdict.returns.judge_returns import ReturnWorld, judge_returns, make_return_world
from logs.verdict.returns.return_starts import ReturnStarts, flown_starts, planned_starts
from logs.verdict.returns.returns_text import headline
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.tolerances import LINK_LOSS_REACTION_S
from world.errors import MissionError
from world.radio import LinkUse, RadioLink

# Causes (`ReturnBehaviour.causes` of an autopilot) that the loss of a link triggers.
_LOSS_CAUSES: dict[LinkUse, tuple[str, ...]] = {
    "telemetry": ("station lost",),
    "control": ("RC lost for 1.5 s", "RC lost"),
}
# Time between two returns from an outage, s.
_RETURN_INTERVAL_S = 5.0
_METHOD = "free-space loss and Bullington's diffraction loss over the terrain, once a second"


def link_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the scenario's radio link with one finding; [] for a scenario without a link."""
    setup = requirements.setup
    link, terrain = setup.scenario.link, setup.scenario.terrain
    if link is None:
        return []
    antenna = None if terrain is None else station_antenna(setup, link, terrain)
    if terrain is None or antenna is None:
        missing = "no terrain was given" if terrain is None else "neither the station's position nor a home is known"
        return [make_finding("link", FLIGHT, ok=None, reason=missing, unit="s")]
    planned = link_along_path(link, terrain, antenna, requirements.path.times, requirements.path.points)
    reaction = _loss_reaction(requirements, link)
    limit = link.max_outage if reaction is None else min(link.max_outage, LINK_LOSS_REACTION_S)
    if geometric:
        return [_link_finding(requirements, None, (planned, planned), limit, reaction)]
    if aligned is None:
        return [
            make_finding("link", FLIGHT, ok=None, reason="nothing was flown", planned=planned.longest_outage, unit="s")
        ]
    flown = link_along_path(link, terrain, antenna, aligned.track.time, aligned.track.position)
    return [_link_finding(requirements, aligned, (planned, flown), limit, reaction)]


def _link_text(link_on_path: LinkAlongPath) -> str:
    """Describe the smallest margin of the link and its outages."""
    k = link_on_path.worst
    if k < 0:
        return "the terrain below the radio path is unknown"
    points = link_on_path.points
    sight_text = "in line of sight" if points.is_visible[k] else "behind the terrain"
    text = (
        f"{abs(points.margin[k]):.1f} dB {'above' if points.margin[k] >= 0.0 else 'below'} the fade margin"
        f" at {link_on_path.time[k]:.0f} s, {points.distance[k] / 1000.0:.1f} km from the station, {sight_text}"
    )
    if link_on_path.outages:
        count = len(link_on_path.outages)
        times_text = f", {count} times, at most {link_on_path.longest_outage:.0f} s at a time" if count > 1 else ""
        text += f"; below the fade margin for {link_on_path.time_below_margin:.0f} s{times_text}"
    return text if link_on_path.is_known else f"{text}; elsewhere the terrain below the radio path is unknown"


def _loss_reaction(requirements: RouteRequirements, link: RadioLink) -> Cause | None:
    """Return the failsafe by which the autopilot leaves its mission when this link is lost.

    Return None if the autopilot continues its mission, or if its reaction is unknown.
    """
    world = _make_return_world(requirements)
    causes = () if world is None else world.causes
    reactions = [cause for cause in causes if cause.name in _LOSS_CAUSES[link.use]]
    return next((cause for cause in reactions if cause.action not in ("on", "never", "landed")), None)


def _make_return_world(requirements: RouteRequirements) -> ReturnWorld | None:
    """Return the conditions for simulated returns, or None for a mission without a home."""
    try:
        return make_return_world(requirements.setup)
    except MissionError:
        # Without a home nothing returns.
        return None


def _reaction_text(
    requirements: RouteRequirements, aligned: AlignedTrack | None, outages: tuple[Outage, ...], reaction: Cause | None
) -> str:
    """Describe the autopilot's reaction to the outages that it notices, and the result of its returns from them."""
    world = _make_return_world(requirements)
    title = requirements.setup.autopilot.title
    if world is None or world.has_other_law:
        return f"; the reaction of {title} to the loss is not judged"
    if reaction is None:
        return f"; {title} continues its mission without the link"
    if not reaction.is_return:
        return f"; {title} then leaves the mission ({reaction.parameter} {reaction.value})"
    setup = requirements.setup
    starts = (
        planned_starts(setup, _RETURN_INTERVAL_S)
        if aligned is None
        else flown_starts(setup, aligned.track, _RETURN_INTERVAL_S)
    )
    returns = judge_returns(world, _starts_in_outages(starts, outages), _RETURN_INTERVAL_S)
    return f"; {title} then returns ({reaction.parameter} {reaction.value}): {headline(returns)}"


def _starts_in_outages(starts: ReturnStarts, outages: tuple[Outage, ...]) -> ReturnStarts:
    """Return the starts of returns that lie in an outage, from the time at which the autopilot notices the outage.

    One start before and after this time is included.
    """
    is_lost = np.zeros(len(starts), dtype=np.bool_)
    for outage in outages:
        notice_time = outage.start + LINK_LOSS_REACTION_S
        is_lost |= (starts.time >= notice_time - _RETURN_INTERVAL_S) & (starts.time <= outage.end + _RETURN_INTERVAL_S)
    return starts.subset(np.flatnonzero(is_lost))


def _link_finding(
    requirements: RouteRequirements,
    aligned: AlignedTrack | None,
    paths: tuple[LinkAlongPath, LinkAlongPath],
    limit: float,
    reaction: Cause | None,
) -> Finding:
    """Judge the radio link along a path by its longest outage.

    paths: link along the planned path and along the judged path; both are the planned path before a flight.
    limit: longest accepted outage, s.
    reaction: failsafe by which the autopilot leaves the mission, or None.
    """
    planned, judged = paths
    ok: bool | None = judged.longest_outage <= limit
    if ok and not judged.is_known:
        ok = None
    text, reason, points = _link_text(judged), _link_text(judged), judged.points
    if judged.longest_outage >= LINK_LOSS_REACTION_S:
        reason += _reaction_text(requirements, aligned, judged.outages, reaction)
    facts = []
    if judged.worst >= 0:
        facts = [
            Fact("smallest margin left after the fade margin", float(points.margin[judged.worst]), "dB"),
            Fact("time below the fade margin", judged.time_below_margin, "s"),
            Fact("greatest distance from the station", float(points.distance.max()), "m"),
            Fact("least clearance in radii of the first Fresnel zone", float(np.nanmin(points.fresnel_clearance)), ""),
        ]
    return make_finding(
        "link",
        FLIGHT,
        ok=ok,
        reason=reason,
        faults=[] if ok else [message(text, reason[len(text) :])],
        planned=planned.longest_outage,
        flown=math.nan if aligned is None else judged.longest_outage,
        limit=limit,
        source="scenario",
        tolerance=0.0,
        margin=None if ok is None else limit - judged.longest_outage,
        unit="s",
        method=_METHOD,
        facts=facts,
    )


RULE = Rule(
    name="link",
    tolerances=("LINK_LOSS_REACTION_S",),
    judge=link_findings,
    judges_whole_flight=True,
    log=LogNeeds(("heights",)),
)
