"""Zones of airspace on the map (their shapes) and on the profile (what they take of the plane through the path)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.collections import PatchCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from logs.figures.elements import style
from logs.figures.elements.labels import LabelPlacer
from world.airspace.zone_kernels import edge_distance, zone_records
from world.airspace.zone_outlines import level_heights, zone_rings
from world.airspace.zones import Zone, ZoneLevel

Floats = NDArray[np.float64]

_HATCH = "////"
# Beyond this number, names of zones would be a grey mat.
_MOST_NAMES = 40


def zone_label(zone: Zone) -> str:
    """A zone's name and band of heights.

    >>> from world.airspace.zones import Cylinder
    >>> zone_label(Zone("mast", "exclusion", Cylinder(0.0, 0.0, 90.0), ceiling=ZoneLevel(120.0, "ground")))
    'mast, below 120 m above ground'
    """
    name = style.shorten(zone.name, 24)
    if zone.floor is not None and zone.ceiling is not None:
        if zone.floor.datum == zone.ceiling.datum:
            return f"{name}, {zone.floor.height:g} to {_level_text(zone.ceiling)}"
        return f"{name}, {_level_text(zone.floor)} to {_level_text(zone.ceiling)}"
    if zone.floor is not None:
        return f"{name}, above {_level_text(zone.floor)}"
    return name if zone.ceiling is None else f"{name}, below {_level_text(zone.ceiling)}"


def _level_text(level: ZoneLevel) -> str:
    return f"{level.height:g} m {'AMSL' if level.datum == 'amsl' else 'above ground'}"


def zone_handles(zones: tuple[Zone, ...]) -> list[Any]:
    """What the legend shows of zones."""
    kinds = {zone.kind for zone in zones}
    handles: list[Any] = []
    if "exclusion" in kinds:
        look: dict[str, Any] = {"facecolor": "none", "edgecolor": style.ZONE, "hatch": _HATCH, "linewidth": 1.1}
        handles.append(Patch(label="zone to keep out of", **look))
    if "inclusion" in kinds:
        handles.append(Line2D([], [], color=style.ZONE, linewidth=2.2, label="edge of a zone to stay in"))
    return handles


def draw_zone_shapes(axes: Any, zones: tuple[Zone, ...]) -> list[Any]:
    """Draw zones from above: exclusions hatched, inclusions as a line; returns what the legend shows of them."""
    looks: dict[str, dict[str, Any]] = {
        "exclusion": {"facecolor": (*style.ZONE_FILL, 0.14), "hatch": _HATCH, "linewidth": 1.1},
        "inclusion": {"facecolor": "none", "linewidth": 2.2},
    }
    for kind, look in looks.items():
        patches = [PathPatch(_shape(zone)) for zone in zones if zone.kind == kind]
        if patches:
            axes.add_collection(PatchCollection(patches, edgecolor=style.ZONE, zorder=3.4, **look))
    return zone_handles(zones)


def _shape(zone: Zone) -> Path:
    """All rings of a zone as one path, so that holes stay open."""
    return Path.make_compound_path(*(Path(ring, closed=True) for ring in zone_rings(zone)))


def name_zones(axes: Any, zones: tuple[Zone, ...], placer: LabelPlacer) -> None:
    """Write exclusions' names and heights in their middles, inclusions' at their northernmost corner."""
    if len(zones) > _MOST_NAMES:
        return
    for zone in zones:
        ring = zone_rings(zone)[0]
        corner = ring[np.argmax(ring[:, 1])]
        place, gap = (ring[:-1].mean(axis=0), 0.0) if zone.kind == "exclusion" else (corner, 3.0)
        (west, east), (south, north) = axes.get_xlim(), axes.get_ylim()
        if west < place[0] < east and south < place[1] < north:
            prefer = (0, 0) if zone.kind == "exclusion" else (0, 1)
            placer.place(
                zone_label(zone), *place.tolist(), size=6.0, gap=gap, prefer=prefer, optional=True, color=style.ZONE
            )


@dataclass(frozen=True, slots=True)
class ZoneCut:
    """What a zone forbids of the vertical plane through a path.

    zone: which one.
    bottom, top: (s,) m AMSL at each of the path's samples.
    where: (s,) bool, the samples at which that is forbidden.
    """

    zone: Zone
    bottom: Floats
    top: Floats
    where: NDArray[np.bool_]


def zone_cuts(zones: tuple[Zone, ...], points: Floats, ground: Floats | None, low: float, high: float) -> list[ZoneCut]:
    """What zones forbid between low and high (m AMSL) over the points (s, 3); nothing of those away from the path.

    ground: (s,) m AMSL or None.
    """
    under = np.full(len(points), low) if ground is None else np.where(np.isfinite(ground), ground, low)
    records, cuts = zone_records(zones), []
    for z, zone in enumerate(zones):
        over = np.array([edge_distance(records, z, east, north) <= 0.0 for east, north, _ in points])
        floor = np.clip(level_heights(zone.floor, under, low), low, high)
        ceiling = np.clip(level_heights(zone.ceiling, under, high), low, high)
        bands = [(floor, ceiling, over)]
        if zone.kind == "inclusion":
            whole = np.full(len(points), low), np.full(len(points), high)
            bands = [(whole[0], floor, over), (ceiling, whole[1], over), (*whole, ~over)]
        cuts += [ZoneCut(zone, bottom, top, where & (top > bottom)) for bottom, top, where in bands]
    return [cut for cut in cuts if cut.where.any()]


def draw_zone_cuts(
    axes: Any, zones: tuple[Zone, ...], distance: Floats, points: Floats, ground: Floats | None
) -> list[tuple[str, float, float]]:
    """Fill what zones forbid of the vertical plane through the path.

    distance: (s,) m along the path, points: (s, 3) m, ground: (s,) m AMSL or None.  Returns each such zone's label, the
    middle of its stretch (km) and the height (m AMSL) to write it at.
    """
    low, high = axes.get_ylim()
    kilometres, names = distance / 1000.0, []
    look: dict[str, Any] = {"facecolor": (*style.ZONE_FILL, 0.14), "edgecolor": style.ZONE, "hatch": _HATCH}
    for cut in zone_cuts(zones, points, ground, low, high):
        axes.fill_between(kilometres, cut.bottom, cut.top, where=cut.where, linewidth=0.9, zorder=2.4, **look)
        if cut.zone.kind == "exclusion":
            middle = int(np.flatnonzero(cut.where)[cut.where.sum() // 2])
            height = 0.5 * float(cut.bottom[middle] + cut.top[middle])
            names.append((zone_label(cut.zone), float(kilometres[middle]), height))
    return names
