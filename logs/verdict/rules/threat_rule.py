"""The threat rule: judge time and exposure inside the spheres of missiles and radars.

Both are judged as planned and as flown.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from logs.verdict.findings import Fact, Finding, make_finding
from logs.verdict.measures.acceptance import position_error
from logs.verdict.measures.path_sweeps import SphereVisits, path_spheres
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT, Place
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.suggestions import suggest_wider_berth
from logs.verdict.wording import place_text
from world.threats import threat_label

SphereKind = Literal["missile", "radar"]

_METHOD = "time inside, exact on each segment"


def threat_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge each missile or radar sphere that the planned path or the flight touches.

    If the judged path enters no missile sphere, the first finding states this and the distance from the nearest one.
    The judged path is the flown track, or the planned path if ``geometric``.  Without a scenario, return one unjudged
    finding.
    """
    scenario = requirements.setup.scenario
    if scenario.external:
        reason = "the mission came without a scenario, so threats are unknown"
        return [make_finding("threat", FLIGHT, ok=None, reason=reason, unit="s")]
    threats = scenario.threats
    findings: list[Finding] = []
    nearest_distance, nearest_name = math.inf, ""
    for kind in ("missile", "radar"):
        radii, scales = (
            (threats.kill_radius, threats.kill_scale)
            if kind == "missile"
            else (threats.detection_radius, threats.detection_scale)
        )
        planned_visits = path_spheres(
            requirements.path.points, requirements.path.times, threats.position, radii, scales
        )
        flown_visits = None
        if aligned is not None:
            flown_visits = path_spheres(aligned.track.position, aligned.track.time, threats.position, radii, scales)
        for number, threat in enumerate(scenario.spec.threats):
            if radii[number] <= 0.0:
                continue
            if kind == "missile":
                judged_visits = planned_visits if geometric or flown_visits is None else flown_visits
                distance = float(judged_visits.closest[number] - radii[number])
                if distance < nearest_distance:
                    nearest_distance, nearest_name = distance, threat_label(threat.name or "", number)
            if planned_visits.closest[number] <= radii[number] or (
                flown_visits is not None and flown_visits.closest[number] <= radii[number]
            ):
                visit = None if geometric else _sphere_visit(flown_visits, number)
                place = Place(kind, number, name=threat.name or "")
                planned_visit = _sphere_visit(planned_visits, number)
                findings.append(
                    _sphere_finding(requirements, aligned, place, planned_visit, visit, float(radii[number]))
                )
    if all(finding.ok for finding in findings if finding.place.kind == "missile"):
        navigation_error = position_error(requirements.setup)
        findings.insert(
            0,
            _no_entry_finding(
                len(threats), nearest_distance, nearest_name, navigation_error, aligned is not None or geometric
            ),
        )
    return findings


@dataclass(frozen=True, slots=True)
class _Visit:
    """Visit of a path to one sphere; all values are NaN if nothing was flown.

    time_inside: time inside the sphere, s.
    exposure: time weighted by the closeness to the sphere's center, s.
    closest: minimum distance from the sphere's center, m.
    closest_time: time of the minimum distance, s.
    """

    time_inside: float = math.nan
    exposure: float = math.nan
    closest: float = math.nan
    closest_time: float = math.nan


def _sphere_visit(visits: SphereVisits | None, threat: int) -> _Visit:
    """Return the visit to the sphere of one threat, by its index; all values are NaN if `visits` is None."""
    if visits is None:
        return _Visit()
    columns = (visits.time_inside, visits.exposure, visits.closest, visits.closest_time)
    return _Visit(*(float(column[threat]) for column in columns))


def _no_entry_finding(
    threat_count: int, nearest_distance: float, nearest_name: str, navigation_error: float, is_judged: bool
) -> Finding:
    """Make the finding for a path that enters no missile sphere.

    threat_count: number of missiles and radars.
    nearest_distance: minimum distance of the path from the nearest sphere's surface, m; inf without a sphere.
    nearest_name: name of the threat of this sphere.
    navigation_error: possible position error of the navigation, m.
    is_judged: False if nothing was flown, so that the finding is not judged.
    """
    reason = "the scenario has no threats"
    if threat_count == 1:
        has_sphere = math.isfinite(nearest_distance)
        reason = "the missile sphere of the only threat is not entered" if has_sphere else "the only threat is a radar"
    elif threat_count:
        reason = f"none of the missile spheres of {threat_count} threats is entered"
    facts = []
    if math.isfinite(nearest_distance):
        facts.append(Fact("nearest", nearest_distance, "m"))
        reason += (
            f"; the nearest, {nearest_name}, stays {nearest_distance:.{0 if nearest_distance >= 100.0 else 1}f} m away"
        )
        if navigation_error > 0.0:
            facts.append(Fact("navigation error", navigation_error, "m"))
            reason += (
                f", or {nearest_distance - navigation_error:.1f} m after the navigation error of"
                f" {navigation_error:.1f} m is subtracted"
            )
    return make_finding(
        "threat",
        FLIGHT,
        ok=True if is_judged else None,
        reason=reason if is_judged else "nothing was flown",
        planned=0.0,
        flown=0.0 if is_judged else None,
        limit=0.0,
        source="scenario",
        tolerance=0.0,
        margin=0.0,
        unit="s",
        method=_METHOD,
        facts=facts if is_judged else (),
    )


def _sphere_finding(
    requirements: RouteRequirements,
    aligned: AlignedTrack | None,
    place: Place,
    planned_visit: _Visit,
    flown_visit: _Visit | None,
    radius: float,
) -> Finding:
    """Make the finding on a sphere: an entered missile sphere fails, and a radar sphere always passes.

    flown_visit: visit of the flown track; None to judge the planned visit.
    radius: radius of the sphere, m.
    """
    judged_visit = planned_visit if flown_visit is None else flown_visit
    is_missing = math.isnan(judged_visit.closest)
    zone_name = "detection" if place.kind == "radar" else "kill"
    facts = (
        f"the planned path is inside the {zone_name} zone (radius {radius:.0f} m) for {planned_visit.time_inside:.1f} s"
        f" (weighted by distance: {planned_visit.exposure:.3g} s)"
    )
    if flown_visit is not None and not is_missing:
        facts += (
            f"; the flight was inside for {flown_visit.time_inside:.1f} s"
            f" (weighted by distance: {flown_visit.exposure:.3g} s)."
            f" It came within {flown_visit.closest:.0f} m of the missile site or radar"
        )
        facts += f" at {flown_visit.closest_time:.1f} s"
        is_entered = place.kind == "missile" and flown_visit.closest <= radius
        if is_entered and aligned is not None and not math.isnan(flown_visit.closest_time):
            time = aligned.track.time
            k = max(0, min(len(time) - 2, int(np.searchsorted(time, flown_visit.closest_time, side="right")) - 1))
            fraction = float((flown_visit.closest_time - time[k]) / (time[k + 1] - time[k]))
            leg = requirements.leg_place(aligned.leg_at(k))
            facts += f" on {place_text(leg)} {aligned.position_text(k, fraction)}"
    flown_time = None if flown_visit is None else flown_visit.time_inside
    if place.kind == "radar":
        return make_finding(
            "threat",
            place,
            ok=True,
            reason=f"for information only, because detection is not limited: {facts}",
            planned=planned_visit.time_inside,
            flown=flown_time,
            unit="s",
            method=_METHOD,
        )
    ok = None if is_missing else judged_visit.closest > radius
    return make_finding(
        "threat",
        place,
        ok=ok,
        reason=facts if ok is not False else f"inside the missile's range: {facts}",
        planned=planned_visit.time_inside,
        flown=flown_time,
        limit=0.0,
        source="scenario",
        tolerance=0.0,
        margin=-judged_visit.time_inside,
        unit="s",
        method=_METHOD,
        facts=() if is_missing else [Fact("nearest", judged_visit.closest - radius, "m")],
    )


RULE = Rule(
    name="threat",
    tolerances=("NAVIGATION_SIGMAS", "SPHERE_FAR_DIAGONALS", "SPHERE_STAY_TOLERANCE_S"),
    judge=threat_findings,
    suggest=suggest_wider_berth,
    log=LogNeeds(("heights",)),
)
