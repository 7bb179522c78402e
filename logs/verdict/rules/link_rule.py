"""The link rule: judge the radio link between the ground station and the aircraft along the path.

The link fails if it is below the fade margin for longer than the scenario accepts, or for so long that the autopilot
notices the loss and leaves the mission.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flight.autopilots.parts import LinkLossReaction
from flight.mission.items import LANDINGS, Command
from flight.simulation.track import Track
from logs.verdict.findings import Fact, Finding, make_finding, message
from logs.verdict.measures.link_outages import LinkAlongPath, Outage, link_along_path, station_antenna
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT, Place
from logs.verdict.returns.judge_returns import FlyAgain, Returns, judge_returns, make_return_world
from logs.verdict.returns.return_starts import flown_starts, planned_starts
from logs.verdict.returns.returns_text import ACTION_TEXTS, returns_headline
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.wording import place_text
from world.arrays import Floats
from world.errors import MissionError
from world.radio import RadioLink

# Greatest number of simulated returns to launch in all outages together.  Up to this number, one begins each second.
_MAX_RETURNS = 3000
# Durations below this are printed to a tenth of a second, s.
_SHORT_OUTAGE_S = 10.0
# Smallest diffraction loss that is printed, dB.
_MIN_STATED_LOSS_DB = 0.1
_METHOD = "free-space loss and Bullington's diffraction loss over the terrain, once a second"


@dataclass(frozen=True, slots=True, eq=False)
class JudgedLink:
    """Radio link along a path, and the finding on it.

    finding: finding of the link rule.
    along: the link along the judged path; None if it cannot be computed.
    antenna: position of the station's antenna, m, (3,); None if `along` is None.
    leg: leg with the smallest margin; None if no margin is known.
    returns: returns to launch with which the autopilot reacts to the outages; None if it notices no outage, does not
        return, or has no home to return to.
    """

    finding: Finding
    along: LinkAlongPath | None = None
    antenna: Floats | None = None
    leg: Place | None = None
    returns: Returns | None = None


def link_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge the scenario's radio link with one finding; return [] for a scenario without a link.

    geometric: True to judge the planned path only.
    """
    link = requirements.setup.scenario.link
    return [] if link is None else [judge_link(requirements, aligned, link, geometric=geometric).finding]


def judge_link(
    requirements: RouteRequirements,
    aligned: AlignedTrack | None,
    link: RadioLink,
    *,
    geometric: bool = False,
    fly_again: FlyAgain | None = None,
) -> JudgedLink:
    """Judge a radio link along the planned path if `geometric`, otherwise along the whole flown track.

    fly_again: function that flies an uncertain return to launch again in JSBSim, as for `judge_returns`; None for no
        such flights.
    """
    phases = requirements.ground_phases
    whole_requirements = requirements if phases is None else phases.whole_route
    setup = whole_requirements.setup
    terrain = setup.scenario.terrain
    antenna = None if terrain is None else station_antenna(setup, link, terrain)
    if terrain is None or antenna is None:
        if setup.scenario.terrain is None:
            reason = "no terrain was given"
        else:
            reason = (
                "neither the station's position nor a home is known"
                if link.station is None and setup.mission.home is None
                else "the ground at the station is unknown"
            )
        return JudgedLink(make_finding("link", FLIGHT, ok=None, reason=reason, unit="s"))
    path = whole_requirements.path
    planned = link_along_path(link, terrain, antenna, path.times, path.points)
    track, judged_link = None, planned
    if not geometric:
        track = None if aligned is None else aligned.track if phases is None else phases.track
        if track is None:
            unflown_finding = make_finding(
                "link", FLIGHT, ok=None, reason="nothing was flown", planned=planned.longest_outage, unit="s"
            )
            return JudgedLink(unflown_finding)
        judged_link = link_along_path(link, terrain, antenna, track.time, track.position)
    all_reactions = setup.autopilot.returns.after_link_loss(link.use)
    reactions = [reaction for reaction in all_reactions if reaction.action != "on"]
    # Parts of the outages before the end of the reactions.
    end_time = _end_of_reactions(requirements, aligned if not geometric else None)
    outages = [
        Outage(outage.start, min(outage.end, end_time)) for outage in judged_link.outages if outage.start < end_time
    ]
    is_noticed = any(outage.duration > reaction.delay for outage in outages for reaction in reactions)
    returns, reaction_text = None, ""
    if is_noticed:
        returns = _judge_reaction_returns(whole_requirements, track, outages, reactions, fly_again)
        action_texts = [
            f"{ACTION_TEXTS[reaction.action]} after {reaction.delay:g} s ({reaction.parameter} {reaction.value:g})"
            for reaction in reactions
        ]
        reaction_text = f". If the link is lost, {setup.autopilot.title} {', then '.join(action_texts)}"
        if returns is not None:
            reaction_text += f": {returns_headline(returns)}"
        elif any(reaction.action == "return" for reaction in reactions):
            reaction_text += ": not judged, because the mission has no home"
    elif judged_link.outages and not reactions:
        setting_text = "".join(f" ({reaction.parameter} {reaction.value:g})" for reaction in all_reactions)
        reaction_text = f". If the link is lost, {setup.autopilot.title} continues its mission{setting_text}"
    leg = (
        None
        if judged_link.worst_point < 0
        else _worst_leg(requirements, aligned if not geometric else None, judged_link)
    )
    text = _link_text(judged_link, leg)
    finding = _link_finding(
        link, (planned, judged_link), outages, reactions, (text, reaction_text), geometric=geometric
    )
    return JudgedLink(finding, judged_link, antenna, leg, returns)


# ----------------------------------------------------------------------
# Where and when the autopilot reacts to a loss of the link.


def _end_of_reactions(requirements: RouteRequirements, aligned: AlignedTrack | None) -> float:
    """Return the time from which the autopilot ignores a loss of the link, s; inf if it never does.

    From then on, the aircraft is returning anyway, or ArduPlane is in a landing sequence
    (`Plane::failsafe_in_landing_sequence`).
    aligned: flown track; None for the planned path.
    """
    phases = requirements.ground_phases
    setup = requirements.setup if phases is None else phases.whole_route.setup
    route, waypoints = setup.route, []
    if route.rtl_start is not None:
        waypoints.append(route.rtl_start)
    if setup.autopilot.checks.dialect == "ardupilot":
        for item in setup.mission.items:
            is_reached = route.items > item.seq if item.command == Command.DO_LAND_START else route.items == item.seq
            if item.command in LANDINGS | {Command.DO_LAND_START} and is_reached.any():
                waypoints.append(max(0, int(np.argmax(is_reached)) - 1))
    if not waypoints:
        return math.inf
    waypoint = min(waypoints)
    if aligned is not None:
        is_passed = waypoint < len(aligned.passed) and bool(aligned.passed[waypoint])
        return float(aligned.track.time[aligned.rows[waypoint]]) if is_passed else math.inf
    path = requirements.path
    segment = int(np.searchsorted(path.legs, waypoint))
    return float(path.times[segment]) if segment < len(path.legs) else math.inf


def _judge_reaction_returns(
    requirements: RouteRequirements,
    track: Track | None,
    outages: Sequence[Outage],
    reactions: Sequence[LinkLossReaction],
    fly_again: FlyAgain | None,
) -> Returns | None:
    """Simulate and judge the returns to launch that begin in outages.

    A return begins when the autopilot notices the outage.

    Return None if the autopilot does not react with a return, or for a mission without a home.

    track: flown track; None for the planned path.
    reactions: reactions to a loss of the link, in order of time.
    fly_again: as for `judge_link`.
    """
    if not any(reaction.action == "return" for reaction in reactions):
        return None
    setup = requirements.setup
    try:
        world = make_return_world(setup)
    except MissionError:
        return None
    interval = float(max(1, math.ceil(sum(outage.duration for outage in outages) / _MAX_RETURNS)))
    starts = planned_starts(setup, interval, requirements) if track is None else flown_starts(setup, track, interval)
    # Starts in outages, from the time when the autopilot notices them; one start before and one after each such
    # period is included.
    delay = reactions[0].delay
    is_lost = np.zeros(len(starts), dtype=np.bool_)
    for outage in outages:
        if outage.duration > delay:
            is_lost |= (starts.time > outage.start + delay - interval) & (starts.time < outage.end + interval)
    return judge_returns(world, replace(starts.subset(np.flatnonzero(is_lost)), grounded_count=0), interval, fly_again)


# ----------------------------------------------------------------------
# The finding.


def _link_text(link_along_path: LinkAlongPath, leg: Place | None) -> str:
    """Describe the smallest margin of the link, and the outages.

    The text has the place and time of the smallest margin.

    leg: leg of the smallest margin; None if no margin is known.
    """
    k = link_along_path.worst_point
    if leg is None:
        return "the terrain below the radio path is unknown"
    points, (east, north) = link_along_path.points, link_along_path.positions[k, :2].tolist()
    sight_text = "in line of sight" if points.is_visible[k] else "behind the terrain"
    if points.diffraction_loss[k] >= _MIN_STATED_LOSS_DB:
        sight_text += f", {points.diffraction_loss[k]:.1f} dB lost by diffraction"
    text = (
        f"the link margin is at least {abs(points.margin[k]):.1f} dB above the required fade margin"
        if points.margin[k] >= 0.0
        else f"the link margin is up to {abs(points.margin[k]):.1f} dB below the required fade margin"
    )
    place = (
        f". It is lowest on {place_text(leg)} at {link_along_path.time[k]:.0f} s"
        f" (east {east:.0f} m, north {north:.0f} m,"
        f" {points.distance[k] / 1000.0:.1f} km from the station, {sight_text})"
    )
    if link_along_path.outages:
        count = len(link_along_path.outages)
        times_text = (
            f", {count} times, at most {duration_text(link_along_path.longest_outage)} at a time" if count > 1 else ""
        )
        text += f" for {duration_text(link_along_path.time_below_margin)}{times_text}"
    text += place
    return text if link_along_path.is_known else f"{text}. Elsewhere the terrain below the radio path is unknown"


def duration_text(duration: float) -> str:
    """Return the duration of an outage, s, as text.

    >>> duration_text(0.4), duration_text(123.4)
    ('0.4 s', '123 s')
    """
    return f"{duration:.1f} s" if duration < _SHORT_OUTAGE_S else f"{duration:.0f} s"


def period_text(outage: Outage) -> str:
    """Return the start and the end of an outage as text.

    >>> period_text(Outage(12.34, 12.91)), period_text(Outage(12.34, 99.9))
    ('12.3 to 12.9 s', '12 to 100 s')
    """
    digits = 1 if outage.duration < _SHORT_OUTAGE_S else 0
    return f"{outage.start:.{digits}f} to {outage.end:.{digits}f} s"


def _worst_leg(requirements: RouteRequirements, aligned: AlignedTrack | None, link_along_path: LinkAlongPath) -> Place:
    """Return the leg on which the link has its smallest margin.

    aligned: flown track; None for the planned path.
    """
    time, phases = float(link_along_path.time[link_along_path.worst_point]), requirements.ground_phases
    if aligned is None:
        path = requirements.path
        segment = int(np.searchsorted(path.times, time, side="right")) - 1
        return requirements.leg_place(int(path.legs[min(max(segment, 0), len(path.legs) - 1)]))
    approach = None if phases is None else phases.procedures.approach
    if phases is not None and approach is not None and time > phases.track.time[phases.landing_start_row]:
        return phases.whole_route.leg_place(approach.leg)
    return requirements.leg_place(aligned.leg_at(int(np.searchsorted(aligned.track.time, time))))


def _link_finding(
    link: RadioLink,
    paths: tuple[LinkAlongPath, LinkAlongPath],
    noticeable_outages: Sequence[Outage],
    reactions: Sequence[LinkLossReaction],
    texts: tuple[str, str],
    *,
    geometric: bool,
) -> Finding:
    """Judge the radio link along a path by its longest outage.

    paths: link along the planned path, and along the judged path, which is the planned path if ``geometric``.
    noticeable_outages: outages, without the part in which the autopilot ignores them.
    reactions: reactions of the autopilot to a loss of the link, in order of time.
    texts: texts on the link, and on the reactions to its loss.
    """
    planned, judged = paths
    limits = [(link.max_outage, judged.longest_outage, "scenario")]
    if reactions and noticeable_outages:
        limits.append((reactions[0].delay, max(outage.duration for outage in noticeable_outages), "autopilot"))
    limit, duration, source = min(limits, key=lambda entry: entry[0] - entry[1])
    # An outage at a single point has no duration, but no outage is accepted.
    ok: bool | None = duration <= limit and not (link.max_outage == 0.0 and judged.outages)
    if ok and not judged.is_known:
        ok = None
    (text, reaction_text), points, facts = texts, judged.points, []
    if judged.worst_point >= 0:
        facts = [
            Fact("smallest margin left after the fade margin", float(points.margin[judged.worst_point]), "dB"),
            Fact("time below the fade margin", judged.time_below_margin, "s"),
            Fact("greatest distance from the station", float(points.distance.max()), "m"),
            Fact("least clearance in radii of the first Fresnel zone", float(np.nanmin(points.fresnel_clearance)), ""),
        ]
    return make_finding(
        "link",
        FLIGHT,
        ok=ok,
        reason=text + reaction_text,
        faults=[] if ok else [message(text, reaction_text)],
        planned=planned.longest_outage,
        flown=math.nan if geometric else duration,
        limit=limit,
        source=source,
        tolerance=0.0,
        margin=None if ok is None else limit - duration,
        unit="s",
        method=_METHOD,
        facts=facts,
    )


RULE = Rule(
    name="link",
    judge=link_findings,
    judges_whole_flight=True,
    log=LogNeeds(("heights",)),
)
