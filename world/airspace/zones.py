"""Zones of airspace: where a flight must not be, and where it must stay, each between a floor and a ceiling.

A zone is a polygon or a cylinder on the map and a band of heights.  A flight violates an exclusion where it is inside
its shape and between its floor and its ceiling, and an inclusion where it is not.  Several inclusions all count, as
ArduPlane has them unless FENCE_OPTIONS says otherwise (ArduPilot's parameter reference): a flight stays in every one.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import shapely

ZoneKind = Literal["inclusion", "exclusion"]
Datum = Literal["amsl", "ground"]
# Corners, (east, north) m; the last is joined to the first, which is not repeated.
Ring = tuple[tuple[float, float], ...]

# m^2.  A polygon with less inside is empty.
MIN_AREA = 1.0


@dataclass(frozen=True, slots=True)
class ZoneLevel:
    """The floor or the ceiling of a zone.

    height: m, above mean sea level ("amsl") or above the ground below the aircraft ("ground"), as `datum` says.
    """

    height: float
    datum: Datum


@dataclass(frozen=True, slots=True)
class Polygon:
    """Parts of the map, each with holes or without, by their edges.

    rings: outlines run anticlockwise, holes clockwise (the inside is to the left); none crosses itself or another.
    """

    rings: tuple[Ring, ...]


@dataclass(frozen=True, slots=True)
class Cylinder:
    """A circle on the map: its centre and its radius, m."""

    east: float
    north: float
    radius: float


@dataclass(frozen=True, slots=True)
class Zone:
    """One zone.

    name: what a person calls it, one line.
    kind: "exclusion" to keep out of, "inclusion" to stay in.
    shape: on the map.
    floor, ceiling: None where it begins at the ground and below, or has no top.

    >>> Zone("mast", "exclusion", Cylinder(0.0, 500.0, 200.0), ceiling=ZoneLevel(120.0, "ground")).floor is None
    True
    """

    name: str
    kind: ZoneKind
    shape: Polygon | Cylinder
    floor: ZoneLevel | None = None
    ceiling: ZoneLevel | None = None

    @property
    def above_ground(self) -> bool:
        """Whether its floor or its ceiling is counted from the ground."""
        return any(level is not None and level.datum == "ground" for level in (self.floor, self.ceiling))


def make_polygon(rings: Sequence[Sequence[tuple[float, float]]]) -> Polygon:
    """Make a polygon of its outlines and holes in any order and direction, (east, north) m a corner.

    A place is inside where it lies in an odd number of rings.  A corner that repeats the one before it, or closes a
    ring, is left out.  Raises ValueError for a ring of fewer than three corners, one that crosses itself, rings that
    cross each other, and a polygon with nothing inside.

    >>> make_polygon([[(0.0, 0.0), (0.0, 90.0), (90.0, 90.0), (90.0, 0.0), (0.0, 0.0)]]).rings
    (((90.0, 0.0), (90.0, 90.0), (0.0, 90.0), (0.0, 0.0)),)
    """
    if not rings:
        raise ValueError("no corners: at least three are needed")
    cleaned = [_cleaned(ring) for ring in rings]
    shapes = [shapely.Polygon(ring) for ring in cleaned]
    for shape in shapes:
        if not shape.is_valid:
            raise ValueError(f"crosses or touches itself ({shapely.is_valid_reason(shape)})")
    if len(shapes) == 1:
        _check_area(shapes[0].area)
        return Polygon((cleaned[0] if shapes[0].exterior.is_ccw else cleaned[0][::-1],))
    tree = shapely.STRtree(shapes)
    for first, second in tree.query(shapes, predicate="intersects").T:
        if first < second and _cross(shapes[first], shapes[second]):
            raise ValueError("its rings cross each other, or share an edge")
    # A ring is within itself.
    depths = [len(tree.query(shape, predicate="within")) - 1 for shape in shapes]
    _check_area(sum(shape.area * (1 if depth % 2 == 0 else -1) for shape, depth in zip(shapes, depths, strict=True)))
    return Polygon(tuple(_turned(ring, depth) for ring, depth in zip(cleaned, depths, strict=True)))


def _check_area(inside: float) -> None:
    if not inside >= MIN_AREA:
        raise ValueError(f"nothing inside: {inside:.3g} m2; at least {MIN_AREA:g} m2 are needed")


def _cross(one: shapely.Polygon, other: shapely.Polygon) -> bool:
    """Whether two rings cross, or run along each other; that they touch at a corner is allowed."""
    return bool(one.overlaps(other)) or float(one.exterior.intersection(other.exterior).length) > 0.0


def _cleaned(ring: Sequence[tuple[float, float]]) -> Ring:
    if not all(math.isfinite(value) for corner in ring for value in corner):
        raise ValueError("a corner is not a number")
    corners = [(float(east), float(north)) for east, north in ring]
    kept = corners[:1] + [corner for before, corner in pairwise(corners) if corner != before]
    if len(kept) > 1 and kept[-1] == kept[0]:
        kept.pop()
    if len(kept) < 3:
        raise ValueError(f"{len(kept)} corners: at least three different ones are needed")
    return tuple(kept)


def _turned(ring: Ring, depth: int) -> Ring:
    """The ring anticlockwise, or clockwise where it bounds a hole: where it lies in an odd number of others."""
    anticlockwise = shapely.LinearRing(ring).is_ccw
    return ring if anticlockwise == (depth % 2 == 0) else ring[::-1]


def make_cylinder(east: float, north: float, radius: float) -> Cylinder:
    """Make a cylinder.  Raises ValueError for a radius that is not above zero, and for what is not a number.

    >>> make_cylinder(0.0, 0.0, 0.0)
    Traceback (most recent call last):
    ...
    ValueError: radius 0 m: must be above 0
    """
    if not (math.isfinite(east) and math.isfinite(north)):
        raise ValueError("its centre is not a number")
    if not 0.0 < radius < math.inf:
        raise ValueError(f"radius {radius:g} m: must be above 0")
    return Cylinder(east, north, radius)


def is_hole(ring: Ring) -> bool:
    """Whether a ring of a `Polygon` bounds a hole: it runs clockwise.

    >>> is_hole(((0.0, 0.0), (0.0, 90.0), (90.0, 90.0)))
    True
    """
    return not shapely.LinearRing(ring).is_ccw


def band_outline(corners: Sequence[tuple[float, float]], width: float) -> list[tuple[float, float]]:
    """The outline of a band of this width along a line, with half circles at its ends, m.

    >>> outline = band_outline([(0.0, 0.0), (0.0, 90.0)], 20.0)
    >>> min(north for _, north in outline), max(east for east, _ in outline)
    (-10.0, 10.0)
    """
    band = shapely.LineString(corners).buffer(0.5 * width, cap_style="round", join_style="mitre")
    return [(float(east), float(north)) for east, north in band.exterior.coords[:-1]]


# Degrees, a tenth of a metre.  An area that an outline encloses where it crosses itself grows by this: its parts, which
# may touch each other in points, have a way between them, however they are rounded on a map.
MENDED_BY = 1e-6


def mended_rings(rings: Sequence[Sequence[Sequence[float]]]) -> list[list[list[float]]] | None:
    """Rings of the area that an outline with its holes encloses, where they cross; none for an outline of no area.

    rings: of [latitude, longitude], the outline first.  One that does not lie inside another is no hole: it is a part
    of the area; one of fewer than three different corners is none.  The area is larger by `MENDED_BY` on all sides.
    Returns None where nothing is to be mended.

    >>> len(mended_rings([[[0, 0], [2, 2], [2, 0], [0, 2]]]))  # both halves of a bow tie, joined in the middle
    1
    >>> mended_rings([[[0, 0], [2, 0], [2, 2]]]) is None
    True
    """
    if not all(math.isfinite(x) for ring in rings for at in ring for x in at):
        return None
    if any(len(set(map(tuple, ring))) < 3 for ring in rings):
        whole = [[list(at) for at in ring] for ring in rings if len(set(map(tuple, ring))) > 2]
        again = mended_rings(whole) if whole else None
        return whole if again is None else again
    if shapely.Polygon(rings[0], rings[1:]).is_valid:
        return None
    made = _enclosed([shapely.Polygon(ring) for ring in rings])
    grown = made.buffer(MENDED_BY, join_style="mitre") if made.area > 0.0 else made
    parts = [one for one in shapely.get_parts(grown) if isinstance(one, shapely.Polygon) and not one.is_empty]
    return [
        [list(corner) for corner in ring.coords[:-1]] for part in parts for ring in (part.exterior, *part.interiors)
    ]


def _enclosed(rings: Sequence[shapely.Polygon]) -> shapely.Geometry:
    """The area of rings, each mended alone: a ring inside an odd number of others is a hole, in those that hold it.

    Inside is what is beyond the other by `MENDED_BY` at most; of two rings that are the same, neither is.  A ring that
    crosses another one, touches it from outside or lies apart from it is a part of the area.
    """
    made = shapely.make_valid(np.array(rings), method="structure", keep_collapsed=False)
    made = made[shapely.area(made) > 0.0]
    grown = shapely.buffer(made, MENDED_BY, join_style="mitre")
    held = {(int(outer), int(inner)) for outer, inner in shapely.STRtree(made).query(grown, predicate="covers").T}
    within: list[list[int]] = [[] for _ in made]
    for outer, inner in held:
        if (inner, outer) not in held:
            within[inner].append(outer)
    holes: list[list[int]] = [[] for _ in made]
    for inner, outers in enumerate(within):
        if len(outers) % 2:
            for outer in outers:
                holes[outer].append(inner)
    parts = [
        shapely.difference(made[k], shapely.union_all(made[holes[k]]))
        for k in range(len(made))
        if not len(within[k]) % 2
    ]
    return shapely.union_all(parts)


def holes_lie_inside(rings: Sequence[Sequence[tuple[float, float]]]) -> bool:
    """Whether all rings but the first lie within it, or one of them is no ring, which `make_polygon` refuses.

    >>> square = [(0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 9.0)]
    >>> holes_lie_inside([square, [(1.0, 1.0), (2.0, 1.0), (2.0, 2.0)]])
    True
    >>> holes_lie_inside([square, [(11.0, 1.0), (12.0, 1.0), (12.0, 2.0)]])
    False
    """
    if any(len(ring) < 3 for ring in rings):
        return True
    outline, *holes = (shapely.Polygon(ring) for ring in rings)
    return not all(ring.is_valid for ring in (outline, *holes)) or all(outline.covers(hole) for hole in holes)
