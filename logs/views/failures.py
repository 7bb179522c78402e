"""Find where on a route rules failed, how charts name these places, and distances along the route."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flight.simulation.track import Track
from logs.verdict.findings import Finding
from logs.verdict.places import Place, PlaceKind
from logs.verdict.rule_words import rule_word
from logs.verdict.verdict import Verdict
from logs.verdict.wording import place_text
from logs.views.charts import Label
from world.arrays import Floats
from world.geometry import leg_runs
from world.threats import Threats

# Largest number of labels; more would cover the places that they describe.
_MAX_LABELS = 16


@dataclass(frozen=True, slots=True)
class Failures:
    """The places at which rules of a verdict failed.

    legs, waypoints: names of the rules that failed at a leg or waypoint, keyed by its number, as in
        ``{7: ("slope",)}``; each rule once, in the verdict's order.
    threats: missiles and radars for which a rule failed, because their range was entered; each once.
    places: the verdict's description of each failing place, keyed by kind and number.
    """

    legs: dict[int, tuple[str, ...]]
    waypoints: dict[int, tuple[str, ...]]
    threats: tuple[Place, ...] = ()
    places: dict[tuple[PlaceKind, int], Place] = field(default_factory=dict)

    def __bool__(self) -> bool:
        """Return True if a rule failed at any leg, waypoint or threat."""
        return bool(self.legs or self.waypoints or self.threats)

    def place_name(self, kind: PlaceKind, number: int) -> str:
        """Return the name of a leg or a waypoint in the verdict; the kind and the number if it did not fail.

        >>> Failures({7: ("slope",)}, {}, places={("leg", 7): Place("leg", 7, to_item=9)}).place_name("leg", 7)
        'leg 7 (to item 9)'
        >>> Failures({7: ("slope",)}, {}).place_name("leg", 7)
        'leg 7'
        """
        return place_text(self.places.get((kind, number), Place(kind, number)))

    def threat_names(self) -> dict[int, str]:
        """Return the verdict's name of each failing threat, keyed by the threat's index.

        A threat that fails both as a missile and as a radar has the name of the missile.
        """
        radars_first = sorted(self.threats, key=lambda place: place.kind == "missile")
        return {place.index or 0: place_text(place) for place in radars_first}


def collect_failures(verdict: Verdict | None, waypoint_count: int) -> Failures:
    """Collect the failures of a verdict by place; none without a verdict.

    waypoint_count: number of waypoints of the route; failures at higher leg or waypoint numbers are ignored.
    """
    failed_findings = [finding for finding in verdict.findings if finding.ok is False] if verdict is not None else []
    places = [finding.place for finding in failed_findings if finding.place.index is not None]
    return Failures(
        legs=_collect_failed_rules(failed_findings, "leg", waypoint_count - 1),
        waypoints=_collect_failed_rules(failed_findings, "waypoint", waypoint_count),
        threats=tuple(dict.fromkeys(place for place in places if place.kind in ("missile", "radar"))),
        places={(place.kind, place.index or 0): place for place in places},
    )


def _collect_failed_rules(failed_findings: list[Finding], kind: PlaceKind, count: int) -> dict[int, tuple[str, ...]]:
    """Return the names of the rules that failed at each leg or waypoint, keyed by its number.

    kind: kind of place to select, "leg" or "waypoint".
    count: numbers from `count` on are ignored.
    """
    rules_by_place: dict[int, list[str]] = {}
    for finding in failed_findings:
        place = finding.place
        if place.kind == kind and place.index is not None and place.index < count:
            rules = rules_by_place.setdefault(place.index, [])
            rule_name = rule_word(finding.rule)
            if rule_name not in rules:
                rules.append(rule_name)
    return {number: tuple(rules) for number, rules in sorted(rules_by_place.items())}


def stop_start_indices(stops: Sequence[int]) -> list[int]:
    """Return the index of the first waypoint of each stop.

    A stop is a place of the mission that has a number in messages; a loiter is one stop with several waypoints.

    stops: number of the stop to which each waypoint belongs, in flying order.

    >>> stop_start_indices([0, 1, 1, 1, 2])
    [0, 1, 4]
    """
    return [k for k in range(len(stops)) if k == 0 or stops[k] != stops[k - 1]]


def route_distance(waypoints: Floats) -> Floats:
    """Return the horizontal distance along the route at which each waypoint lies, (w,), m."""
    return np.concatenate([[0.0], np.cumsum(leg_runs(waypoints))])


def route_samples(waypoints: Floats, step: float) -> tuple[Floats, Floats]:
    """Sample a route at its waypoints and at even distances, so that samples are at most `step` (m) apart.

    Return the horizontal distance along the route, m, (s,), and the position, m, (s, 3), of each sample.
    """
    waypoint_distances = route_distance(waypoints)
    count = max(2, int(np.ceil(waypoint_distances[-1] / step)) + 1) if waypoint_distances[-1] > 0.0 else 2
    distance = np.union1d(np.linspace(0.0, waypoint_distances[-1], count), waypoint_distances)
    return distance, np.column_stack([np.interp(distance, waypoint_distances, waypoints[:, axis]) for axis in range(3)])


def paths_differ(first_path: Floats, second_path: Floats, tolerance: float) -> bool:
    """Return True if a corner of either path is farther than `tolerance` (m) from the other path.

    first_path, second_path: corners of the paths, m, (n, 3) and (k, 3).
    """
    return (
        max(_compute_max_distance(first_path, second_path), _compute_max_distance(second_path, first_path)) > tolerance
    )


def _compute_max_distance(points: Floats, path: Floats) -> float:
    """Return the largest distance of any point (n, 3) from a path with corners (k, 3), m."""
    start, step = path[:-1], np.diff(path, axis=0)
    length_square = (step**2).sum(axis=1)
    max_distance = 0.0
    for point in points:
        dot_product = ((point - start) * step).sum(axis=1)
        fraction = np.clip(
            np.divide(dot_product, length_square, out=np.zeros_like(dot_product), where=length_square > 0.0), 0.0, 1.0
        )
        nearest_point = start + fraction[:, None] * step
        max_distance = max(max_distance, float(np.sqrt(((nearest_point - point) ** 2).sum(axis=1).min())))
    return max_distance


def track_distance(waypoints: Floats, track: Track) -> Floats:
    """Return how far along the route each row of a track is, m, (t,); the distance never decreases.

    A row's position is projected onto the leg that is active in it, and limited to the leg's ends.  A row without a
    position gets the distance of the row before it.

    waypoints: waypoints of the route, m, (w, 3).
    """
    waypoint_distances = route_distance(waypoints)
    leg = np.clip(track.leg.astype(np.intp), 0, len(waypoints) - 2)
    start, end = waypoints[leg, :2], waypoints[leg + 1, :2]
    step = end - start
    length_square = (step**2).sum(axis=1)
    dot_product = ((track.position[:, :2] - start) * step).sum(axis=1)
    fraction = np.divide(dot_product, length_square, out=np.zeros_like(dot_product), where=length_square > 0.0)
    distance = waypoint_distances[leg] + np.clip(fraction, 0.0, 1.0) * np.sqrt(length_square)
    return np.asarray(np.maximum.accumulate(np.where(np.isfinite(distance), distance, 0.0)))


def make_fail_labels(
    failed: Failures, corners: Floats, threat_positions: Mapping[int, tuple[float, float]]
) -> tuple[Label, ...]:
    """Return a label with the names of the failing rules for each failing leg, threat and waypoint.

    They are in this order.  There are at most `_MAX_LABELS`; the rest is left out.

    corners: positions of the route's waypoints in the chart, (w, 2).
    threat_positions: position of threats in the chart, keyed by index; other threats get no label.
    """
    middles = 0.5 * (corners[:-1] + corners[1:])
    labels = [(f"{failed.place_name('leg', k)}: {', '.join(rules)}", *middles[k]) for k, rules in failed.legs.items()]
    labels += [
        (f"{text}: threat", *threat_positions[k]) for k, text in failed.threat_names().items() if k in threat_positions
    ]
    labels += [
        (f"{failed.place_name('waypoint', k)}: {', '.join(rules)}", *corners[k])
        for k, rules in failed.waypoints.items()
    ]
    return tuple(Label(text, float(x), float(y), "fail", "fail") for text, x, y in labels[:_MAX_LABELS])


def threat_radius(threats: Threats, place: Place) -> float:
    """Return the kill radius of a threat if `place` is a missile, otherwise its detection radius, m."""
    radii = threats.kill_radius if place.kind == "missile" else threats.detection_radius
    return float(radii[place.index or 0])


def find_rows_inside_threats(failed: Failures, threats: Threats, track: Track) -> NDArray[np.bool_]:
    """Return a mask (t,): True for rows of the track within the range of a threat that failed."""
    is_inside = np.zeros(len(track), dtype=bool)
    for place in failed.threats:
        offsets = track.position - threats.position[place.index or 0]
        is_inside |= (offsets**2).sum(axis=1) < threat_radius(threats, place) ** 2
    return is_inside
