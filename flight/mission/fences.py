"""Convert geofences from and to zones, and test positions against them."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from flight.mission.items import Command, Frame, ItemProblem, Mission, MissionItem, round_to_grid
from world.airspace.zones import Cylinder, Polygon, Ring, Zone, ZoneKind, is_hole, make_cylinder, make_polygon
from world.airspace.zones_on_map import add_corner_count, ring_on_map
from world.arrays import Floats
from world.errors import MissionError
from world.frames import GeoOrigin, to_geo, to_map
from world.scenario import Scenario

# ----------------------------------------------------------------------
# A scenario's zones as fence items, and notes on what a fence cannot represent.

# Fence command of a circle, by the kind of zone.
_CIRCLE_COMMANDS = {
    "inclusion": Command.NAV_FENCE_CIRCLE_INCLUSION,
    "exclusion": Command.NAV_FENCE_CIRCLE_EXCLUSION,
}
# Fence command of a polygon's vertex, by the kind of zone.
_POLYGON_COMMANDS = {
    "inclusion": Command.NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    "exclusion": Command.NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
}


def fence_item(origin: GeoOrigin, command: Command, param1: float, position: Sequence[float] | Floats) -> MissionItem:
    """Return a fence item (a polygon's corner or a circle) at a position (east, north, m).

    param1: number of corners of the polygon, or radius of the circle, m.

    >>> item = fence_item(GeoOrigin(36.5, -84.2), Command.NAV_FENCE_CIRCLE_EXCLUSION, 200.0, (0.0, 0.0))
    >>> item.params[0], round(item.lat_deg, 6)
    (200.0, 36.5)
    """
    lat, lon = to_geo(origin, float(position[0]), float(position[1]))
    params = (round(param1, 3), 0.0, 0.0, 0.0)
    return MissionItem(
        0, int(command), int(Frame.GLOBAL), params, round_to_grid(float(lat)), round_to_grid(float(lon)), 0.0
    )


def zone_fences(zones: Sequence[Zone], origin: GeoOrigin) -> tuple[list[MissionItem], list[str]]:
    """Return the fence items of zones, and notes on what a fence cannot represent.

    A cylinder becomes a circle, and an outline becomes a polygon. A hole in an inclusion becomes an exclusion. A hole
    in an exclusion is closed. An inclusion of several parts is omitted, because an autopilot requires the aircraft to
    be inside every inclusion. Fences have no floor and no ceiling.

    >>> zone = Zone("mast", "exclusion", Cylinder(0.0, 500.0, 200.0))
    >>> items, notes = zone_fences([zone], GeoOrigin(36.5, -84.2))
    >>> [(item.command, item.params[0]) for item in items], notes
    ([(5004, 200.0)], [])
    """
    items, closed_names, omitted_names = [], [], []
    for zone in zones:
        rings = () if isinstance(zone.shape, Cylinder) else zone.shape.rings
        holes = [ring for ring in rings if is_hole(ring)]
        if zone.kind == "inclusion" and len(rings) - len(holes) > 1:
            omitted_names.append(zone.name)
            continue
        if zone.kind == "exclusion" and holes:
            closed_names.append(zone.name)
        if isinstance(zone.shape, Cylinder):
            position = (zone.shape.east, zone.shape.north)
            items.append(fence_item(origin, _CIRCLE_COMMANDS[zone.kind], zone.shape.radius, position))
        for ring in rings:
            if not is_hole(ring):
                items += _ring_items(ring, _POLYGON_COMMANDS[zone.kind], origin)
            elif zone.kind == "inclusion":
                items += _ring_items(ring, _POLYGON_COMMANDS["exclusion"], origin)
    banded_names = [zone.name for zone in zones if zone.floor is not None or zone.ceiling is not None]
    notes = []
    if banded_names:
        notes.append(
            f"a fence has no floor and no ceiling: {_join_names_with_verb(banded_names)} fenced at every height"
        )
    if closed_names:
        notes.append(
            f"an exclusion of a fence cannot have holes: {_join_names_with_verb(closed_names)} written without holes"
        )
    if omitted_names:
        notes.append(
            f"a flight must stay inside every inclusion of a fence: {_join_names_with_verb(omitted_names)} "
            "omitted, because of several separate parts"
        )
    return items, notes


def _ring_items(ring: Ring, command: Command, origin: GeoOrigin) -> Iterator[MissionItem]:
    """Yield a fence item for each corner of a ring."""
    for corner in ring:
        yield fence_item(origin, command, float(len(ring)), corner)


def _join_names_with_verb(names: list[str]) -> str:
    """Return the start of a sentence: up to three names, the number of other names, and "is" or "are"."""
    remainder = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return ", ".join(names[:3]) + remainder + (" is" if len(names) == 1 else " are")


# ----------------------------------------------------------------------
# Shapes of a geofence, tests of positions against them, and the fence of a scenario.


# Commands of a polygon's vertices.
POLYGONS = (Command.NAV_FENCE_POLYGON_VERTEX_INCLUSION, Command.NAV_FENCE_POLYGON_VERTEX_EXCLUSION)
# Commands of inclusions.
INCLUSIONS = (Command.NAV_FENCE_POLYGON_VERTEX_INCLUSION, Command.NAV_FENCE_CIRCLE_INCLUSION)

# Maximum number of omitted zones that a note names.
_MAX_NAMES = 12


def fence_shapes(fences: tuple[MissionItem, ...], source: str = "fence") -> list[tuple[MissionItem, ...]]:
    """Group fence items into shapes, each the corners of one polygon or a single circle.

    Raises MissionError if a polygon has fewer corners than stated.
    """
    shapes = []
    k = 0
    while k < len(fences):
        item = fences[k]
        count = int(item.params[0]) if item.command in POLYGONS else 1
        shape = fences[k : k + count]
        if len(shape) < count or any(
            corner.command != item.command or (count > 1 and corner.params[0] != item.params[0]) for corner in shape
        ):
            problem = ItemProblem("p1", item.params[0], "the polygon has fewer corners than this number")
            raise MissionError(**problem.error_arguments(source, f"{source}: fence item {item.seq}"))
        shapes.append(shape)
        k += count
    return shapes


def fence_problem(
    fences: tuple[MissionItem, ...],
    origin: GeoOrigin,
    east: float,
    north: float,
    *,
    any_inclusion_suffices: bool = False,
) -> tuple[str, int] | None:
    """Return the first fence that a position violates, or None.

    The result is a description of the fence and the number of its first item.

    fences: fence items (5001..5004), in which the corners of a polygon follow each other.
    east, north: m on the map about ``origin``.
    any_inclusion_suffices: True if a position must be inside at least one inclusion; False if it must be inside every
        inclusion.

    Raises MissionError if a polygon has fewer corners than stated.

    >>> radius = (500.0, 0.0, 0.0, 0.0)
    >>> circle = MissionItem(0, Command.NAV_FENCE_CIRCLE_INCLUSION, Frame.GLOBAL, radius, 36.5, -84.2, 0.0)
    >>> origin = GeoOrigin(36.5, -84.2)
    >>> fence_problem((circle,), origin, east=0.0, north=600.0)
    ('outside an inclusion circle of radius 500 m', 0)
    >>> fence_problem((circle,), origin, east=0.0, north=400.0) is None
    True
    """
    first_violation: tuple[str, int] | None = None
    is_in_inclusion = False
    for shape in fence_shapes(fences):
        item = shape[0]
        lat, lon = [corner.lat_deg for corner in shape], [corner.lon_deg for corner in shape]
        corners_east, corners_north = to_map(origin, lat, lon)
        if item.command in POLYGONS:
            # A ray to the east crosses the polygon's edges an odd number of times if it starts inside.
            start_east, start_north = np.asarray(corners_east), np.asarray(corners_north)
            end_east, end_north = np.roll(start_east, -1), np.roll(start_north, -1)
            is_crossed = (start_north > north) != (end_north > north)
            north_extent = np.where(is_crossed, end_north - start_north, 1.0)
            crossing_east = start_east + (north - start_north) / north_extent * (end_east - start_east)
            is_inside = bool((is_crossed & (crossing_east > east)).sum() % 2)
            name = "polygon"
        else:
            is_inside = math.hypot(east - float(corners_east[0]), north - float(corners_north[0])) <= item.params[0]
            name = f"circle of radius {item.params[0]:.0f} m"
        if is_inside == (item.command in INCLUSIONS):
            is_in_inclusion |= is_inside
            continue
        problem = f"{'outside an inclusion' if not is_inside else 'inside an exclusion'} {name}", item.seq
        if is_inside or not any_inclusion_suffices:
            return problem
        first_violation = first_violation or problem
    return None if is_in_inclusion else first_violation


def describe_rally_violations(mission: Mission, origin: GeoOrigin, *, any_inclusion_suffices: bool) -> tuple[str, ...]:
    """Return a sentence on each rally point that violates the mission's fence.

    any_inclusion_suffices: see `fence_problem`.

    Raises MissionError if a polygon has fewer corners than stated.
    """
    sentences = []
    for number, point in enumerate(mission.rally, 1):
        if not point.has_position:
            continue
        east, north = map(float, to_map(origin, point.lat_deg, point.lon_deg))
        problem = fence_problem(mission.fences, origin, east, north, any_inclusion_suffices=any_inclusion_suffices)
        if problem is not None:
            violation, fence_item = problem
            sentences.append(
                f"rally point {number} lies {violation} (fence item {fence_item}): a return to it violates the fence"
            )
    return tuple(sentences)


# Test whether a mission's path passes through a fence shape, given as its items, at any altitude.
PassTest = Callable[[tuple[MissionItem, ...]], bool]


def with_fences(mission: Mission, scenario: Scenario, passes: PassTest) -> tuple[Mission, tuple[str, ...]]:
    """Return a mission with a scenario's area, threats and zones as its fence, and notes for the user.

    passes: test whether the mission passes through a fence shape, at any altitude.

    The area becomes an inclusion polygon of four corners. The kill radius of each missile becomes an exclusion circle.
    Radars are omitted, because detection is not forbidden. Zones are converted by `zone_fences`. The fence items that
    the mission already has are appended.

    A fence has no height limits. Therefore an exclusion that the mission passes above or below is omitted: with it, an
    autopilot would refuse or abort the mission. The notes list what a fence cannot represent, and what is omitted.

    >>> from world.scenario import load_scenario
    >>> fenced, notes = with_fences(Mission(None, ()), load_scenario("tight"), lambda shape: False)
    >>> [len(shape) for shape in fence_shapes(fenced.fences)][:4]  # the area's corners, then a circle a missile
    [4, 1, 1, 1]
    >>> notes
    ('28 missile spheres became exclusion circles: a fence has no height limits, so it applies at every height',)
    """
    (west, east), (south, north) = scenario.bounds
    corners = np.array([[west, south], [east, south], [east, north], [west, north]])
    fences = [fence_item(scenario.origin, Command.NAV_FENCE_POLYGON_VERTEX_INCLUSION, 4.0, point) for point in corners]
    threats = scenario.threats
    # A cylinder with the missile's kill radius for each missile.
    cylinders = [
        Zone(str(name), "exclusion", make_cylinder(float(position[0]), float(position[1]), float(radius)))
        for name, position, radius in zip(threats.names, threats.position, threats.kill_radius, strict=True)
        if radius > 0.0
    ]
    missile_zones, omitted_missiles = _omit_crossed_exclusions(cylinders, scenario.origin, passes)
    zones, omitted_zones = _omit_crossed_exclusions(scenario.zones, scenario.origin, passes)
    fences += zone_fences(missile_zones, scenario.origin)[0]
    items, zone_notes = zone_fences(zones, scenario.origin)
    fences += items
    notes = []
    if missile_zones:
        count = "1 missile sphere" if len(missile_zones) == 1 else f"{len(missile_zones)} missile spheres"
        change_text = "became an exclusion circle" if len(missile_zones) == 1 else "became exclusion circles"
        notes.append(f"{count} {change_text}: a fence has no height limits, so it applies at every height")
    omitted_names = [*omitted_missiles, *omitted_zones]
    if omitted_names:
        names = ", ".join(omitted_names[:_MAX_NAMES]) + (
            f" and {len(omitted_names) - _MAX_NAMES} more" if len(omitted_names) > _MAX_NAMES else ""
        )
        notes.append(
            f"the mission passes above or below {names}, so the fence omits"
            f" {'them' if len(omitted_names) > 1 else 'it'}. A fence has "
            "no height limits, so an autopilot would refuse or abort the mission"
        )
    notes += zone_notes
    if scenario.limits.max_height_m is not None:
        limit_text = f"{scenario.limits.max_height_m:g} m above ground"
        notes.append(f"a fence does not follow the ground: the maximum height of {limit_text} is not part of it")
    all_fences = number_items([*fences, *mission.fences])
    return replace(mission, fences=all_fences), tuple(notes)


def _omit_crossed_exclusions(
    zones: Sequence[Zone], origin: GeoOrigin, passes: PassTest
) -> tuple[list[Zone], list[str]]:
    """Return the zones to write to the fence, and the names of the exclusions to omit.

    An exclusion is omitted if the mission crosses it on the map.

    passes: function that returns True if the mission passes through a fence shape, at any altitude.
    """
    remaining, crossed_names = [], []
    for zone in zones:
        if zone.kind == "exclusion" and passes(number_items(zone_fences([zone], origin)[0])):
            crossed_names.append(zone.name)
        else:
            remaining.append(zone)
    return remaining, crossed_names


def number_items(items: Sequence[MissionItem]) -> tuple[MissionItem, ...]:
    """Return fence items or rally points numbered from 0, as a vehicle stores them.

    >>> item = MissionItem(7, Command.NAV_RALLY_POINT, Frame.GLOBAL, (0.0,) * 4, 36.5, -84.2, 0.0)
    >>> [one.seq for one in number_items([item, item])]
    [0, 1]
    """
    return tuple(replace(item, seq=k) for k, item in enumerate(items))


# ----------------------------------------------------------------------
# Conversion of a mission's own fence to airspace zones on the map.


def fence_zones(fences: tuple[MissionItem, ...], origin: GeoOrigin, source: str = "fence") -> tuple[Zone, ...]:
    """Convert fence items (MAV_CMD 5001..5004) to zones on the map, without floor and ceiling.

    source: name of the mission in messages.

    Each zone is named after its first fence item. Raises MissionError if a polygon has fewer corners than stated, or if
    a shape is invalid.

    >>> from flight.mission.items import Command, Frame
    >>> radius = (500.0, 0.0, 0.0, 0.0)
    >>> circle = MissionItem(0, Command.NAV_FENCE_CIRCLE_INCLUSION, Frame.GLOBAL, radius, 36.5, -84.2, 0.0)
    >>> zone, = fence_zones((circle,), GeoOrigin(36.5, -84.2))
    >>> zone.name, zone.kind, zone.shape.radius
    ('fence item 0', 'inclusion', 500.0)
    """
    zones, corner_count = [], 0
    shape: Polygon | Cylinder
    for corners in fence_shapes(fences, source):
        first = corners[0]
        try:
            if first.command in POLYGONS:
                shape = make_polygon([ring_on_map(origin, [(corner.lat_deg, corner.lon_deg) for corner in corners])])
            else:
                east, north = to_map(origin, first.lat_deg, first.lon_deg)
                shape = make_cylinder(float(east), float(north), first.params[0])
            corner_count = add_corner_count(corner_count, shape)
        except ValueError as error:
            item = f"fence item {first.seq}"
            raise MissionError(f"{source}: {item}: {error}", file=source, field=item) from error
        kind: ZoneKind = "inclusion" if first.command in INCLUSIONS else "exclusion"
        zones.append(Zone(f"fence item {first.seq}", kind, shape))
    return tuple(zones)
