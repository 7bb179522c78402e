"""The fence rule: judge how deep planned path and flight violate zones.

They are to stay outside exclusion zones and inside inclusion zones.

The zones are those of the scenario and of the mission's own fence.  The rule judges the path's line, including arcs,
loiters and jumps; it only reports a corridor that reaches into a zone.
"""

import math
from collections.abc import Callable

import numpy as np

from flight.simulation.setup import FlightSetup
from logs.verdict.findings import Fact, Finding, finding_reason, make_finding, message
from logs.verdict.measures.acceptance import position_error
from logs.verdict.measures.path_moves import flown_moves, planned_moves
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.measures.zone_visits import path_zones
from logs.verdict.places import FLIGHT, MISSION
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.suggestions import suggest_shift_past_zone
from logs.verdict.tolerances import ROUNDING_M
from logs.verdict.wording import place_text
from world.airspace.zone_kernels import ZoneRecords, zone_records
from world.airspace.zones import Zone
from world.kernels import Record, Records

_METHOD = "every point of the path's straight segments and arcs, and of the segments between the log's rows"


def make_zone_test(setup: FlightSetup) -> Callable[[Zone], bool]:
    """Return a function that tests if the setup's planned path violates a zone by more than `ROUNDING_M`.

    >>> from logs.recording.example_log import example_log
    >>> from world.airspace.zones import Cylinder
    >>> is_entered = make_zone_test(example_log().setup)  # passes 0, 0
    >>> [is_entered(Zone("mast", "exclusion", Cylinder(0.0, y, 50.0))) for y in (40.0, -60.0)]
    [True, False]
    """
    moves = planned_moves(route_requirements(setup, envelope=False))

    def is_entered(zone: Zone) -> bool:
        """Return True if the planned path violates a zone by more than rounding."""
        return bool(path_zones(moves, zone_records([zone]), setup.scenario.terrain)[0].depth > ROUNDING_M)

    return is_entered


def fence_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Return a finding for each zone that the path or the flight touches; [] without zones.

    If no zone is violated, the first finding states this.  A fence that cannot be converted to zones yields a finding
    that is not judged.

    aligned: the flight; None if nothing was flown.
    geometric: True to judge the planned path only.
    """
    airspace = requirements.airspace
    findings = []
    if airspace.fence_fault:
        findings.append(
            make_finding("fence", MISSION, ok=None, reason=f"the mission's fence is not judged: {airspace.fence_fault}")
        )
    if not airspace.zones:
        return findings
    if not geometric and aligned is None:
        return [*findings, make_finding("fence", FLIGHT, ok=None, reason="nothing was flown", unit="m", method=_METHOD)]
    terrain = requirements.setup.scenario.terrain
    if geometric and requirements.zone_check_legs is not None:
        # Only the zones that the planned path touches on these legs, both included.
        first, last = requirements.zone_check_legs
        start, end = np.searchsorted(requirements.path.legs, [first, last + 1]).tolist()
        numbers = airspace.zones_near(requirements.path.points[start : end + 1])
        records = ZoneRecords(airspace.records.zones[numbers], airspace.records.edges)
        visits_on_legs = path_zones(planned_moves(requirements, first, last), records, terrain)
        touched = np.flatnonzero((visits_on_legs["depth"] > 0.0) | visits_on_legs["unknown"]).tolist()
        return findings + [
            _zone_finding(requirements, int(numbers[k]), visits_on_legs[k], flown_visit=None) for k in touched
        ]
    planned_visits = path_zones(planned_moves(requirements), airspace.records, terrain)
    flown_visits = None if aligned is None else path_zones(flown_moves(aligned), airspace.records, terrain)
    visits = [planned_visits] if flown_visits is None else [planned_visits, flown_visits]
    is_touched = np.any([(visit["depth"] > 0.0) | visit["unknown"] for visit in visits], axis=0)
    zone_findings = [
        _zone_finding(
            requirements,
            zone_number,
            planned_visits[zone_number],
            None if flown_visits is None else flown_visits[zone_number],
        )
        for zone_number in np.flatnonzero(is_touched).tolist()
    ]
    if not any(finding.ok is False for finding in zone_findings):
        moves = planned_moves(requirements) if aligned is None else flown_moves(aligned)
        zone_findings.insert(0, _compliance_finding(requirements, planned_visits, flown_visits, moves))
    return findings + zone_findings


def _compliance_finding(
    requirements: RouteRequirements, planned_visits: Records, flown_visits: Records | None, moves: Records
) -> Finding:
    """Make the finding for a path that violates no zone, with the distance to the nearest zone.

    It names all zones that the judged path passes within the navigation error.

    planned_visits, flown_visits: one record of `logs.verdict.measures.zone_visits.VISIT` for each zone.
    moves: the judged path, of dtype `logs.verdict.measures.path_moves.MOVE`.
    """
    airspace, corridor = requirements.airspace, requirements.setup.corridor
    count = len(airspace.zones)
    visits = planned_visits if flown_visits is None else flown_visits
    nearest_zone = int(visits["depth"].argmax())
    margin = -float(visits[nearest_zone].depth)
    reason = f"none of {count} zones is violated" if count > 1 else "the zone is not violated"
    facts = []
    if math.isfinite(margin) and not visits[nearest_zone].unknown:
        facts = [Fact("nearest", margin, "m"), Fact("less the corridor", margin - corridor, "m")]
        name = place_text(airspace.place(nearest_zone))
        reason += (
            f"; the nearest, {name}, is {margin:.1f} m away at {_event_text(requirements, visits[nearest_zone], 'at')}"
        )
        if margin < corridor:
            reason += f", within the corridor of {corridor:.0f} m about the legs"
        navigation_error = position_error(requirements.setup)
        if margin < navigation_error:
            # Distances of all zones that are so near.  In `visits`, the depth of a zone that is not the nearest may be
            # larger than its real one.
            records, distances = airspace.records, {}
            for zone in np.flatnonzero(visits["depth"] > -navigation_error).tolist():
                zone_record = ZoneRecords(records.zones[zone : zone + 1], records.edges)
                visit = path_zones(moves, zone_record, requirements.setup.scenario.terrain)[0]
                if not visit.unknown and -visit.depth < navigation_error:
                    distances[zone] = -float(visit.depth)
            near_zones = dict(sorted(distances.items(), key=lambda near: near[1]))
            facts.append(Fact("navigation error", navigation_error, "m"))
            facts += [Fact(f"distance to zone {zone}", distance, "m") for zone, distance in near_zones.items()]
            reason += f"; that is less than the navigation error of {navigation_error:.1f} m"
            others = [
                f"{place_text(airspace.place(zone))}, {distance:.1f} m away"
                for zone, distance in near_zones.items()
                if zone != nearest_zone
            ]
            if others:
                reason += f"; so {'is' if len(others) == 1 else 'are'} {' and '.join(others)}"
    return make_finding(
        "fence",
        FLIGHT,
        ok=True,
        reason=reason,
        planned=max(0.0, float(planned_visits["depth"].max())),
        flown=None if flown_visits is None else max(0.0, float(flown_visits["depth"].max())),
        limit=0.0,
        source="zones",
        tolerance=ROUNDING_M,
        margin=margin,
        unit="m",
        method=_METHOD,
        facts=facts,
    )


def _zone_finding(
    requirements: RouteRequirements, zone_number: int, planned_visit: Record, flown_visit: Record | None
) -> Finding:
    """Judge how deep the flight violates one zone, or the planned path if nothing was flown.

    The finding is undecided if no violation is known but the terrain below the zone is partly unknown.
    """
    airspace = requirements.airspace
    zone = airspace.zones[zone_number]
    visit = planned_visit if flown_visit is None else flown_visit
    ok: bool | None = visit.depth <= ROUNDING_M
    if ok and visit.unknown:
        ok = None
    side_text, deepest_text, entry_text, exit_text = ("inside", "deepest", "enters it", "leaves it")
    if zone.kind == "inclusion":
        side_text, deepest_text, entry_text, exit_text = ("outside", "farthest out", "leaves it", "enters it again")
    subject = "path" if flown_visit is None else "flight"
    faults, notes, facts = [], [], list[Fact]()
    if visit.depth > ROUNDING_M:
        facts = [Fact("time beyond", visit.violation_time, "s"), Fact("entries", float(visit.entries), "1")]
        for event in ("entry", "exit"):
            for coordinate, unit in (("time", "s"), ("east", "m"), ("north", "m"), ("up", "m"), ("leg", "1")):
                facts.append(Fact(f"{event} {coordinate}", float(visit[f"{event}_{coordinate}"]), unit))
        faults.append(
            message(
                f"{visit.depth:.1f} m {side_text}",
                f" for {visit.violation_time:.1f} s in all"
                + (f", in {visit.entries} visits" if visit.entries > 1 else "")
                + f". The {subject} {entry_text} at {_event_text(requirements, visit, 'entry')}, is {deepest_text} at"
                f" {visit.at_time:.1f} s, and {exit_text} at {visit.exit_time:.1f} s",
            )
        )
    elif visit.depth > 0.0:
        notes.append("touches the zone's edge")
    if visit.unknown:
        notes.append("the zone's limits are heights above ground, and the terrain is unknown in places")
    if flown_visit is not None and planned_visit.depth > ROUNDING_M:
        notes.append(
            f"the planned path is {planned_visit.depth:.1f} m {side_text}"
            f" at {_event_text(requirements, planned_visit, 'at')}"
        )
    # Without a scenario, a zone given on the command line has the source "fence".
    zone_source = (
        "mission"
        if zone_number >= requirements.airspace.scenario_zone_count
        else ("fence" if requirements.setup.scenario.external else "scenario")
    )
    return make_finding(
        "fence",
        airspace.place(zone_number),
        ok=ok,
        reason=finding_reason(faults, notes),
        faults=faults,
        planned=max(0.0, planned_visit.depth),
        flown=None if flown_visit is None else max(0.0, flown_visit.depth),
        limit=0.0,
        source=zone_source,
        tolerance=ROUNDING_M,
        margin=-visit.depth,
        unit="m",
        method=_METHOD,
        facts=facts,
    )


def _event_text(requirements: RouteRequirements, visit: Record, event: str) -> str:
    """Describe the time, position and leg of an event of a visit to a zone.

    event: "entry" or "exit" of the violation, or "at" for its deepest point or, without a violation, for the point
        that is closest to one.
    """
    leg = place_text(requirements.leg_place(int(visit[f"{event}_leg"])))
    time, east, north, up = (visit[f"{event}_{name}"] for name in ("time", "east", "north", "up"))
    return f"{time:.1f} s on {leg}, east {east:.0f} m, north {north:.0f} m, {up:.0f} m AMSL"


RULE = Rule(
    name="fence",
    tolerances=("ROUNDING_M",),
    judge=fence_findings,
    suggest=suggest_shift_past_zone,
    log=LogNeeds(("heights",)),
)
