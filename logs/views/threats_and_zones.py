"""Draw threats and zones on the map (their outlines) and on the profile (their sections above the path)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from logs.views.charts import Label, Layer, shorten
from logs.views.failures import Failures, radius_of, route_samples
from world.airspace.zone_kernels import edge_distance, zone_records
from world.airspace.zones import Zone, ZoneLevel
from world.airspace.zones_on_map import level_heights, zone_rings
from world.arrays import Floats
from world.threats import Threats

# Largest number of named threats on the map; more names would be unreadable.
_MAX_NAMES = 80
# Largest number of named zones on the map.
_MAX_ZONE_NAMES = 40
# Largest number of named sections on the profile.
_MAX_CUT_NAMES = 24
# Angles of the points of a circle, rad.
_CIRCLE_ANGLES_RAD = np.linspace(0.0, 2.0 * np.pi, 73)


# Threats.


def threat_circles(threats: Threats, route: Floats | None, entered: frozenset[int]) -> tuple[Layer, ...]:
    """Return circles of missiles and radars from above, m: the sphere as a line, its section at the path filled.

    route: (w, 3) m, or None to show only the spheres.  entered: threats whose rule fails.
    """
    radars, reach, missiles, units = [], [], [], []
    shown = np.flatnonzero(threats.kill_radius > 0.0)
    at_path = np.zeros(len(threats))
    if shown.size:
        at_path[shown] = kill_radius_at_path(threats, shown, route)
    called = "missile: its reach at path height" if route is not None else "missile: circle of its sphere"
    for k, name in enumerate(threats.names):
        kill, detection = float(threats.kill_radius[k]), float(threats.detection_radius[k])
        centre = threats.position[k, :2]
        words = (_threat_words(name, kill, detection),)
        if detection > 0.0:
            x, y = circle(centre, detection)
            radars.append(
                Layer(
                    "line",
                    name,
                    "radar",
                    x,
                    y,
                    quiet=True,
                    legend="radar: circle of its sphere (at altitude it reaches less far)",
                )
            )
        if at_path[k] > 0.0:
            x, y = circle(centre, float(at_path[k]))
            reach.append(Layer("area", name, "missile-reach", x, y, legend=called, words=words))
        if kill > 0.0:
            x, y = circle(centre, kill)
            fails = k in entered
            legend = "threat that is entered" if fails else "missile: circle of its sphere"
            missiles.append(Layer("line", name, "fail" if fails else "missile", x, y, quiet=True, legend=legend))
        units.append(Layer("dots", "", "unit", centre[:1], centre[1:], words=words))
    return (*radars, *reach, *missiles, *units)


def _threat_words(name: str, kill: float, detection: float) -> str:
    return "\n".join(
        [
            name,
            *([f"missile: {kill:.0f} m"] if kill > 0.0 else []),
            *([f"radar: {detection:.0f} m"] if detection else []),
        ]
    )


def circle(centre: Floats, radius: float) -> tuple[Floats, Floats]:
    """Return east and north (73,) of a closed circle."""
    return centre[0] + radius * np.cos(_CIRCLE_ANGLES_RAD), centre[1] + radius * np.sin(_CIRCLE_ANGLES_RAD)


def threat_names(threats: Threats, names: frozenset[int] = frozenset()) -> tuple[Label, ...]:
    """Return the names of threats at their positions on the map.  named: threats with their own labels."""
    if len(threats) > _MAX_NAMES:
        return ()
    return tuple(
        Label(shorten(name, 20), float(east), float(north), "name")
        for k, (name, (east, north, _)) in enumerate(zip(threats.names, threats.position, strict=True))
        if k not in names
    )


def kill_radius_at_path(threats: Threats, chosen: NDArray[np.intp], route: Floats | None) -> Floats:
    """Return the section radius (m) of each chosen missile sphere at the nearest altitude of the path."""
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
    """Return lower and upper surface (m AMSL) of a sphere at each of the points, NaN outside the sphere.

    centre: (3,), points: (s, 3) m.
    """
    beside2 = ((points[:, :2] - centre[:2]) ** 2).sum(axis=1)
    half = np.sqrt(np.where(beside2 <= radius**2, radius**2 - beside2, np.nan))
    return centre[2] - half, centre[2] + half


def outline_anchor(
    kilometres: Floats, lower: Floats, upper: Floats, low: Floats, high: float
) -> tuple[float, float, tuple[int, int]] | None:
    """Find where a name touches the section of a sphere inside a picture from low to high (m AMSL).

    kilometres, lower, upper: (s,), NaN outside the sphere; low: (s,), the ground where it hides the sphere.  Returns
    km, m AMSL and the side of the name; None if no part of the outline is in the picture.
    """
    over = np.flatnonzero(np.isfinite(upper))
    top, foot = over[np.argmax(upper[over])], over[np.argmin(lower[over])]
    if low[top] < upper[top] < high:
        return float(kilometres[top]), float(upper[top]), (0, 1)
    if low[foot] < lower[foot] < high:
        return float(kilometres[foot]), float(lower[foot]), (0, -1)
    for edge in (upper, lower):
        # From the left: the highest point of the first part of the outline within the picture.
        seen = over[(edge[over] > low[over]) & (edge[over] < high - 0.04 * (high - low.min()))]
        if seen.size:
            first = seen[: np.flatnonzero(np.diff(seen, append=seen[-1] + 2) > 1)[0] + 1]
            at = first[np.argmax(edge[first])]
            return float(kilometres[at]), float(edge[at]), (1, 0)
    return None


@dataclass(frozen=True, slots=True)
class PathPlane:
    """Vertical plane through a path, for its profile.

    kilometres: (s,) along the path.  points: (s, 3) m.  ground: (s,) m AMSL under the points, or None if unknown.
    low, high: altitude range of the profile, m AMSL.
    """

    kilometres: Floats
    points: Floats
    ground: Floats | None
    low: float
    high: float

    def visible_low(self) -> Floats:
        """Return the lowest visible altitude at each sample, (s,) m AMSL: the ground, if it is in the picture."""
        base = np.full(len(self.points), self.low)
        return base if self.ground is None else np.fmax(self.ground, self.low)


def threat_cuts(threats: Threats, plane: PathPlane, named: frozenset[int]) -> tuple[list[Layer], list[Label]]:
    """Return the sections of missile and radar spheres, radars first, and their names, once for each unit.

    named: threats with their own labels.
    """
    layers: list[Layer] = []
    labels: dict[int, Label] = {}
    low, high = plane.points[:, :2].min(axis=0), plane.points[:, :2].max(axis=0)
    away = np.hypot(*np.maximum(np.maximum(low - threats.position[:, :2], threats.position[:, :2] - high), 0.0).T)
    for kind, radii in (("radar", threats.detection_radius), ("missile", threats.kill_radius)):
        for k in np.flatnonzero((radii > 0.0) & (away <= radii)):
            lower, upper = sphere_cuts(threats.position[k], float(radii[k]), plane.points)
            over = np.flatnonzero(np.isfinite(upper))
            if not over.size:
                continue
            # Add one sample on either side, so that the outline ends at the edge of the sphere.
            cut = slice(max(0, int(over[0]) - 1), int(over[-1]) + 2)
            name, legend = f"{threats.names[k][:40]} ({kind})", f"{kind}'s sphere over the path"
            layers.append(Layer("band", name, kind, plane.kilometres[cut], upper[cut], lower[cut], legend=legend))
            anchor = outline_anchor(plane.kilometres, lower, upper, plane.visible_low(), plane.high)
            if anchor is not None and k not in named:
                role = "radar" if kind == "radar" else "ink"
                labels[int(k)] = Label(shorten(threats.names[k], 20), anchor[0], anchor[1], "name", role, anchor[2])
    return layers, list(labels.values())[:_MAX_CUT_NAMES]


def entered_cuts(
    threats: Threats, failed: Failures, plane: PathPlane
) -> tuple[list[Layer], dict[int, tuple[float, float]]]:
    """Return the section along the flight of each sphere whose rule fails, and its label position, by index."""
    layers, places = [], {}
    for place in failed.threats:
        k = place.index or 0
        lower, upper = sphere_cuts(threats.position[k], radius_of(threats, place), plane.points)
        if not np.isfinite(upper).any():
            continue
        legend = "threat that is entered"
        layers.append(Layer("band", legend, "entered", plane.kilometres, upper, lower, quiet=True))
        anchor = outline_anchor(plane.kilometres, lower, upper, plane.visible_low(), plane.high)
        if anchor is not None:
            places[k] = anchor[:2]
    return layers, places


# Zones of airspace.


def zone_label(zone: Zone) -> str:
    """Return name and altitude band of a zone.

    >>> from world.airspace.zones import Cylinder
    >>> zone_label(Zone("mast", "exclusion", Cylinder(0.0, 0.0, 90.0), ceiling=ZoneLevel(120.0, "ground")))
    'mast, below 120 m above ground'
    """
    name = shorten(zone.name, 24)
    if zone.floor is not None and zone.ceiling is not None:
        if zone.floor.datum == zone.ceiling.datum:
            return f"{name}, {zone.floor.height:g} to {_level_text(zone.ceiling)}"
        return f"{name}, {_level_text(zone.floor)} to {_level_text(zone.ceiling)}"
    if zone.floor is not None:
        return f"{name}, above {_level_text(zone.floor)}"
    return name if zone.ceiling is None else f"{name}, below {_level_text(zone.ceiling)}"


def _level_text(level: ZoneLevel) -> str:
    return f"{level.height:g} m {'AMSL' if level.datum == 'amsl' else 'above ground'}"


def zone_shapes(zones: tuple[Zone, ...]) -> tuple[Layer, ...]:
    """Return zones from above, m: exclusion zones as areas with open holes, inclusion zones as lines."""
    layers = []
    for zone in zones:
        gap = np.full((1, 2), np.nan)
        x, y = np.vstack([np.vstack([ring, gap]) for ring in zone_rings(zone)])[:-1].T
        words = (zone_label(zone),)
        if zone.kind == "exclusion":
            layers.append(Layer("area", zone.name, "zone", x, y, legend="zone to keep out of", words=words))
        else:
            layers.append(Layer("line", zone.name, "stay-in", x, y, legend="edge of a zone to stay in", words=words))
    return tuple(layers)


def zone_names(zones: tuple[Zone, ...]) -> tuple[Label, ...]:
    """Label zones: exclusion zones at the center, inclusion zones at their northernmost corner."""
    if len(zones) > _MAX_ZONE_NAMES:
        return ()
    found = []
    for zone in zones:
        ring = zone_rings(zone)[0]
        inside = zone.kind == "exclusion"
        east, north = (ring[:-1].mean(axis=0) if inside else ring[np.argmax(ring[:, 1])]).tolist()
        found.append(Label(zone_label(zone), east, north, "name", "zone", (0, 0) if inside else (0, 1)))
    return tuple(found)


@dataclass(frozen=True, slots=True)
class ZoneCut:
    """Part of the vertical plane through a path that a zone forbids.

    zone: the zone.
    bottom, top: (s,) m AMSL at each sample of the path.
    where: (s,) bool, True at samples with a forbidden range.
    """

    zone: Zone
    bottom: Floats
    top: Floats
    where: NDArray[np.bool_]


def zone_cuts(zones: tuple[Zone, ...], plane: PathPlane) -> list[ZoneCut]:
    """Return the sections of zones in the plane, without zones away from the path."""
    low, high, points = plane.low, plane.high, plane.points
    under = np.full(len(points), low)
    if plane.ground is not None:
        under = np.where(np.isfinite(plane.ground), plane.ground, low)
    records, cuts = zone_records(zones), []
    for z, zone in enumerate(zones):
        over = np.array([edge_distance(records, z, east, north) <= 0.0 for east, north, _ in points])
        floor = np.clip(level_heights(zone.floor, under, low), low, high)
        ceiling = np.clip(level_heights(zone.ceiling, under, high), low, high)
        bands = [(floor, ceiling, over)]
        if zone.kind == "inclusion":
            full = np.full(len(points), low), np.full(len(points), high)
            bands = [(full[0], floor, over), (ceiling, full[1], over), (*full, ~over)]
        cuts += [ZoneCut(zone, bottom, top, where & (top > bottom)) for bottom, top, where in bands]
    return [cut for cut in cuts if cut.where.any()]


def zone_bands(zones: tuple[Zone, ...], plane: PathPlane) -> tuple[list[Layer], list[Label]]:
    """Return the sections of zones in the plane, and the names of exclusion zones in the center of each."""
    layers, labels = [], []
    for cut in zone_cuts(zones, plane):
        keep_out = cut.zone.kind == "exclusion"
        legend = "zone to keep out of" if keep_out else "outside a zone to stay in"
        top = np.where(cut.where, cut.top, np.nan)
        layers.append(Layer("band", zone_label(cut.zone), "zone", plane.kilometres, top, cut.bottom, legend=legend))
        if keep_out:
            middle = int(np.flatnonzero(cut.where)[cut.where.sum() // 2])
            amsl = 0.5 * float(cut.bottom[middle] + cut.top[middle])
            labels.append(Label(zone_label(cut.zone), float(plane.kilometres[middle]), amsl, "name", "zone", (0, 0)))
    return layers, labels[:_MAX_CUT_NAMES]
