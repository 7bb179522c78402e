"""Threats and zones on the map (their outlines) and on the profile (the part of each that stands over the path)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.collections import PatchCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from logs.views import drawing
from logs.views.failures import Failures, LabelPlacer, radius_of, route_samples
from world.airspace.zone_kernels import edge_distance, zone_records
from world.airspace.zones import Zone, ZoneLevel
from world.airspace.zones_on_map import level_heights, zone_rings
from world.threats import Threats

Floats = NDArray[np.float64]


# ----------------------------------------------------------------------
# Threats on the map (circles) and on the profile (the part of each sphere that stands over the path).


_DASHES = (0, (4, 2.5))


def draw_threat_circles(axes: Any, threats: Threats, route: Floats | None) -> list[Any]:
    """Draw circles of missiles and radars; returns what the legend shows of them."""
    handles: list[Any] = []
    missiles = np.flatnonzero(threats.kill_radius > 0.0)
    radars = np.flatnonzero(threats.detection_radius > 0.0)
    centres = threats.position[:, :2]
    if missiles.size:
        radii = kill_radius_at_path(threats, missiles, route)
        axes.add_collection(
            PatchCollection(
                [Circle(tuple(centres[k]), float(r)) for k, r in zip(missiles, radii, strict=True) if r > 0.0],
                facecolor=drawing.MISSILE,
                alpha=0.3,
                edgecolor="none",
                zorder=3,
            )
        )
        axes.add_collection(
            PatchCollection(
                [Circle(tuple(centres[k]), float(threats.kill_radius[k])) for k in missiles],
                facecolor="none",
                edgecolor=drawing.MISSILE,
                linewidth=1.1,
                zorder=3.1,
            )
        )
        handles.append(
            Patch(
                facecolor="#f2bf9f",
                edgecolor=drawing.MISSILE,
                label="missile: line = sphere's radius,\nfill = its reach at path height",
            )
        )
    if radars.size:
        axes.add_collection(
            PatchCollection(
                [Circle(tuple(centres[k]), float(threats.detection_radius[k])) for k in radars],
                facecolor="none",
                edgecolor=drawing.RADAR,
                linewidth=1.1,
                linestyle=_DASHES,
                zorder=3.2,
            )
        )
        label = "radar: sphere's radius\n(at altitude the reach is smaller)"
        handles.append(Line2D([], [], color=drawing.RADAR, linewidth=1.1, linestyle=_DASHES, label=label))
    if len(threats):
        axes.plot(*centres.T, "x", color="#333333", markersize=3.0, markeredgewidth=0.8, zorder=3.3)
    return handles


def kill_radius_at_path(threats: Threats, chosen: NDArray[np.intp], route: Floats | None) -> Floats:
    """Radius (m) of each chosen missile sphere's cut at the height of the path where it passes nearest."""
    radius = threats.kill_radius[chosen]
    if route is None:
        return radius
    _, points = route_samples(route, max(50.0, float(radius.min()) / 20.0))
    points = points[:: max(1, len(points) // 2000)]
    found = np.zeros(len(chosen))
    for row, k in enumerate(chosen):
        nearest = points[np.argmin(((points[:, :2] - threats.position[k, :2]) ** 2).sum(axis=1))]
        above = float(nearest[2] - threats.position[k, 2])
        found[row] = np.sqrt(max(0.0, float(radius[row]) ** 2 - above**2))
    return found


def sphere_cuts(centre: Floats, radius: float, points: Floats) -> tuple[Floats, Floats]:
    """Lower and upper surface (m AMSL) of a sphere over each of the points, NaN where none stands over them.

    centre: (3,), points: (s, 3) m.
    """
    beside2 = ((points[:, :2] - centre[:2]) ** 2).sum(axis=1)
    half = np.sqrt(np.where(beside2 <= radius**2, radius**2 - beside2, np.nan))
    return centre[2] - half, centre[2] + half


@dataclass(frozen=True, slots=True)
class SphereName:
    """Where a sphere's name stands on the profile.

    index: of its threat.  at: (km, m AMSL) on its outline, inside the picture.  prefer: the side of the name.
    """

    index: int
    colour: str
    at: tuple[float, float]
    prefer: tuple[int, int]


def outline_anchor(
    kilometres: Floats, lower: Floats, upper: Floats, low: Floats, high: float
) -> tuple[float, float, tuple[int, int]] | None:
    """Where a name touches a sphere's cut inside a picture from low to high (m AMSL): its top, foot or left side.

    kilometres, lower, upper: (s,), NaN where no sphere stands; low: (s,), the ground where that hides it.  Returns km,
    m AMSL and the side of the name; None where nothing of the outline is in the picture.
    """
    over = np.flatnonzero(np.isfinite(upper))
    top, foot = over[np.argmax(upper[over])], over[np.argmin(lower[over])]
    if low[top] < upper[top] < high:
        return float(kilometres[top]), float(upper[top]), (0, 1)
    if low[foot] < lower[foot] < high:
        return float(kilometres[foot]), float(lower[foot]), (0, -1)
    for edge in (upper, lower):
        # From the left: where the outline stays in the picture, its last point below the picture's upper rim.
        seen = over[(edge[over] > low[over]) & (edge[over] < high - 0.04 * (high - low.min()))]
        if seen.size:
            first = seen[: np.flatnonzero(np.diff(seen, append=seen[-1] + 2) > 1)[0] + 1]
            at = first[np.argmax(edge[first])]
            return float(kilometres[at]), float(edge[at]), (1, 0)
    return None


def draw_entered_cuts(
    axes: Any, threats: Threats, failed: Failures, distance: Floats, points: Floats, ground: Floats | None
) -> dict[int, tuple[float, float]]:
    """Draw the cut of each sphere whose rule fails, where it stands over the flight; returns where to label each.

    distance: (s,) m along the route, points: (s, 3) m of the flight there, ground: (s,) m AMSL or None.
    """
    labels: dict[int, tuple[float, float]] = {}
    low, high = _visible(axes, ground, len(points))
    kilometres = distance / 1000.0
    for place in failed.threats:
        k = place.index or 0
        lower, upper = sphere_cuts(threats.position[k], radius_of(threats, place), points)
        if not np.isfinite(upper).any():
            continue
        axes.fill_between(kilometres, lower, upper, color=drawing.FAIL, alpha=0.16, linewidth=0, zorder=2.6)
        for edge in (lower, upper):
            axes.plot(kilometres, edge, color=drawing.FAIL, linewidth=1.6, zorder=4.6)
        anchor = outline_anchor(kilometres, lower, upper, low, high)
        if anchor is not None:
            labels[k] = anchor[:2]
    return labels


def _visible(axes: Any, ground: Floats | None, count: int) -> tuple[Floats, float]:
    """Lower end at each of so many samples, the ground where it stands in the picture, and upper end (m AMSL)."""
    low, high = axes.get_ylim()
    return np.full(count, low) if ground is None else np.fmax(ground, low), float(high)


def draw_threat_cuts(
    axes: Any, threats: Threats, distance: Floats, points: Floats, ground: Floats | None
) -> tuple[list[Any], list[SphereName]]:
    """Fill what missile and radar spheres take of the vertical plane through the path.

    distance: (s,) m along the path, points: (s, 3) m, ground: (s,) m AMSL or None.  Returns the legend's handles, and
    where to name the spheres that stand over the path, once for each unit.
    """
    handles: list[Any] = []
    names: dict[int, SphereName] = {}
    bottom, top = _visible(axes, ground, len(points))
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    kilometres = distance / 1000.0
    for radii, colour, label in (
        (threats.detection_radius, drawing.RADAR, "radar's sphere over the path"),
        (threats.kill_radius, drawing.MISSILE, "missile's sphere over the path"),
    ):
        missile = colour == drawing.MISSILE
        away = np.maximum(np.maximum(low - threats.position[:, :2], threats.position[:, :2] - high), 0.0)
        for k in np.flatnonzero((radii > 0.0) & (np.hypot(*away.T) <= radii)):
            lower, upper = sphere_cuts(threats.position[k], float(radii[k]), points)
            over = np.isfinite(upper)
            if not over.any():
                continue
            axes.fill_between(
                kilometres, lower, upper, color=colour, alpha=0.22 if missile else 0.05, linewidth=0, zorder=2
            )
            look: dict[str, Any] = {
                "linewidth": 1.1,
                "linestyle": "-" if missile else _DASHES,
                "color": colour,
                "zorder": 2.2,
            }
            axes.plot(kilometres, upper, **look)
            axes.plot(kilometres, lower, **look)
            for edge in np.flatnonzero(np.diff(over.astype(np.int8))) + 1:
                at = kilometres[edge if over[edge] else edge - 1]
                which = edge if over[edge] else edge - 1
                axes.plot([at, at], [lower[which], upper[which]], **look)
            anchor = outline_anchor(kilometres, lower, upper, bottom, top)
            if anchor is not None:
                names[int(k)] = SphereName(int(k), drawing.INK if missile else colour, anchor[:2], anchor[2])
            if not handles or handles[-1].get_label() != label:
                handles.append(
                    Patch(facecolor="#f7d2bd", edgecolor=colour, label=label)
                    if missile
                    else Patch(facecolor="#eef6f3", edgecolor=colour, linestyle=_DASHES, label=label)
                )
    return handles, list(names.values())


# ----------------------------------------------------------------------
# Zones of airspace on the map (their shapes) and on the profile (what they take of the plane through the path).

_HATCH = "////"
# Beyond this number, names of zones would be a grey mat.
_MAX_NAMES = 40


def zone_label(zone: Zone) -> str:
    """A zone's name and band of heights.

    >>> from world.airspace.zones import Cylinder
    >>> zone_label(Zone("mast", "exclusion", Cylinder(0.0, 0.0, 90.0), ceiling=ZoneLevel(120.0, "ground")))
    'mast, below 120 m above ground'
    """
    name = drawing.shorten(zone.name, 24)
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
        look: dict[str, Any] = {"facecolor": "none", "edgecolor": drawing.ZONE, "hatch": _HATCH, "linewidth": 1.1}
        handles.append(Patch(label="zone to keep out of", **look))
    if "inclusion" in kinds:
        handles.append(Line2D([], [], color=drawing.ZONE, linewidth=2.2, label="edge of a zone to stay in"))
    return handles


def draw_zone_shapes(axes: Any, zones: tuple[Zone, ...]) -> list[Any]:
    """Draw zones from above: exclusions hatched, inclusions as a line; returns what the legend shows of them."""
    looks: dict[str, dict[str, Any]] = {
        "exclusion": {"facecolor": (*drawing.ZONE_FILL, 0.14), "hatch": _HATCH, "linewidth": 1.1},
        "inclusion": {"facecolor": "none", "linewidth": 2.2},
    }
    for kind, look in looks.items():
        patches = [PathPatch(_shape(zone)) for zone in zones if zone.kind == kind]
        if patches:
            axes.add_collection(PatchCollection(patches, edgecolor=drawing.ZONE, zorder=3.4, **look))
    return zone_handles(zones)


def _shape(zone: Zone) -> Path:
    """All rings of a zone as one path, so that holes stay open."""
    return Path.make_compound_path(*(Path(ring, closed=True) for ring in zone_rings(zone)))


def name_zones(axes: Any, zones: tuple[Zone, ...], placer: LabelPlacer) -> None:
    """Write exclusions' names and heights in their middles, inclusions' at their northernmost corner."""
    if len(zones) > _MAX_NAMES:
        return
    for zone in zones:
        ring = zone_rings(zone)[0]
        corner = ring[np.argmax(ring[:, 1])]
        place, gap = (ring[:-1].mean(axis=0), 0.0) if zone.kind == "exclusion" else (corner, 3.0)
        (west, east), (south, north) = axes.get_xlim(), axes.get_ylim()
        if west < place[0] < east and south < place[1] < north:
            prefer = (0, 0) if zone.kind == "exclusion" else (0, 1)
            placer.place(
                zone_label(zone), *place.tolist(), size=6.0, gap=gap, prefer=prefer, optional=True, color=drawing.ZONE
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
    look: dict[str, Any] = {"facecolor": (*drawing.ZONE_FILL, 0.14), "edgecolor": drawing.ZONE, "hatch": _HATCH}
    for cut in zone_cuts(zones, points, ground, low, high):
        axes.fill_between(kilometres, cut.bottom, cut.top, where=cut.where, linewidth=0.9, zorder=2.4, **look)
        if cut.zone.kind == "exclusion":
            middle = int(np.flatnonzero(cut.where)[cut.where.sum() // 2])
            height = 0.5 * float(cut.bottom[middle] + cut.top[middle])
            names.append((zone_label(cut.zone), float(kilometres[middle]), height))
    return names
