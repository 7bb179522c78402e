"""Describe threats and zones as layers of a map (outlines) and of a profile (vertical sections)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from logs.views.charts import Label, Layer, shorten
from logs.views.failures import Failures, route_samples, threat_radius
from world.airspace.zone_kernels import edge_distance, zone_records
from world.airspace.zones import Zone, ZoneLevel
from world.airspace.zones_on_map import level_altitudes, zone_rings
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


def threat_circles(threats: Threats, route: Floats | None, failing_threats: frozenset[int]) -> tuple[Layer, ...]:
    """Return layers of missiles and radars from above: the circle of each sphere, and a mark at each unit.

    Each missile also has a filled circle: the section of its sphere at the altitude of the nearest point of the route,
    or the whole circle without a route.

    route: waypoints, m, (w, 3); None without a route.
    failing_threats: indices of the threats for which a rule failed.
    """
    radars, sections, missiles, units = [], [], [], []
    missile_indices = np.flatnonzero(threats.kill_radius > 0.0)
    radius_at_path = np.zeros(len(threats))
    if missile_indices.size:
        radius_at_path[missile_indices] = kill_radius_at_path(threats, missile_indices, route)
    section_name = "missile: its reach at path height" if route is not None else "missile: circle of its sphere"
    for k, name in enumerate(threats.names):
        kill_radius = float(threats.kill_radius[k])
        detection_radius = float(threats.detection_radius[k])
        center = threats.position[k, :2]
        hover_text = "\n".join(
            [
                name,
                *([f"missile: {kill_radius:.0f} m"] if kill_radius > 0.0 else []),
                *([f"radar: {detection_radius:.0f} m"] if detection_radius else []),
            ]
        )
        texts = (hover_text,)
        if detection_radius > 0.0:
            x, y = make_circle_points(center, detection_radius)
            radars.append(
                Layer(
                    "line",
                    name,
                    "radar",
                    x,
                    y,
                    quiet=True,
                    legend="radar: circle of its sphere (its reach is smaller at altitude)",
                )
            )
        if radius_at_path[k] > 0.0:
            x, y = make_circle_points(center, float(radius_at_path[k]))
            sections.append(Layer("area", name, "missile-reach", x, y, legend=section_name, hover_texts=texts))
        if kill_radius > 0.0:
            x, y = make_circle_points(center, kill_radius)
            is_entered = k in failing_threats
            legend = "threat that is entered" if is_entered else "missile: circle of its sphere"
            missiles.append(Layer("line", name, "fail" if is_entered else "missile", x, y, quiet=True, legend=legend))
        units.append(Layer("dots", "", "unit", center[:1], center[1:], hover_texts=texts))
    return (*radars, *sections, *missiles, *units)


def make_circle_points(center: Floats, radius: float) -> tuple[Floats, Floats]:
    """Return east and north of the points of a closed circle, m, (73,) each.

    center: east and north of the circle's center, m, (2,).
    """
    return center[0] + radius * np.cos(_CIRCLE_ANGLES_RAD), center[1] + radius * np.sin(_CIRCLE_ANGLES_RAD)


def threat_labels(threats: Threats, labelled_elsewhere: frozenset[int] = frozenset()) -> tuple[Label, ...]:
    """Return labels with the names of threats at their positions; none for more than `_MAX_NAMES` threats.

    labelled_elsewhere: indices of threats with their own labels.
    """
    if len(threats) > _MAX_NAMES:
        return ()
    return tuple(
        Label(shorten(name, 20), float(east), float(north), "name")
        for k, (name, (east, north, _)) in enumerate(zip(threats.names, threats.position, strict=True))
        if k not in labelled_elsewhere
    )


def kill_radius_at_path(threats: Threats, indices: NDArray[np.intp], route: Floats | None) -> Floats:
    """Return the radius of missile spheres at the altitude of the nearest point of the route, m, (k,).

    The nearest point is the horizontally nearest.  It is 0 if the route passes above or below the sphere; without a
    route it is the sphere's radius.

    indices: indices of the missiles, (k,).
    route: waypoints, m, (w, 3); None without a route.
    """
    radius = threats.kill_radius[indices]
    if route is None:
        return radius
    _, points = route_samples(route, max(50.0, float(radius.min()) / 20.0))
    points = points[:: max(1, len(points) // 2000)]
    section_radii = np.zeros(len(indices))
    for row, k in enumerate(indices):
        nearest_point = points[np.argmin(((points[:, :2] - threats.position[k, :2]) ** 2).sum(axis=1))]
        height_offset = float(nearest_point[2] - threats.position[k, 2])
        section_radii[row] = np.sqrt(max(0.0, float(radius[row]) ** 2 - height_offset**2))
    return section_radii


def cut_sphere(center: Floats, radius: float, points: Floats) -> tuple[Floats, Floats]:
    """Return the altitudes of a sphere's lower and upper surface at points, m AMSL, (s,) each.

    Both are NaN at points horizontally outside the sphere.

    center: center of the sphere, m, (3,).
    points: points, m, (s, 3), whose altitude is ignored.
    """
    distance_square = ((points[:, :2] - center[:2]) ** 2).sum(axis=1)
    half_height = np.sqrt(np.where(distance_square <= radius**2, radius**2 - distance_square, np.nan))
    return center[2] - half_height, center[2] + half_height


def outline_label_position(
    kilometres: Floats, lower: Floats, upper: Floats, min_altitudes: Floats, max_altitude: float
) -> tuple[float, float, tuple[int, int]] | None:
    """Choose where to label the outline of a sphere in a vertical section.

    Return the distance (km) and the altitude (m AMSL) of a visible point of the outline, and the direction from there
    to the label: right and up, each -1, 0 or 1.  Return None if no part of the outline is visible.

    kilometres: distance of each sample along the section, km, (s,).
    lower, upper: altitude of the sphere's surface, m AMSL, (s,), NaN outside the sphere.
    min_altitudes: altitude below which the ground hides the sphere, m AMSL, (s,).
    max_altitude: upper edge of the picture, m AMSL.
    """
    samples_inside = np.flatnonzero(np.isfinite(upper))
    top = samples_inside[np.argmax(upper[samples_inside])]
    bottom = samples_inside[np.argmin(lower[samples_inside])]
    if min_altitudes[top] < upper[top] < max_altitude:
        return float(kilometres[top]), float(upper[top]), (0, 1)
    if min_altitudes[bottom] < lower[bottom] < max_altitude:
        return float(kilometres[bottom]), float(lower[bottom]), (0, -1)
    for edge in (upper, lower):
        # From the left: the highest point of the first part of the outline within the picture.
        visible_samples = samples_inside[
            (edge[samples_inside] > min_altitudes[samples_inside])
            & (edge[samples_inside] < max_altitude - 0.04 * (max_altitude - min_altitudes.min()))
        ]
        if visible_samples.size:
            first_part = visible_samples[
                : np.flatnonzero(np.diff(visible_samples, append=visible_samples[-1] + 2) > 1)[0] + 1
            ]
            label_sample = first_part[np.argmax(edge[first_part])]
            return float(kilometres[label_sample]), float(edge[label_sample]), (1, 0)
    return None


@dataclass(frozen=True, slots=True)
class PathPlane:
    """The vertical plane through a path, in which its profile is drawn.

    kilometres: position of each sample on the profile's horizontal axis, usually the distance along the path, km, (s,).
    points: positions of the samples, m, (s, 3).
    ground: ground altitude under the samples, m AMSL, (s,); None if unknown.
    min_altitude, max_altitude: altitude range of the profile, m AMSL.
    """

    kilometres: Floats
    points: Floats
    ground: Floats | None
    min_altitude: float
    max_altitude: float

    def min_visible_altitudes(self) -> Floats:
        """Return the higher of the ground and the profile's lower edge at each sample, m AMSL, (s,)."""
        base = np.full(len(self.points), self.min_altitude)
        return base if self.ground is None else np.fmax(self.ground, self.min_altitude)


def threat_cuts(
    threats: Threats, plane: PathPlane, labelled_elsewhere: frozenset[int]
) -> tuple[list[Layer], list[Label]]:
    """Cut the spheres of missiles and radars by a vertical plane.

    Return a layer of each section, and the labels.  Radars come first.  At most `_MAX_CUT_NAMES` threats are labelled.

    labelled_elsewhere: indices of threats with their own labels.
    """
    layers: list[Layer] = []
    labels: dict[int, Label] = {}
    min_corner = plane.points[:, :2].min(axis=0)
    max_corner = plane.points[:, :2].max(axis=0)
    distances = np.hypot(
        *np.maximum(np.maximum(min_corner - threats.position[:, :2], threats.position[:, :2] - max_corner), 0.0).T
    )
    for kind, radii in (("radar", threats.detection_radius), ("missile", threats.kill_radius)):
        for k in np.flatnonzero((radii > 0.0) & (distances <= radii)):
            lower, upper = cut_sphere(threats.position[k], float(radii[k]), plane.points)
            samples_inside = np.flatnonzero(np.isfinite(upper))
            if not samples_inside.size:
                continue
            # Add one sample on either side, so that the outline ends at the edge of the sphere.
            rows = slice(max(0, int(samples_inside[0]) - 1), int(samples_inside[-1]) + 2)
            name, legend = f"{threats.names[k][:40]} ({kind})", f"{kind}'s sphere over the path"
            layers.append(Layer("band", name, kind, plane.kilometres[rows], upper[rows], lower[rows], legend=legend))
            label_position = outline_label_position(
                plane.kilometres, lower, upper, plane.min_visible_altitudes(), plane.max_altitude
            )
            if label_position is not None and k not in labelled_elsewhere:
                role = "radar" if kind == "radar" else "ink"
                distance, altitude, direction = label_position
                labels[int(k)] = Label(shorten(threats.names[k], 20), distance, altitude, "name", role, direction)
    return layers, list(labels.values())[:_MAX_CUT_NAMES]


def entered_cuts(
    threats: Threats, failed: Failures, plane: PathPlane
) -> tuple[list[Layer], dict[int, tuple[float, float]]]:
    """Cut the spheres of failing threats by a vertical plane.

    Return a layer of each section, and label positions.  The label positions (km, m AMSL) are keyed by the index of the
    threat; threats without a visible outline have none.
    """
    layers, label_positions = [], {}
    for place in failed.threats:
        k = place.index or 0
        lower, upper = cut_sphere(threats.position[k], threat_radius(threats, place), plane.points)
        if not np.isfinite(upper).any():
            continue
        legend = "threat that is entered"
        layers.append(Layer("band", legend, "entered", plane.kilometres, upper, lower, quiet=True))
        label_position = outline_label_position(
            plane.kilometres, lower, upper, plane.min_visible_altitudes(), plane.max_altitude
        )
        if label_position is not None:
            label_positions[k] = label_position[:2]
    return layers, label_positions


# Zones of airspace.


def zone_text(zone: Zone) -> str:
    """Format the name of a zone, shortened to 24 characters, and its altitude band.

    >>> from world.airspace.zones import Cylinder
    >>> zone_text(Zone("mast", "exclusion", Cylinder(0.0, 0.0, 90.0), ceiling=ZoneLevel(120.0, "ground")))
    'mast, below 120 m above ground'
    """
    name = shorten(zone.name, 24)
    if zone.floor is not None and zone.ceiling is not None:
        if zone.floor.datum == zone.ceiling.datum:
            return f"{name}, {zone.floor.height:g} to {_format_level(zone.ceiling)}"
        return f"{name}, {_format_level(zone.floor)} to {_format_level(zone.ceiling)}"
    if zone.floor is not None:
        return f"{name}, above {_format_level(zone.floor)}"
    return name if zone.ceiling is None else f"{name}, below {_format_level(zone.ceiling)}"


def _format_level(level: ZoneLevel) -> str:
    """Format an altitude limit of a zone with its datum."""
    return f"{level.height:g} m {'AMSL' if level.datum == 'amsl' else 'above ground'}"


def zone_shapes(zones: tuple[Zone, ...]) -> tuple[Layer, ...]:
    """Return a layer of each zone from above.

    An exclusion zone is an area with holes, an inclusion zone a line.
    """
    layers = []
    for zone in zones:
        gap = np.full((1, 2), np.nan)
        x, y = np.vstack([np.vstack([ring, gap]) for ring in zone_rings(zone)])[:-1].T
        texts = (zone_text(zone),)
        if zone.kind == "exclusion":
            layers.append(Layer("area", zone.name, "zone", x, y, legend="zone to keep out of", hover_texts=texts))
        else:
            layers.append(
                Layer("line", zone.name, "stay-in", x, y, legend="edge of a zone to stay in", hover_texts=texts)
            )
    return tuple(layers)


def zone_labels(zones: tuple[Zone, ...]) -> tuple[Label, ...]:
    """Return a label with the name and the altitude band of each zone.

    There are none for more than `_MAX_ZONE_NAMES` zones.  It is at the center of an exclusion zone, and at the
    northernmost corner of an inclusion zone.
    """
    if len(zones) > _MAX_ZONE_NAMES:
        return ()
    labels = []
    for zone in zones:
        ring = zone_rings(zone)[0]
        is_exclusion = zone.kind == "exclusion"
        east, north = (ring[:-1].mean(axis=0) if is_exclusion else ring[np.argmax(ring[:, 1])]).tolist()
        labels.append(Label(zone_text(zone), east, north, "name", "zone", (0, 0) if is_exclusion else (0, 1)))
    return tuple(labels)


@dataclass(frozen=True, slots=True)
class ZoneCut:
    """A part of the vertical plane through a path that a zone forbids.

    bottom, top: lower and upper end of the forbidden altitudes at each sample of the path, m AMSL, (s,).
    is_forbidden: True at samples where the zone forbids these altitudes, (s,).
    """

    zone: Zone
    bottom: Floats
    top: Floats
    is_forbidden: NDArray[np.bool_]


def zone_cuts(zones: tuple[Zone, ...], plane: PathPlane) -> list[ZoneCut]:
    """Return the parts of a vertical plane along a path that zones forbid.

    An exclusion zone forbids the altitudes from its floor to its ceiling.  An inclusion zone forbids the altitudes
    below its floor and above its ceiling, and everything horizontally outside it.  Parts without samples are left out.
    """
    min_altitude, max_altitude, points = plane.min_altitude, plane.max_altitude, plane.points
    terrain = np.full(len(points), min_altitude)
    if plane.ground is not None:
        terrain = np.where(np.isfinite(plane.ground), plane.ground, min_altitude)
    records, cuts = zone_records(zones), []
    for z, zone in enumerate(zones):
        is_over_zone = np.array([edge_distance(records, z, east, north) <= 0.0 for east, north, _ in points])
        floor = np.clip(level_altitudes(zone.floor, terrain, min_altitude), min_altitude, max_altitude)
        ceiling = np.clip(level_altitudes(zone.ceiling, terrain, max_altitude), min_altitude, max_altitude)
        bands = [(floor, ceiling, is_over_zone)]
        if zone.kind == "inclusion":
            whole_range = np.full(len(points), min_altitude), np.full(len(points), max_altitude)
            bands = [
                (whole_range[0], floor, is_over_zone),
                (ceiling, whole_range[1], is_over_zone),
                (*whole_range, ~is_over_zone),
            ]
        cuts += [ZoneCut(zone, bottom, top, is_forbidden & (top > bottom)) for bottom, top, is_forbidden in bands]
    return [cut for cut in cuts if cut.is_forbidden.any()]


def zone_bands(zones: tuple[Zone, ...], plane: PathPlane) -> tuple[list[Layer], list[Label]]:
    """Return a layer of each part of a vertical plane that a zone forbids, and labels of zones.

    Only exclusion zones are labelled.  At most `_MAX_CUT_NAMES` parts are labelled.
    """
    layers, labels = [], []
    for cut in zone_cuts(zones, plane):
        is_exclusion = cut.zone.kind == "exclusion"
        legend = "zone to keep out of" if is_exclusion else "outside a zone to stay in"
        top = np.where(cut.is_forbidden, cut.top, np.nan)
        layers.append(Layer("band", zone_text(cut.zone), "zone", plane.kilometres, top, cut.bottom, legend=legend))
        if is_exclusion:
            middle = int(np.flatnonzero(cut.is_forbidden)[cut.is_forbidden.sum() // 2])
            amsl = 0.5 * float(cut.bottom[middle] + cut.top[middle])
            labels.append(Label(zone_text(cut.zone), float(plane.kilometres[middle]), amsl, "name", "zone", (0, 0)))
    return layers, labels[:_MAX_CUT_NAMES]
