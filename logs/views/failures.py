"""Where a verdict's failures lie on a route, and how far along it a flight has come."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib import patheffects
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray

from flight.simulation.track import Track
from logs.verdict.findings import Finding, Verdict
from logs.verdict.places import Place, PlaceKind
from logs.verdict.wording import place_text
from logs.views import drawing
from logs.views.drawing import DPI, INK
from world.geometry import leg_runs
from world.threats import Threats

Floats = NDArray[np.float64]


# ----------------------------------------------------------------------
# Small labels near their points, placed so that they cover neither each other nor the lines.

Box = tuple[float, float, float, float]

# What covering another label costs: more than any distance, and than any line that a label can cover.
_OVERLAP = 200.0
# How far from its gap a label may move, in its own heights: a framed one has a line to its point, however far it is;
# one that may be left out stays close.
_RINGS_FRAMED = (0.0, 1.0, 2.2, 3.4, 4.6, 6.0, 7.5, 9.0, 11.0)
_RINGS, _RINGS_OPTIONAL = _RINGS_FRAMED[:3], _RINGS_FRAMED[:2]
# Directions that are tried for a label, best first: right-up, left-up, right-down, left-down, up, down, right, left.
_DIRECTIONS = ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))


@dataclass(slots=True)
class LabelPlacer:
    """Greedy placement in pixels on one axes, whose limits and position must be final.

    lines: (n, 2) pixel positions that labels should not cover.  boxes: what labels already cover.
    """

    axes: Any
    lines: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    boxes: list[Box] = field(default_factory=list)

    def avoid(self, east: ArrayLike, north: ArrayLike, spacing: float = 6.0) -> None:
        """Keep labels off a line through these data positions, sampled every `spacing` pixels."""
        points = self._pixels(east, north)
        points = points[np.isfinite(points).all(axis=1)]
        if len(points) < 2:
            self.lines = np.vstack([self.lines, points])
            return
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        at = np.arange(0.0, along[-1] + spacing, spacing)
        sampled = np.column_stack([np.interp(at, along, points[:, axis]) for axis in (0, 1)])
        self.lines = np.vstack([self.lines, sampled])

    def place(
        self,
        text: str,
        x: float,
        y: float,
        *,
        size: float = 7.0,
        gap: float = 6.0,
        prefer: tuple[int, int] = (1, 1),
        optional: bool = False,
        **style: Any,
    ) -> None:
        """Write the text beside data position (x, y), where it disturbs least.

        size: of the font, points.
        gap: pixels between text and position.
        prefer: the direction tried first; (0, 0) centres the text on the position.
        optional: left out where it would cover another label.
        style: of the text.

        A framed label, and one that had to move away, gets a line to its point.
        """
        (px, py) = self._pixels([x], [y])[0]
        if not (math.isfinite(px) and math.isfinite(py)):
            return
        pad = 5.0 if "bbox" in style else 1.0
        width = 0.62 * size * len(text) * DPI / 72.0 + 2 * pad
        height = 1.25 * size * DPI / 72.0 + 2 * pad
        best, best_cost, moved = self._box(px, py, width, height, gap, prefer), math.inf, 0
        for ring, heights in enumerate(_RINGS_FRAMED if "bbox" in style else _RINGS_OPTIONAL if optional else _RINGS):
            for rank, direction in enumerate((prefer, *_DIRECTIONS)):
                box = self._box(px, py, width, height, gap + heights * height, direction)
                cost = self._cost(box) + 0.05 * rank + 1.5 * ring
                if cost < best_cost:
                    best, best_cost, moved = box, cost, ring
        if optional and any(_overlap(best, other) for other in self.boxes):
            return
        self.boxes.append(best)
        middle = self.axes.transData.inverted().transform((0.5 * (best[0] + best[2]), 0.5 * (best[1] + best[3])))
        artist = self.axes.text(
            middle[0], middle[1], text, fontsize=size, ha="center", va="center", **{"color": INK, "zorder": 9, **style}
        )
        if "bbox" in style:
            self._lead(best, px, py, style["bbox"]["edgecolor"], 0.8)
        else:
            if moved:
                self._lead(best, px, py, style.get("color", INK), 0.5)
            artist.set_path_effects([patheffects.withStroke(linewidth=1.8, foreground="white", alpha=0.85)])

    def _lead(self, box: Box, x: float, y: float, color: str, width: float) -> None:
        """Draw a thin line from under a label to its point."""
        middle = (0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3]))
        ends = self.axes.transData.inverted().transform([middle, (x, y)])
        self.axes.plot(ends[:, 0], ends[:, 1], "-", color=color, linewidth=width, zorder=8.9, gid="leader")

    def _pixels(self, east: ArrayLike, north: ArrayLike) -> Floats:
        points = np.column_stack([np.asarray(east, dtype=np.float64), np.asarray(north, dtype=np.float64)])
        return np.asarray(self.axes.transData.transform(points), dtype=np.float64)

    @staticmethod
    def _box(x: float, y: float, width: float, height: float, distance: float, direction: tuple[int, int]) -> Box:
        dx, dy = direction
        # A diagonal label touches the point's surroundings with its corner, so it may come closer.
        near = distance * (0.7 if dx and dy else 1.0)
        middle_x = x + dx * (near + 0.5 * width)
        middle_y = y + dy * (near + 0.5 * height)
        return (
            middle_x - 0.5 * width,
            middle_y - 0.5 * height,
            middle_x + 0.5 * width,
            middle_y + 0.5 * height,
        )

    def _cost(self, box: Box) -> float:
        frame = self.axes.get_window_extent()
        cost = 0.0
        if box[0] < frame.x0 or box[1] < frame.y0 or box[2] > frame.x1 or box[3] > frame.y1:
            cost += 60.0
        for other in self.boxes:
            if _overlap(box, other):
                cost += _OVERLAP
        if len(self.lines):
            inside = (
                (self.lines[:, 0] > box[0])
                & (self.lines[:, 0] < box[2])
                & (self.lines[:, 1] > box[1])
                & (self.lines[:, 1] < box[3])
            )
            cost += float(np.count_nonzero(inside))
        return cost


def _overlap(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


@dataclass(frozen=True, slots=True)
class Failures:
    """Rules that failed, by leg and by waypoint number (each rule once, in the verdict's order).

    threats: missiles and radars whose reach was entered, each once.
    places: of legs and waypoints that fail, by kind and number, as the verdict has them.
    """

    legs: dict[int, tuple[str, ...]]
    waypoints: dict[int, tuple[str, ...]]
    threats: tuple[Place, ...] = ()
    places: dict[tuple[PlaceKind, int], Place] = field(default_factory=dict)

    def __bool__(self) -> bool:
        """Something failed at a place."""
        return bool(self.legs or self.waypoints or self.threats)

    def name(self, kind: PlaceKind, number: int) -> str:
        """What the verdict calls a leg or a waypoint.

        >>> Failures({7: ("slope",)}, {}, places={("leg", 7): Place("leg", 7, to_item=9)}).name("leg", 7)
        'leg 7, to item 9'
        >>> Failures({7: ("slope",)}, {}).name("leg", 7)
        'leg 7'
        """
        return place_text(self.places.get((kind, number), Place(kind, number)))

    def threat_names(self) -> dict[int, str]:
        """What the verdict calls each failing threat, by its index; one whose missile fails is called by that."""
        radars_first = sorted(self.threats, key=lambda place: place.kind == "missile")
        return {place.index or 0: place_text(place) for place in radars_first}


def failures(verdict: Verdict | None, waypoint_count: int) -> Failures:
    """Find the failing places of a verdict; places that the route does not have are left out."""
    failed = [finding for finding in verdict.findings if finding.ok is False] if verdict is not None else []
    places = [finding.place for finding in failed if finding.place.index is not None]
    return Failures(
        legs=_rules_at(failed, "leg", waypoint_count - 1),
        waypoints=_rules_at(failed, "waypoint", waypoint_count),
        threats=tuple(dict.fromkeys(place for place in places if place.kind in ("missile", "radar"))),
        places={(place.kind, place.index or 0): place for place in places},
    )


def _rules_at(failed: list[Finding], kind: PlaceKind, count: int) -> dict[int, tuple[str, ...]]:
    """Rules that failed at the first so many places of a kind, by the place's number."""
    found: dict[int, list[str]] = {}
    for finding in failed:
        place = finding.place
        if place.kind == kind and place.index is not None and place.index < count:
            rules = found.setdefault(place.index, [])
            if finding.rule not in rules:
                rules.append(finding.rule)
    return {number: tuple(rules) for number, rules in sorted(found.items())}


def route_distance(waypoints: Floats) -> Floats:
    """Horizontal distance of each waypoint along the route, (w,) m."""
    return np.concatenate([[0.0], np.cumsum(leg_runs(waypoints))])


def route_samples(waypoints: Floats, step: float) -> tuple[Floats, Floats]:
    """Points along the route: distance (s,) m and position (s, 3) m, at most `step` apart, waypoints included."""
    at = route_distance(waypoints)
    count = max(2, int(np.ceil(at[-1] / step)) + 1) if at[-1] > 0.0 else 2
    distance = np.union1d(np.linspace(0.0, at[-1], count), at)
    return distance, np.column_stack([np.interp(distance, at, waypoints[:, axis]) for axis in range(3)])


def paths_differ(a: Floats, b: Floats, tolerance: float) -> bool:
    """Whether a corner of one path lies further than `tolerance` (m) from the other; order along it is not looked at.

    a, b: (n, 3) and (m, 3) m.
    """
    return max(_farthest(a, b), _farthest(b, a)) > tolerance


def _farthest(points: Floats, path: Floats) -> float:
    """Largest distance (m) from any of the points to the path."""
    start, step = path[:-1], np.diff(path, axis=0)
    length2 = (step**2).sum(axis=1)
    farthest = 0.0
    for point in points:
        dot = ((point - start) * step).sum(axis=1)
        share = np.clip(np.divide(dot, length2, out=np.zeros_like(dot), where=length2 > 0.0), 0.0, 1.0)
        near = start + share[:, None] * step
        farthest = max(farthest, float(np.sqrt(((near - point) ** 2).sum(axis=1).min())))
    return farthest


def track_distance(waypoints: Floats, track: Track) -> Floats:
    """How far along the route each row of a track is, (t,) m, never falling.

    A row is projected onto its active leg and held between that leg's ends; a row without a position keeps the
    distance reached before it.
    """
    at = route_distance(waypoints)
    leg = np.clip(track.leg.astype(np.intp), 0, len(waypoints) - 2)
    start, end = waypoints[leg, :2], waypoints[leg + 1, :2]
    step = end - start
    length2 = (step**2).sum(axis=1)
    dot = ((track.position[:, :2] - start) * step).sum(axis=1)
    share = np.divide(dot, length2, out=np.zeros_like(dot), where=length2 > 0.0)
    distance = at[leg] + np.clip(share, 0.0, 1.0) * np.sqrt(length2)
    return np.asarray(np.maximum.accumulate(np.where(np.isfinite(distance), distance, 0.0)))


# ----------------------------------------------------------------------
# What fails, named beside its place and, of threats, drawn where the flight was inside them.

# More labels than these would cover what they tell of.
_MAX_LABELS = 16


def write_fail_labels(
    failed: Failures, corners: Floats, threats_at: Mapping[int, tuple[float, float]], placer: LabelPlacer, gap: float
) -> None:
    """Name the rules that fail beside the first failing legs, threats and waypoints, as the verdict names those.

    corners: (w, 2) drawn positions of the route's waypoints.  threats_at: of threats by their index; others get none.
    gap: pixels between label and place.
    """
    middles = 0.5 * (corners[:-1] + corners[1:])
    labels = [(f"{failed.name('leg', k)}: {', '.join(rules)}", *middles[k]) for k, rules in failed.legs.items()]
    labels += [(f"{text}: threat", *threats_at[k]) for k, text in failed.threat_names().items() if k in threats_at]
    labels += [
        (f"{failed.name('waypoint', k)}: {', '.join(rules)}", *corners[k]) for k, rules in failed.waypoints.items()
    ]
    frame: dict[str, Any] = {
        "boxstyle": "round,pad=0.2",
        "facecolor": "white",
        "edgecolor": drawing.FAIL,
        "linewidth": 0.9,
    }
    for text, x, y in labels[:_MAX_LABELS]:
        placer.place(text, float(x), float(y), size=7.0, gap=gap, color=drawing.FAIL, bbox=frame)


def radius_of(threats: Threats, place: Place) -> float:
    """Radius (m) of the sphere that a failing place is: a missile's or a radar's."""
    radii = threats.kill_radius if place.kind == "missile" else threats.detection_radius
    return float(radii[place.index or 0])


def inside_threats(failed: Failures, threats: Threats, track: Track) -> NDArray[np.bool_]:
    """Rows (t,) of the track inside a sphere whose rule fails."""
    inside = np.zeros(len(track), dtype=bool)
    for place in failed.threats:
        away = track.position - threats.position[place.index or 0]
        inside |= (away**2).sum(axis=1) < radius_of(threats, place) ** 2
    return inside


def draw_inside(axes: Any, x: Floats, y: Floats, inside: NDArray[np.bool_]) -> list[Any]:
    """Draw the part of a flown line that is inside, broad; returns what the legend shows of it."""
    if not inside.any():
        return []
    look: dict[str, Any] = {"color": drawing.FAIL, "linewidth": 3.6, "solid_capstyle": "round"}
    axes.plot(np.where(inside, x, np.nan), np.where(inside, y, np.nan), zorder=6.5, **look)
    return [Line2D([], [], label="flown inside a threat's reach", **look)]
