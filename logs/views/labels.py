"""Place small labels near their points so that they cover neither each other nor the lines."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib import patheffects
from numpy.typing import ArrayLike

from logs import theme
from world.arrays import Floats

# Resolution of pictures, pixels an inch.
DPI = 150

Box = tuple[float, float, float, float]

# Cost of covering another label; it exceeds the cost of any distance and of any covered lines.
_OVERLAP_COST = 200.0
# Cost of standing on the wrong side of a label whose point is near; it exceeds the cost of a covered line.
_ORDER_COST = 50.0
# Distances tried for a framed label in addition to its gap, in label heights; its line to the point allows long ones.
_FRAMED_DISTANCES = (0.0, 1.0, 2.2, 3.4, 4.6, 6.0, 7.5, 9.0, 11.0)
# Distances tried for an unframed label.
_UNFRAMED_DISTANCES = _FRAMED_DISTANCES[:3]
# Distances tried for an optional label, which stays close to its point.
_OPTIONAL_DISTANCES = _FRAMED_DISTANCES[:2]
# Free width kept on each side of a label, pixels: two numbers without a gap read as one.
_SIDE_PADDING_PX = 4.0
# Directions tried for a label, best first: right-up, left-up, right-down, left-down, up, down, right, left.
_DIRECTIONS = ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))


@dataclass(slots=True)
class LabelPlacer:
    """Writes labels on axes one after another, each where it covers least.

    Labels that were written earlier are not moved.

    axes: matplotlib's axes, whose limits and position must be final.
    lines: positions that labels should not cover, pixels, (n, 2).
    boxes: boxes of the labels already written, pixels.
    points: position to which each of these labels belongs, pixels.
    """

    axes: Any
    lines: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    boxes: list[Box] = field(default_factory=list)
    points: list[tuple[float, float]] = field(default_factory=list)

    def avoid(self, east: ArrayLike, north: ArrayLike, spacing: float = 6.0) -> None:
        """Keep labels that are placed later off a line through these positions.

        east, north: corners of the line in units of the axes, (n,); positions that are not finite are skipped.
        spacing: distance between the points of the line that are kept free, pixels.
        """
        points = self._to_pixels(east, north)
        points = points[np.isfinite(points).all(axis=1)]
        if len(points) < 2:
            self.lines = np.vstack([self.lines, points])
            return
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        sample_distances = np.arange(0.0, along[-1] + spacing, spacing)
        samples = np.column_stack([np.interp(sample_distances, along, points[:, axis]) for axis in (0, 1)])
        self.lines = np.vstack([self.lines, samples])

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
        """Write a text next to a point, where it overlaps other labels and lines least.

        A framed label, and a label that could not be placed close to its point, gets a line to the point.  Nothing is
        written if the point is not finite.

        x, y: the point, in units of the axes.
        size: font size, typographic points.
        gap: smallest distance between text and point, pixels.
        prefer: direction tried first, as signs of x and y; (0, 0) centres the text on the point.
        optional: True to omit the label if it would cover another label.
        style: matplotlib's text properties; with `bbox`, the label is framed.
        """
        (point_x, point_y) = self._to_pixels([x], [y])[0]
        if not (math.isfinite(point_x) and math.isfinite(point_y)):
            return
        padding = 5.0 if "bbox" in style else 1.0
        width = 0.62 * size * len(text) * DPI / 72.0 + 2 * max(padding, _SIDE_PADDING_PX)
        height = 1.25 * size * DPI / 72.0 + 2 * padding
        best_box, best_cost, best_ring = self._make_box(point_x, point_y, width, height, gap, prefer), math.inf, 0
        unframed_distances = _OPTIONAL_DISTANCES if optional else _UNFRAMED_DISTANCES
        ring_distances = _FRAMED_DISTANCES if "bbox" in style else unframed_distances
        for ring, distance_in_heights in enumerate(ring_distances):
            for direction_rank, direction in enumerate((prefer, *_DIRECTIONS)):
                box = self._make_box(point_x, point_y, width, height, gap + distance_in_heights * height, direction)
                order_cost = 0.0 if "bbox" in style else self._compute_order_cost(box, point_x, point_y)
                cost = self._compute_box_cost(box) + order_cost + 0.05 * direction_rank + 1.5 * ring
                if cost < best_cost:
                    best_box, best_cost, best_ring = box, cost, ring
        if optional and any(_boxes_overlap(best_box, other) for other in self.boxes):
            return
        self.boxes.append(best_box)
        self.points.append((point_x, point_y))
        box_center = 0.5 * (best_box[0] + best_box[2]), 0.5 * (best_box[1] + best_box[3])
        center = self.axes.transData.inverted().transform(box_center)
        artist = self.axes.text(
            center[0],
            center[1],
            text,
            fontsize=size,
            ha="center",
            va="center",
            **{"color": theme.colour("ink"), "zorder": 9, **style},
        )
        if "bbox" in style:
            self._draw_lead_line(best_box, point_x, point_y, style["bbox"]["edgecolor"], 0.8)
        else:
            if best_ring:
                self._draw_lead_line(best_box, point_x, point_y, style.get("color", theme.colour("ink")), 0.5)
            outline = patheffects.withStroke(linewidth=1.8, foreground=theme.colour("paper"), alpha=0.85)
            artist.set_path_effects([outline])

    def _draw_lead_line(self, box: Box, x: float, y: float, color: str, width: float) -> None:
        """Draw a thin line from a label to its point.

        It starts at the label's centre and is hidden below the label.

        box, x, y: the label's box and its point, pixels.
        width: line width, typographic points.
        """
        center = (0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3]))
        line_ends = self.axes.transData.inverted().transform([center, (x, y)])
        self.axes.plot(line_ends[:, 0], line_ends[:, 1], "-", color=color, linewidth=width, zorder=8.9, gid="leader")

    def _to_pixels(self, east: ArrayLike, north: ArrayLike) -> Floats:
        """Convert data coordinates, (n,) each, to display pixels, (n, 2)."""
        points = np.column_stack([np.asarray(east, dtype=np.float64), np.asarray(north, dtype=np.float64)])
        return np.asarray(self.axes.transData.transform(points), dtype=np.float64)

    @staticmethod
    def _make_box(x: float, y: float, width: float, height: float, distance: float, direction: tuple[int, int]) -> Box:
        """Return the box of a label next to a point (x, y), all in pixels.

        distance: distance between point and label; shorter if the direction is diagonal.
        direction: side of the point on which the label stands, as signs of x and y.
        """
        dx, dy = direction
        # A diagonal label approaches the point with its corner, so it may stand closer.
        offset = distance * (0.7 if dx and dy else 1.0)
        middle_x = x + dx * (offset + 0.5 * width)
        middle_y = y + dy * (offset + 0.5 * height)
        return (
            middle_x - 0.5 * width,
            middle_y - 0.5 * height,
            middle_x + 0.5 * width,
            middle_y + 0.5 * height,
        )

    def _compute_order_cost(self, box: Box, x: float, y: float) -> float:
        """Return the cost of a label whose order among labels with near points is wrong.

        It is 0 if the order is right.  If a point is left of another point, but its label right of the other label, a
        reader could assign both labels to the wrong points.  Framed labels need no such cost, because they have a line
        to their point.

        box: box of the label, pixels.
        x, y: point of the label, pixels.
        """
        cost = 0.0
        for other_box, (other_x, other_y) in zip(self.boxes, self.points, strict=True):
            dx, dy = x - other_x, y - other_y
            if math.hypot(dx, dy) > box[2] - box[0] + other_box[2] - other_box[0]:
                continue
            x_offset = box[0] + box[2] - other_box[0] - other_box[2]
            y_offset = box[1] + box[3] - other_box[1] - other_box[3]
            if dx * x_offset + dy * y_offset < 0.0:
                cost += _ORDER_COST
        return cost

    def _compute_box_cost(self, box: Box) -> float:
        """Return the cost of placing a label in a box.

        It is higher if the box leaves the axes or covers labels or lines.
        """
        frame = self.axes.get_window_extent()
        cost = 0.0
        if box[0] < frame.x0 or box[1] < frame.y0 or box[2] > frame.x1 or box[3] > frame.y1:
            cost += 60.0
        for other_box in self.boxes:
            if _boxes_overlap(box, other_box):
                cost += _OVERLAP_COST
        if len(self.lines):
            is_covered = (
                (self.lines[:, 0] > box[0])
                & (self.lines[:, 0] < box[2])
                & (self.lines[:, 1] > box[1])
                & (self.lines[:, 1] < box[3])
            )
            cost += float(np.count_nonzero(is_covered))
        return cost


def _boxes_overlap(first: Box, second: Box) -> bool:
    """Return True if two boxes (left, bottom, right, top) overlap."""
    return first[0] < second[2] and second[0] < first[2] and first[1] < second[3] and second[1] < first[3]
