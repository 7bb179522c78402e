"""Airspace zones that a flight must avoid or must stay in, each between a floor and a ceiling.

A zone is a polygon or a cylinder on the map and a band of heights.  A flight violates an exclusion where it is inside
its shape and between its floor and its ceiling, and an inclusion where it is not.  A flight must stay in all inclusions
at once, as in ArduPlane unless FENCE_OPTIONS is set otherwise (ArduPilot's parameter reference).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import shapely

from world.airspace.edge_checks import MAX_CROSSINGS, check_edges, count_crossings

ZoneKind = Literal["inclusion", "exclusion"]
Datum = Literal["amsl", "ground"]
# Corners, (east, north) m; the last corner is joined to the first, which is not repeated.
Ring = tuple[tuple[float, float], ...]

# Smallest area of a polygon, m^2; a smaller polygon is empty.
MIN_AREA = 1.0


@dataclass(frozen=True, slots=True)
class ZoneLevel:
    """Floor or ceiling of a zone.

    height: m, above mean sea level ("amsl") or above the ground below the aircraft ("ground"), as `datum` says.
    """

    height: float
    datum: Datum


@dataclass(frozen=True, slots=True)
class Polygon:
    """Polygon on the map, of one or more parts, each with or without holes.

    rings: outlines in anticlockwise direction, and holes in clockwise direction: the inside is to the left. No ring
        crosses itself or another ring.
    """

    rings: tuple[Ring, ...]


@dataclass(frozen=True, slots=True)
class Cylinder:
    """Circle on the map: its centre and its radius, m."""

    east: float
    north: float
    radius: float


@dataclass(frozen=True, slots=True)
class Zone:
    """Airspace zone: a shape on the map between a floor and a ceiling.

    name: name for messages, one line.
    kind: "exclusion" to keep out of, "inclusion" to stay in.
    shape: outline on the map.
    floor, ceiling: None if the zone has no lower or no upper limit.

    >>> Zone("mast", "exclusion", Cylinder(0.0, 500.0, 200.0), ceiling=ZoneLevel(120.0, "ground")).floor is None
    True
    """

    name: str
    kind: ZoneKind
    shape: Polygon | Cylinder
    floor: ZoneLevel | None = None
    ceiling: ZoneLevel | None = None

    @property
    def has_level_above_ground(self) -> bool:
        """True if the floor or the ceiling is a height above ground."""
        return any(level is not None and level.datum == "ground" for level in (self.floor, self.ceiling))


def make_polygon(rings: Sequence[Sequence[tuple[float, float]]]) -> Polygon:
    """Make a polygon from its outlines and holes, which may be in any order and direction.

    rings: corners (east, north) m of each ring.

    A point is inside if an odd number of rings contain it. A corner is omitted if it repeats the previous corner, or
    the first corner at the end of a ring. Raises ValueError for a ring of fewer than three corners, and for rings that
    cross themselves or each other. Also raises ValueError for a polygon of no area, and for too many corners or edges
    (`check_edges`).

    >>> make_polygon([[(0.0, 0.0), (0.0, 90.0), (90.0, 90.0), (90.0, 0.0), (0.0, 0.0)]]).rings
    (((90.0, 0.0), (90.0, 90.0), (0.0, 90.0), (0.0, 0.0)),)
    """
    if not rings:
        raise ValueError("no corners: at least three are needed")
    # Rings without repeated corners.
    clean_rings: list[Ring] = []
    for ring in rings:
        if not all(math.isfinite(value) for corner in ring for value in corner):
            raise ValueError("a corner is not a number")
        corners = [(float(east), float(north)) for east, north in ring]
        distinct = corners[:1] + [corner for previous, corner in pairwise(corners) if corner != previous]
        if len(distinct) > 1 and distinct[-1] == distinct[0]:
            distinct.pop()
        if len(distinct) < 3:
            raise ValueError(f"{len(distinct)} corners: at least three different ones are needed")
        clean_rings.append(tuple(distinct))
    check_edges(clean_rings)
    shapes = [shapely.Polygon(clean_ring) for clean_ring in clean_rings]
    for shape in shapes:
        if not shape.is_valid:
            # Shapely's reason, and its position on the map, m.
            reason, _, position = shapely.is_valid_reason(shape).rstrip("]").partition("[")
            coordinates = [f"{float(value):.1f} m" for value in position.split()]
            fault = f"{reason} at east {coordinates[0]}, north {coordinates[1]}" if len(coordinates) >= 2 else reason
            raise ValueError(f"crosses or touches itself ({fault})")
    if len(shapes) == 1:
        _check_area(shapes[0].area)
        return Polygon((clean_rings[0] if shapes[0].exterior.is_ccw else clean_rings[0][::-1],))
    tree = shapely.STRtree(shapes)
    for first, second in tree.query(shapes, predicate="intersects").T:
        # Rings may touch at a corner.
        if first < second and (
            shapes[first].overlaps(shapes[second])
            or shapes[first].exterior.intersection(shapes[second].exterior).length > 0.0
        ):
            raise ValueError("its rings cross each other, or share an edge")
    # Minus 1, as a ring is within itself.
    depths = [len(tree.query(shape, predicate="within")) - 1 for shape in shapes]
    _check_area(sum(shape.area * (1 if depth % 2 == 0 else -1) for shape, depth in zip(shapes, depths, strict=True)))
    # Corners are anticlockwise, but clockwise in a hole, which lies in an odd number of other rings.
    return Polygon(
        tuple(
            ring if shapely.LinearRing(ring).is_ccw == (depth % 2 == 0) else ring[::-1]
            for ring, depth in zip(clean_rings, depths, strict=True)
        )
    )


def _check_area(area: float) -> None:
    """Raise ValueError for an area (m^2) below `MIN_AREA`."""
    if not area >= MIN_AREA:
        raise ValueError(f"encloses only {area:.3g} m2; at least {MIN_AREA:g} m2 are needed")


def make_cylinder(east: float, north: float, radius: float) -> Cylinder:
    """Make a cylinder from its centre and its radius, m.

    Raises ValueError for a radius of zero or below, and for values that are not finite.

    >>> make_cylinder(0.0, 0.0, 0.0)
    Traceback (most recent call last):
    ...
    ValueError: radius 0 m: must be above 0
    """
    if not (math.isfinite(east) and math.isfinite(north)):
        raise ValueError("a coordinate of its centre is not a number")
    if not 0.0 < radius < math.inf:
        raise ValueError(f"radius {radius:g} m: must be above 0")
    return Cylinder(east, north, radius)


def is_hole(ring: Ring) -> bool:
    """Return True if a ring of a `Polygon` bounds a hole; such a ring is clockwise.

    >>> is_hole(((0.0, 0.0), (0.0, 90.0), (90.0, 90.0)))
    True
    """
    return not shapely.LinearRing(ring).is_ccw


def band_outline(corners: Sequence[tuple[float, float]], width: float) -> list[tuple[float, float]]:
    """Return the outline of a band of constant width along a line: (east, north) m.

    The ends are semicircular.

    corners: corners of the line, (east, north) m.
    width: m.

    Raises ValueError for a line that crosses itself too often.

    >>> outline = band_outline([(0.0, 0.0), (0.0, 90.0)], 20.0)
    >>> min(north for _, north in outline), max(east for east, _ in outline)
    (-10.0, 10.0)
    """
    check_edges([corners], closed=False)
    if count_crossings([corners], MAX_CROSSINGS, closed=False) > MAX_CROSSINGS:
        raise ValueError(f"it crosses itself more than {MAX_CROSSINGS:,} times")
    band = shapely.LineString(corners).buffer(0.5 * width, cap_style="round", join_style="mitre")
    return [(float(east), float(north)) for east, north in band.exterior.coords[:-1]]


# Buffer around the area of a repaired outline, degrees (about 0.1 m).  It connects parts that touch only in points, so
# that rounding on a map cannot separate them.
REPAIR_MARGIN_DEG = 1e-6


def repair_rings(
    rings: Sequence[Sequence[Sequence[float]]], max_crossings: int = MAX_CROSSINGS
) -> tuple[list[list[list[float]]], int] | None:
    """Replace rings that cross themselves or each other by the rings of the area that they enclose.

    rings: rings of [latitude, longitude], the outline first.
    max_crossings: maximum number of crossings.

    Returns the new rings, and the number of edge crossings. Returns None if there is nothing to repair, or if a
    coordinate is not finite. The list of new rings is empty if they enclose no area.
    A ring that is not inside another ring is a part of the area, not a hole. A ring of fewer than three different
    corners is left out. The area is extended by `REPAIR_MARGIN_DEG` on all sides. Raises ValueError for more crossings
    than ``max_crossings``, and for too many corners or edges (`check_edges`).

    >>> repaired, crossings = repair_rings([[[0, 0], [2, 2], [2, 0], [0, 2]]])
    >>> len(repaired), crossings  # both halves of a bow tie, joined in the middle
    (1, 1)
    >>> repair_rings([[[0, 0], [2, 0], [2, 2]]]) is None
    True
    """
    if not all(math.isfinite(value) for ring in rings for point in ring for value in point):
        return None
    if any(len(set(map(tuple, ring))) < 3 for ring in rings):
        proper_rings = [[list(point) for point in ring] for ring in rings if len(set(map(tuple, ring))) > 2]
        repaired = repair_rings(proper_rings, max_crossings) if proper_rings else None
        return (proper_rings, 0) if repaired is None else repaired
    check_edges(rings)
    if shapely.Polygon(rings[0], rings[1:]).is_valid:
        return None
    crossings = count_crossings(rings, max_crossings)
    if crossings > max_crossings:
        raise ValueError(f"more crossings than can be repaired: at most {MAX_CROSSINGS:,} in a file")
    area = _enclosed_area([shapely.Polygon(ring) for ring in rings])
    grown_area = area.buffer(REPAIR_MARGIN_DEG, join_style="mitre") if area.area > 0.0 else area
    parts = [
        candidate
        for candidate in shapely.get_parts(grown_area)
        if isinstance(candidate, shapely.Polygon) and not candidate.is_empty
    ]
    return [
        [list(corner) for corner in ring.coords[:-1]] for part in parts for ring in (part.exterior, *part.interiors)
    ], crossings


def _enclosed_area(rings: Sequence[shapely.Polygon]) -> shapely.Geometry:
    """Return the area that rings enclose; each ring is repaired separately.

    A ring inside an odd number of other rings is a hole in them. A ring inside another ring may extend beyond it by
    `REPAIR_MARGIN_DEG`; of two identical rings neither is inside the other. A ring that crosses another ring, touches
    it from outside or is separate from it is a part of the area.
    """
    areas = shapely.make_valid(np.array(rings), method="structure", keep_collapsed=False)
    areas = areas[shapely.area(areas) > 0.0]
    grown_areas = shapely.buffer(areas, REPAIR_MARGIN_DEG, join_style="mitre")
    coverings = {
        (int(outer), int(inner)) for outer, inner in shapely.STRtree(areas).query(grown_areas, predicate="covers").T
    }
    containing: list[list[int]] = [[] for _ in areas]
    for outer, inner in coverings:
        if (inner, outer) not in coverings:
            containing[inner].append(outer)
    holes: list[list[int]] = [[] for _ in areas]
    for inner, outers in enumerate(containing):
        if len(outers) % 2:
            for outer in outers:
                holes[outer].append(inner)
    parts = [
        shapely.difference(areas[k], shapely.union_all(areas[holes[k]]))
        for k in range(len(areas))
        if not len(containing[k]) % 2
    ]
    return shapely.union_all(parts)


def are_holes_inside(rings: Sequence[Sequence[tuple[float, float]]]) -> bool:
    """Return True if all holes are inside the outline.

    Also return True if a ring is invalid, which `make_polygon` reports.

    rings: the outline first, then its holes.

    Raises ValueError for too many corners or edges (`check_edges`).

    >>> square = [(0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 9.0)]
    >>> are_holes_inside([square, [(1.0, 1.0), (2.0, 1.0), (2.0, 2.0)]])
    True
    >>> are_holes_inside([square, [(11.0, 1.0), (12.0, 1.0), (12.0, 2.0)]])
    False
    """
    if any(len(ring) < 3 for ring in rings):
        return True
    check_edges(rings)
    outline, *holes = (shapely.Polygon(ring) for ring in rings)
    shapely.prepare(outline)
    return not all(ring.is_valid for ring in (outline, *holes)) or all(outline.covers(hole) for hole in holes)
