"""The completion rule: planned feasibly, flown to the last waypoint, recorded whole and without contradiction."""

import numpy as np

from logs.verdict.findings import Finding, Message, make_finding, message, reason_of
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT
from logs.verdict.tolerances import CONTRADICTION, GAP_STEPS, LONGEST_GAP


def completion_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, ended: str, whole: bool
) -> list[Finding]:
    """One finding: planned feasibly, flown to the last waypoint, recorded whole and without contradiction."""
    plan = requirements.setup.plan
    faults = []
    if plan is not None and not plan.feasible:
        faults.append(message("the plan is not feasible"))
    if ended != "completed":
        faults.append(message(f"the flight ended early: {ended}"))
    if not whole:
        faults.append(message("the log is damaged or unfinished"))
    legs = 0
    if aligned is None:
        faults.append(message("the track has fewer than two usable rows"))
    else:
        legs = int(aligned.passed[1:].sum())
        if legs < requirements.legs:
            faults.append(message(f"{legs} of {requirements.legs} legs flown"))
        faults += _record_faults(aligned)
    notes = "; ".join(requirements.setup.route.notes)
    reason = reason_of(faults) if faults else f"all {requirements.legs} legs flown"
    return [
        make_finding(
            "completion",
            FLIGHT,
            ok=not faults,
            reason=reason + (f" (not flown as written: {notes})" if notes else ""),
            faults=faults,
            planned=requirements.legs,
            flown=legs,
            limit=requirements.legs,
            source="route",
            tolerance=0.0,
            margin=legs - requirements.legs,
            unit="legs",
            method="waypoints passed in order",
        )
    ]


def _record_faults(aligned: AlignedTrack) -> list[Message]:
    """Pauses in the record, and places where position and velocity contradict each other."""
    track, out = aligned.track, []
    step = np.diff(track.time)
    gap = int(np.argmax(step))
    if step[gap] > max(LONGEST_GAP, GAP_STEPS * float(np.median(step))):
        out.append(message(f"rows are missing from {track.time[gap]:.1f} s to {track.time[gap + 1]:.1f} s"))
    # Where rows are missing the mean velocity says nothing.
    short = step <= LONGEST_GAP
    moved = np.diff(track.position, axis=0)[short] / step[short, None]
    mean = 0.5 * (track.velocity[1:].astype(np.float64) + track.velocity[:-1])[short]
    off = np.sqrt(((moved - mean) ** 2).sum(axis=1))
    if off.size and off.max() > CONTRADICTION:
        k = int(np.argmax(off))
        out.append(message(f"position and velocity contradict each other at {track.time[:-1][short][k]:.2f} s"))
    return out
