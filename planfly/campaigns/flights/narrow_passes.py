"""Where a flight passed narrowly, and by how much: what tells more of the risk than that it did not fail.

A narrow pass is one with less room than the rule's scale (`planfly.campaigns.flights.margin_scales`).  The room is
that to where the rule fails, its tolerance counted; of a missile it is the distance outside its sphere.
"""

from collections.abc import Iterable

from flight.simulation.track import Track
from logs.verdict.findings import Finding
from logs.verdict.measures.path_sweeps import path_spheres
from logs.verdict.places import Place
from planfly.campaigns.flights.margin_scales import COUNTS, SCALES, SPHERE_SCALE
from world.scenario import Scenario

# Rule, place, and room as a share of the rule's scale, 0 to 1.
NarrowPass = tuple[str, Place, float]


def narrow_passes(findings: Iterable[Finding], scenario: Scenario, track: Track) -> tuple[NarrowPass, ...]:
    """Rule, place and room of each narrow pass of a flight, the verdict's order, then missiles.

    Where a rule passes what lies beyond its limit, for reasons of its own, the room is 0.
    """
    room: dict[tuple[str, Place], float] = {}
    failed = {(item.rule, item.place) for item in findings if item.ok is False}
    for item in findings:
        at = item.rule, item.place
        if at in failed or not item.ok or item.margin is None or item.rule in COUNTS:
            continue
        share = max(0.0, item.margin + (item.tolerance or 0.0)) / SCALES[item.rule]
        if share < 1.0:
            room[at] = min(share, room.get(at, share))
    for place, distance in _outside_spheres(scenario, track):
        if ("threat", place) not in failed and distance < SPHERE_SCALE:
            room["threat", place] = max(0.0, distance) / SPHERE_SCALE
    return tuple((rule, place, share) for (rule, place), share in room.items())


def _outside_spheres(scenario: Scenario, track: Track) -> list[tuple[Place, float]]:
    """How far outside each missile's sphere the track stays, m."""
    threats = scenario.threats
    if scenario.external or len(track) < 2:
        return []
    visits = path_spheres(track.position, track.time, threats.position, threats.kill_radius, threats.kill_scale)
    return [
        (Place("missile", m, name=table.name or ""), float(visits.closest[m] - threats.kill_radius[m]))
        for m, table in enumerate(scenario.spec.threats)
        if threats.kill_radius[m] > 0.0
    ]
