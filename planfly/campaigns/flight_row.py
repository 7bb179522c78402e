"""Fly and judge one flight of a campaign as `planfly fly` does, and make its row for the tables.

Each column of the tables is a field of `FlightRow`; each rule has columns for its minimum margin and that margin's
place.
"""

import json
import math
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_type_hints

import numpy as np

from flight.mission.route import Route
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.findings import APART_FROM_FLIGHT, Finding, closest_to_limit, undecided_findings
from logs.verdict.measures.path_sweeps import path_spheres
from logs.verdict.places import Place
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.summary import unjudged_parts
from logs.verdict.verdict import Verdict
from planfly.campaigns.campaign_base import CampaignBase, GivenWind, vary_flight
from planfly.campaigns.dispersions import Draw, draw_flight
from planfly.workflow.pipeline import FlightTask, fly_and_judge
from world.arrays import Singles
from world.scenario import Scenario

# ----------------------------------------------------------------------
# Find the marginal passes of a flight: rules that a flight nearly failed, which show the risk better than a pass alone.
#
# A pass is marginal if the distance to the failure of the rule, including the tolerance, is less than the scale of the
# rule's margin.  For a missile, it is marginal if the flight came closer than `SPHERE_SCALE_M` to its sphere.

# Scale of the distance outside a missile's sphere, m.
SPHERE_SCALE_M = 10.0

# Scale of each rule's margin in a campaign, in the margin's unit; None if flights are not ranked by it.  Missiles rank
# flights by the distance outside their spheres, because the time inside a sphere does not show how close a pass was.
MARGIN_SCALES = {rule.name: rule.scale for rule in RULE_WORDS.values()} | {"threat": SPHERE_SCALE_M}

# Rule, place, and margin as a fraction of the rule's scale, 0 to 1.
MarginalPass = tuple[str, Place, float]


def find_marginal_passes(findings: Iterable[Finding], scenario: Scenario, track: Track) -> tuple[MarginalPass, ...]:
    """Return the findings that a flight passed narrowly: the margin is less than the rule's scale.

    Each is a tuple of rule, place, and margin as a fraction of the rule's scale, 0 to 1.  Passes close to the sphere of
    a missile's kill radius follow at the end.
    """
    fractions: dict[tuple[str, Place], float] = {}
    failed_keys = {(finding.rule, finding.place) for finding in findings if finding.ok is False}
    for finding in findings:
        key = finding.rule, finding.place
        scale = RULE_WORDS[finding.rule].scale
        if key in failed_keys or not finding.ok or finding.margin is None or scale is None:
            continue
        fraction = max(0.0, finding.margin + (finding.tolerance or 0.0)) / scale
        if fraction < 1.0:
            fractions[key] = min(fraction, fractions.get(key, fraction))
    threats = scenario.threats
    distances_outside = []
    if not scenario.external and len(track) >= 2:
        visits = path_spheres(track.position, track.time, threats.position, threats.kill_radius, threats.kill_scale)
        distances_outside = [
            (Place("missile", index, name=table.name or ""), float(visits.closest[index] - threats.kill_radius[index]))
            for index, table in enumerate(scenario.spec.threats)
            if threats.kill_radius[index] > 0.0
        ]
    for place, distance in distances_outside:
        if ("threat", place) not in failed_keys and distance < SPHERE_SCALE_M:
            fractions["threat", place] = max(0.0, distance) / SPHERE_SCALE_M
    return tuple((rule, place, fraction) for (rule, place), fraction in fractions.items())


# ----------------------------------------------------------------------
# Data of a flight for the pictures: clearance along the path, and offset at each waypoint.


# Number of equal pieces of the route's length; the minimum clearance on each piece is stored.
STATION_COUNT = 150


def clearance_profile(route: Route, track: Track) -> Singles:
    """Return the minimum height above ground on each of STATION_COUNT equal pieces of the route, m.

    It is NaN for a piece that was not flown.  Each track point belongs to the piece with the nearest point of the leg
    that was flown at that time.
    """
    starts, ends = route.positions[:-1, :2], route.positions[1:, :2]
    lengths = np.hypot(*(ends - starts).T)
    leg_starts = np.concatenate([[0.0], np.cumsum(lengths)])
    leg = np.clip(track.leg, 0, len(lengths) - 1)
    directions = (ends - starts)[leg] / np.maximum(lengths[leg], 1e-9)[:, None]
    distances_along_leg = np.einsum("ij,ij->i", track.position[:, :2] - starts[leg], directions)
    distance = leg_starts[leg] + np.clip(distances_along_leg, 0.0, lengths[leg])
    piece = np.minimum((distance / leg_starts[-1] * STATION_COUNT).astype(int), STATION_COUNT - 1)
    min_clearance = np.full(STATION_COUNT, np.inf, dtype=np.float32)
    np.fmin.at(min_clearance, piece, track.clearance)
    return np.where(np.isfinite(min_clearance), min_clearance, np.float32(np.nan)).astype(np.float32)


def waypoint_crossings(route: Route, track: Track) -> Singles:
    """Return the offset of the track from each stop of the route at the closest approach, m, (s, 2).

    The columns are the offsets to the right and upward.  Right is relative to the mean of the incoming and outgoing
    courses.  Offsets are NaN for a stop that was not reached.  A stop is a waypoint, or the first corner of a loiter or
    return; later corners are omitted, because their number differs between flights.
    """
    points = route.positions
    crossings = np.full((len(points), 2), np.nan, dtype=np.float32)
    steps = np.diff(points[:, :2], axis=0)
    courses = np.unwrap(np.arctan2(steps[:, 0], steps[:, 1]))
    mean_courses = np.concatenate([courses[:1], 0.5 * (courses[:-1] + courses[1:]), courses[-1:]])
    first_waypoints = np.unique(route.stops, return_index=True)[1]
    for waypoint in first_waypoints.tolist():
        point = points[waypoint]
        near_rows = np.flatnonzero((track.leg == waypoint) | (track.leg == waypoint - 1))
        was_passed = len(track) and (track.leg.max() >= waypoint or waypoint == len(points) - 1)
        if not near_rows.size or not was_passed:
            continue
        offsets = track.position[near_rows] - point
        nearest_offset = offsets[np.argmin(offsets[:, 0] ** 2 + offsets[:, 1] ** 2)]
        crossings[waypoint] = (
            nearest_offset[0] * np.cos(mean_courses[waypoint]) - nearest_offset[1] * np.sin(mean_courses[waypoint]),
            nearest_offset[2],
        )
    return crossings[first_waypoints]


# ----------------------------------------------------------------------
# Define the row of a flight, which also defines the columns of every table of flights.

# Outcomes of a flight, in the order of `planfly.campaigns.statistics.decision.Tally`.  A lost flight could not be
# flown, because its workers died.  An undecided flight is not judged in full.
Outcome = Literal["flyable", "not flyable", "lost", "undecided"]
OUTCOMES: tuple[Outcome, ...] = get_args(Outcome)


@dataclass(frozen=True, slots=True)
class MinimumMargin:
    """Minimum margin of a rule in a flight, and its place.

    value: the margin in `unit`; None if no margin is a number.
    """

    value: float | None
    unit: str
    place: Place


@dataclass(frozen=True, slots=True)
class Column:
    """Storage of a field of `FlightRow` in a table.

    kind: type and constraint in SQLite.
    write, read: functions that convert the value of the field to the value of the column, and back.
    entry: shape of each entry of a float32 array that is stored as bytes (a BLOB); () if the entries are numbers.
    same: True if the value is the same for the same flight on every machine.
    """

    kind: str
    write: Callable[[Any], Any] = lambda value: value
    read: Callable[[Any], Any] = lambda value: value
    same: bool = True
    entry: tuple[int, ...] = ()


def _failed_findings_text(failed_findings: Iterable[tuple[str, Place]]) -> str:
    """Return failed rules and places as the JSON text of a table's column."""
    return json.dumps([{"rule": rule, **asdict(place)} for rule, place in failed_findings])


def parse_failed_findings(text: str) -> tuple[tuple[str, Place], ...]:
    """Parse failed rules and places from the JSON text of a column.

    This is the inverse of `_failed_findings_text`.

    >>> parse_failed_findings('[{"rule": "slope", "kind": "leg", "index": 3}]')[0][1].index
    3
    """
    entries = json.loads(text)
    return tuple((entry.pop("rule"), Place(**entry)) for entry in entries)


# Column of a text.
_TEXT = Column("TEXT NOT NULL")
# Column of a number.
_REAL = Column("REAL NOT NULL")
# Column of an array stored as bytes.
_BLOB = Column("BLOB NOT NULL")
# Column of the failed findings, as JSON.
_FAILED_FINDINGS = Column("TEXT NOT NULL", _failed_findings_text, parse_failed_findings)


@dataclass(frozen=True, slots=True)
class FlightRow:
    """Row of a flight in the campaign's table; each field ``Annotated`` with a `Column` is a column.

    The draw has one column for each quantity. The margins have two columns for each rule, and one for `closeness`.
    The tables of `planfly.campaigns.tables` are derived from this class.

    ended: "completed", or the reason why the flight ended early.
    failed: rule and place of each failed finding, in the verdict's order; for an undecided flight, rule and place of
    the findings that leave it undecided.
    undecided_text: rules that leave the flight undecided, with their reasons; "" for a flight that is not undecided.
    margins: minimum margin of each judged rule whose margin has a scale.
    missile_distance: smallest distance outside a missile's sphere, m, negative inside; None if nothing was flown or
    there are no missiles.
    energy_left: remaining energy, Wh; None if nothing was flown.
    duration: duration of the flight, s.
    made_of: hash of all inputs of the flight; "" outside a table.
    clearance, crossings: bytes of the arrays of `clearance_profile` and `waypoint_crossings`; empty if nothing was
    flown.
    seconds: computing time, s.
    worker: name of the worker that flew the flight.
    marginal_passes: marginal passes with their margins; the table of a campaign does not store them.
    undecided: True if some rule is not judged, even if the outcome is "flyable"; the tables do not store it.
    unjudged: rules that are not judged in a flight without failures, with places and reason as in the verdict's
    summary; the tables do not store them.
    """

    draw: Draw
    outcome: Annotated[Outcome, _TEXT]
    ended: Annotated[str, _TEXT]
    failed: Annotated[tuple[tuple[str, Place], ...], _FAILED_FINDINGS] = ()
    undecided_text: Annotated[str, _TEXT] = ""
    margins: tuple[tuple[str, MinimumMargin], ...] = ()
    missile_distance: Annotated[float | None, Column("REAL")] = None
    energy_left: Annotated[float | None, Column("REAL")] = None
    duration: Annotated[float, _REAL] = 0.0
    made_of: Annotated[str, _TEXT] = field(default="", compare=False)
    clearance: Annotated[bytes, _BLOB] = b""
    crossings: Annotated[bytes, Column("BLOB NOT NULL", entry=(2,))] = b""
    seconds: Annotated[float, Column("REAL NOT NULL", same=False)] = 0.0
    worker: Annotated[str, Column("TEXT NOT NULL", same=False)] = ""
    marginal_passes: tuple[MarginalPass, ...] = ()
    undecided: bool = False
    unjudged: tuple[tuple[str, str], ...] = ()

    @property
    def closeness(self) -> float:
        """Smallest ratio of a margin to the scale of its rule, by which flights are sorted.

        It is inf if none is known.
        """
        fractions = (fraction for rule, margin in self.margins if (fraction := scale_margin(rule, margin)) is not None)
        return min((fraction for fraction in fractions if math.isfinite(fraction)), default=math.inf)

    @property
    def failures(self) -> tuple[tuple[str, Place], ...]:
        """Rule and place of each failed finding; () for an undecided flight."""
        return () if self.outcome == "undecided" else self.failed


def scale_margin(rule: str, margin: MinimumMargin) -> float | None:
    """Return a margin divided by the scale of its rule.

    Return None if the margin is unknown or the rule has no scale.
    """
    scale = MARGIN_SCALES[rule]
    return None if margin.value is None or scale is None else margin.value / scale


# Fields of `FlightRow` that are columns, in order, by name, each with the `Column` that annotates it.
COLUMN_FIELDS: dict[str, Column] = {
    name: arguments[-1]
    for name, hint in get_type_hints(FlightRow, include_extras=True).items()
    if (arguments := get_args(hint)) and isinstance(arguments[-1], Column)
}


def fly_one(base: CampaignBase, index: int, wind: GivenWind | None = None, log: Path | None = None) -> FlightRow:
    """Fly one flight of a campaign, and return its row.

    index: number of the flight, from 0.
    wind: mean wind that replaces the scenario's wind; None for the scenario's wind.
    log: file for the recording; None for no recording.
    """
    start_time = time.perf_counter()
    draw = draw_flight(base.dispersions, base.seed, index)
    varied_flight = vary_flight(base, draw, wind)
    task = FlightTask(log, off_nominal=varied_flight.off_nominal, reference="never", findings_only=log is None)
    flight = fly_and_judge(varied_flight.setup, task)
    track, route, verdict = flight.track, varied_flight.setup.route, flight.verdict
    has_rows, failed = len(track) > 0, list_failed_findings(verdict)
    unjudged = find_unjudged_rules(verdict, varied_flight.setup)
    open_rules = {rule for rule, _ in failed} if verdict.undecided and not verdict.flies else set()
    undecided_text = "; ".join(text for rule, text in unjudged if rule in open_rules)
    # Smallest distances outside the spheres of the missiles' kill radii, m.
    distances = (
        finding.nearest_distance
        for finding in verdict.findings
        if finding.rule == "threat" and finding.nearest_distance is not None
    )
    return FlightRow(
        draw=draw,
        outcome="flyable" if verdict.flies else "undecided" if undecided_text else "not flyable",
        ended=flight.ended,
        failed=failed,
        undecided_text=undecided_text,
        margins=find_minimum_margins(verdict.findings),
        missile_distance=min(distances, default=None),
        energy_left=max(0.0, varied_flight.setup.battery - float(track.energy[-1])) if has_rows else None,
        duration=float(track.time[-1]) if has_rows else 0.0,
        clearance=clearance_profile(route, track).tobytes() if has_rows else b"",
        crossings=waypoint_crossings(route, track).tobytes() if has_rows else b"",
        marginal_passes=find_marginal_passes(verdict.findings, varied_flight.setup.scenario, track),
        undecided=verdict.undecided,
        unjudged=unjudged,
        seconds=time.perf_counter() - start_time,
    )


def find_unjudged_rules(verdict: Verdict, setup: FlightSetup) -> tuple[tuple[str, str], ...]:
    """Return the rules not judged by a verdict, each with a text that names the places and the reason.

    Returns () if a rule failed.
    """
    if not (verdict.flyable or verdict.undecided):
        return ()
    texts = dict(unjudged_parts(verdict.findings, setup))
    for finding in undecided_findings(verdict.findings):
        texts.setdefault(finding.rule, f"{RULE_WORDS[finding.rule].title} ({finding.reason})")
    return tuple(texts.items())


def list_failed_findings(verdict: Verdict) -> tuple[tuple[str, Place], ...]:
    """Return the rule and the place of each failed finding of a verdict.

    If a flight without failed findings is not flyable, the undecided findings that prevent it are returned, or else the
    rule `completion`.
    """
    failed_findings = tuple((finding.rule, finding.place) for finding in verdict.findings if finding.ok is False)
    if failed_findings or verdict.flies:
        return failed_findings
    undecided = tuple(
        (finding.rule, finding.place)
        for finding in undecided_findings(verdict.findings)
        if finding.check not in APART_FROM_FLIGHT
    )
    return undecided or (("completion", Place("flight")),)


def find_minimum_margins(findings: tuple[Finding, ...]) -> tuple[tuple[str, MinimumMargin], ...]:
    """Return the smallest margin of each judged rule and its place, in the order of the verdict.

    The tolerance is added to a margin, which is therefore negative only if the rule fails.  The margin of the rule
    `threat` is the distance outside the nearest missile's sphere.  Rules without a scale or a known margin are omitted.

    >>> from logs.verdict.findings import make_finding
    >>> wide, close = (make_finding("slope", Place("leg", 1), ok=True, reason="", margin=m) for m in (9.0, 4.0))
    >>> find_minimum_margins((wide, close))[0][1].value
    4.0
    """
    findings_by_rule: dict[str, list[Finding]] = {}
    for finding in findings:
        if finding.ok is not None and MARGIN_SCALES[finding.rule] is not None:
            is_threat = finding.rule == "threat"
            margin = None if finding.margin is None else finding.margin + (finding.tolerance or 0.0)
            ranked = replace(finding, margin=margin)
            if is_threat:
                ranked = replace(finding, margin=finding.nearest_distance, unit="m")
            findings_by_rule.setdefault(finding.rule, []).append(ranked)
    closest_findings = [closest_to_limit(findings_of_rule) for findings_of_rule in findings_by_rule.values()]
    # A rule that fails for a reason other than its value has no margin.
    return tuple(
        (finding.rule, MinimumMargin(finding.margin, finding.unit, finding.place))
        for finding in closest_findings
        if finding and finding.margin is not None
    )


def make_lost_row(base: CampaignBase, index: int, reason: str) -> FlightRow:
    """Return the row of a flight with the outcome "lost", because it could not be flown.

    index: index of the flight.
    reason: reason for the end of the flight, such as `LOST_REASON`.
    """
    return FlightRow(draw_flight(base.dispersions, base.seed, index), "lost", reason)
