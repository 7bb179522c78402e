"""Make maps: terrain, threats, zones, planned path and flown track from above."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flight.mission.itinerary import NO_ITEM
from flight.simulation.track import Track
from logs.verdict.verdict import Verdict
from logs.views.charts import (
    NUMBERED_ITEM,
    NUMBERED_WAYPOINT,
    Json,
    Label,
    Layer,
    Panel,
    json_numbers,
    panel_json,
    shorten,
)
from logs.views.failures import (
    collect_failures,
    find_rows_inside_threats,
    make_fail_labels,
    paths_differ,
    stop_start_indices,
)
from logs.views.threats_and_zones import threat_circles, threat_labels, zone_labels, zone_shapes
from world.airspace.zones_on_map import zone_rings
from world.arrays import Floats
from world.scenario import Scenario
from world.terrain import Terrain
from world.wind import Wind

# Smallest and largest ratio of a map's height to its width; a longer or wider area is drawn with ground around it.
_ASPECTS = (0.4, 1.25)
# Margin around an area, as a fraction of its longer side.
_RIM = 0.015
# Margin around a mission without an area, as a fraction of its longer side.
_MISSION_RIM = 0.1
# With more waypoints than this, only every n-th waypoint is numbered.
_MAX_NUMBERS = 40
# With more waypoints than this, their dots are small.
_MAX_DOTS = 80
# Largest number of points of a drawn track.
_MAX_POINTS = 6000

# East and north range, m.
Extent = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True, slots=True)
class NamedWind:
    """A wind shown at the compass.

    name: name of the flight in this wind; "" if there is only one wind.
    role: role in `logs.theme` that gives the arrow's colour.
    """

    wind: Wind
    name: str = ""
    role: str = "second"


@dataclass(frozen=True, slots=True)
class DrawnTrack:
    """A flown track to draw, with its legend text and its role.

    flight: index of the flight in the page's list of flights, which contains their moments.
    """

    label: str
    track: Track
    role: str = "flown"
    flight: int = 0


@dataclass(frozen=True, slots=True)
class MapChart:
    """A map with north up and equal scales; lengths are in m, and axes are labelled in km.

    title: title of the map.
    panel: layers of threats, zones and paths, from the lowest, and their labels.
    east, north: range shown, (min, max), m.
    origin: latitude and longitude of the axes' origin, as text.
    terrain: terrain under all layers; None if there is none.
    winds: winds shown at the compass.
    """

    title: str
    panel: Panel
    east: tuple[float, float]
    north: tuple[float, float]
    origin: str
    terrain: Terrain | None
    winds: tuple[NamedWind, ...]


def flight_map(
    scenario: Scenario,
    *,
    plan_waypoints: Floats | None,
    route_waypoints: Floats | None,
    track: Track | None,
    verdict: Verdict | None,
    waypoint_texts: Sequence[str] = (),
    stops: Sequence[int] | None = None,
    items: Sequence[int] | None = None,
) -> MapChart:
    """Make the map of a plan, or of its flight.

    The waypoints of the route are numbered, and places at which the verdict's rules failed are marked.  A plan that
    differs from the route by more than 1 m is drawn as a second line.  The outline of a missile is its sphere seen from
    above; the filled circle is the section of the sphere at the altitude of the nearest point of the path.

    plan_waypoints: waypoints of the plan, m, (p, 3); None without a plan.
    route_waypoints: waypoints of the mission's route, m, (w, 3); None for only a plan.
    track: flown track; None for a plan that was not flown.
    verdict: verdict whose failures are marked; None to mark none.
    waypoint_texts: text that the page shows for each waypoint of the route; empty for none.
    stops: number of the stop to which each waypoint of the route belongs; None if each waypoint is a stop.
    items: number of the mission item of each waypoint, which the map shows; no number is shown for `NO_ITEM`.  None to
        show the numbers of the stops.
    """
    return map_chart(
        scenario,
        f"{'plan' if track is None else 'plan and flight'} from above",
        plan_waypoints=plan_waypoints,
        route_waypoints=route_waypoints,
        tracks=(DrawnTrack("flown track", track),) if track is not None else (),
        winds=(NamedWind(scenario.wind),),
        verdict=verdict,
        waypoint_texts=waypoint_texts,
        stops=stops,
        items=items,
    )


def map_chart(
    scenario: Scenario,
    subject: str,
    *,
    plan_waypoints: Floats | None,
    route_waypoints: Floats | None,
    tracks: Sequence[DrawnTrack],
    winds: Sequence[NamedWind],
    verdict: Verdict | None,
    waypoint_texts: Sequence[str] = (),
    stops: Sequence[int] | None = None,
    items: Sequence[int] | None = None,
) -> MapChart:
    """Make a map like `flight_map`, with any number of tracks and winds.

    subject: part of the title after the name of the scenario.
    tracks: flown tracks; tracks without rows are ignored.
    winds: winds shown at the compass.
    """
    route = route_waypoints if route_waypoints is not None else plan_waypoints
    failed = collect_failures(verdict, len(route) if route is not None else 0)
    stops = range(0 if route is None else len(route)) if stops is None else stops
    stop_starts = stop_start_indices(stops)
    tracks = [drawn_track for drawn_track in tracks if len(drawn_track.track)]
    failing_threats = failed.threat_names()
    layers: list[Layer] = []
    labels: list[Label] = []
    if route is not None:
        has_different_plan = plan_waypoints is not None and paths_differ(plan_waypoints, route, 1.0)
        legs = [route[k : k + 2] for k in failed.legs]
        path_layers = [
            Layer("line", "leg that fails a rule", "failing-leg", leg[:, 0], leg[:, 1], quiet=True) for leg in legs
        ]
        if has_different_plan and plan_waypoints is not None:
            path_layers.append(
                Layer("line", "plan as searched", "searched", plan_waypoints[:, 0], plan_waypoints[:, 1], quiet=True)
            )
        name = "route of the mission" if plan_waypoints is None or has_different_plan else "planned path"
        layers += [*path_layers, Layer("line", name, "planned", route[:, 0], route[:, 1], quiet=True)]
    for drawn_track in tracks:
        # A track is thinned to what a map can show.
        count = len(drawn_track.track)
        rows = np.union1d(np.arange(0, count, max(1, count // _MAX_POINTS)), [count - 1])
        east, north, _ = drawn_track.track.position[rows].T
        layers.append(Layer("line", drawn_track.label, drawn_track.role, east, north, flight=drawn_track.flight))
    for drawn_track in tracks if failed.threats else ():
        is_inside = find_rows_inside_threats(failed, scenario.threats, drawn_track.track)
        if is_inside.any():
            east, north = np.where(is_inside, drawn_track.track.position[:, :2].T, np.nan)
            layers += [Layer("line", "flown inside a threat's reach", "inside", east, north, quiet=True)]
    if route is not None:
        dot_role = "waypoint" if len(stop_starts) <= _MAX_DOTS else "waypoint-small"
        texts = tuple(waypoint_texts[k] for k in stop_starts) if waypoint_texts else ()
        east, north, _ = route[stop_starts].T
        name = NUMBERED_WAYPOINT if items is None else NUMBERED_ITEM
        layers.append(Layer("dots", name, dot_role, east, north, hover_texts=texts))
        if failed.waypoints:
            east, north, _ = route[list(failed.waypoints)].T
            layers.append(Layer("rings", "waypoint that fails a rule", "fail", east, north, quiet=True))
        centres = {k: (float(east), float(north)) for k, (east, north, _) in enumerate(scenario.threats.position)}
        labels += make_fail_labels(failed, route[:, :2], centres)
    labels += end_labels(scenario, route, stops if items is None else items)
    if route is not None:
        # At most `_MAX_NUMBERS` waypoints are numbered, and all that fail a rule, except start and destination.
        step = max(1, -(-len(stop_starts) // _MAX_NUMBERS))
        numbered = {k for n, k in enumerate(stop_starts) if n % step == 0} | set(failed.waypoints)
        shown_numbers = stops if items is None else items
        labels += [
            Label(str(shown_numbers[k]), float(route[k, 0]), float(route[k, 1]), "number", "waypoint")
            for k in sorted(numbered - {0, len(route) - 1})
            if shown_numbers[k] != NO_ITEM
        ]
    extent = map_extent(scenario, route, [drawn_track.track.position for drawn_track in tracks])
    return scenario_map(
        scenario, subject, layers, labels, extent, route=route, failing_threats=frozenset(failing_threats), winds=winds
    )


def scenario_map(
    scenario: Scenario,
    subject: str,
    layers: Sequence[Layer],
    labels: Sequence[Label],
    extent: Extent,
    *,
    route: Floats | None,
    failing_threats: frozenset[int] = frozenset(),
    winds: Sequence[NamedWind] = (),
) -> MapChart:
    """Make a map of a scenario with additional layers, such as paths.

    subject: part of the title after the name of the scenario.
    layers: additional layers, drawn above area, threats and zones, and below start and destination.
    labels: labels that take precedence over the names of threats and zones.
    extent: range of the map, as returned by `map_extent`.
    route: waypoints, m, (w, 3).  Its ends are marked as start and destination, and its altitudes determine the filled
        sections of missiles.  None to mark the start and destination of the scenario.
    failing_threats: indices of the threats for which a rule failed.
    winds: winds shown at the compass.
    """
    east, north = extent
    edge_layers = []
    if not scenario.external:
        (west_edge, east_edge), (south_edge, north_edge) = scenario.bounds.tolist()
        x = np.array([west_edge, east_edge, east_edge, west_edge, west_edge])
        y = np.array([south_edge, south_edge, north_edge, north_edge, south_edge])
        edge_layers = [Layer("line", "edge of the area", "area", x, y, quiet=True)]
    area_layers = [
        *edge_layers,
        *threat_circles(scenario.threats, route, failing_threats),
        *zone_shapes(scenario.zones),
    ]
    names = [*threat_labels(scenario.threats, failing_threats), *zone_labels(scenario.zones)]
    names = [name for name in names if east[0] < name.x < east[1] and north[0] < name.y < north[1]]
    origin = scenario.origin
    end_markers = [
        Layer("dots", name, name, point[:1], point[1:2], hover_texts=(name,))
        for name, point in _name_ends(scenario, route)
    ]
    return MapChart(
        f"{shorten(scenario.name, 60)}: {subject}",
        Panel(
            "north",
            "km",
            (*area_layers, *layers, *end_markers),
            span=north,
            labels=(*labels, *names),
        ),
        east,
        north,
        position_text(origin.lat_deg, origin.lon_deg),
        scenario.terrain,
        tuple(winds),
    )


def map_json(chart: MapChart) -> Json:
    """Convert a map to JSON data for the page, lengths in m.

    The ground is not included: the page takes it from the data of the 3-D view.
    """
    return {
        "origin": chart.origin,
        "east": json_numbers(chart.east, 1),
        "north": json_numbers(chart.north, 1),
        **{name: value for name, value in panel_json(chart.panel).items() if name in ("layers", "labels")},
    }


def map_extent(scenario: Scenario, route: Floats | None, paths: Sequence[Floats]) -> Extent:
    """Return the range of a map that shows the scenario's area and all paths with a margin, m.

    A mission without a scenario has no area.  Its range contains the paths, and zones as far as they lie within the
    bounds that planfly chose around the mission.

    route: waypoints, m, (w, 3); None without a route.
    paths: other paths, m, (t, 3) each; rows with NaN are ignored.
    """
    points = [scenario.start[None, :2], scenario.destination[None, :2]]
    if scenario.external:
        points += [np.clip(zone_rings(zone)[0], *scenario.bounds.T) for zone in scenario.zones]
    else:
        points.append(scenario.bounds.T)
    if route is not None:
        points.append(route[:, :2])
    points += [path[np.isfinite(path).all(axis=1), :2] for path in paths]
    all_points = np.vstack(points)
    min_corner, max_corner = all_points.min(axis=0), all_points.max(axis=0)
    padding = (_MISSION_RIM if scenario.external else _RIM) * float((max_corner - min_corner).max())
    min_corner, max_corner = min_corner - padding, max_corner + padding
    width, height = (max_corner - min_corner).tolist()
    size = np.array([max(width, height / _ASPECTS[1]), max(height, width * _ASPECTS[0])])
    middle = 0.5 * (min_corner + max_corner)
    (west, south), (east, north) = (middle - 0.5 * size).tolist(), (middle + 0.5 * size).tolist()
    return (west, east), (south, north)


def _name_ends(scenario: Scenario, route: Floats | None) -> tuple[tuple[str, Floats], tuple[str, Floats]]:
    """Return the names and positions of start and destination: of the route, or else of the scenario."""
    first, last = (scenario.start, scenario.destination) if route is None else (route[0], route[-1])
    return ("start", first), ("destination", last)


def end_labels(scenario: Scenario, route: Floats | None, numbers_of_waypoints: Sequence[int]) -> list[Label]:
    """Return the labels of start and destination, with the numbers of their waypoints.

    They share one label if they are less than 50 m apart.

    route: waypoints, m, (w, 3); None to label the start and destination of the scenario, without numbers.
    numbers_of_waypoints: number to show for each waypoint of the route; `NO_ITEM` for none.
    """
    ends = _name_ends(scenario, route)
    numbers_of_ends = (NO_ITEM, NO_ITEM) if route is None else (numbers_of_waypoints[0], numbers_of_waypoints[-1])
    start, destination = (
        Label(name if number == NO_ITEM else f"{number} {name}", float(point[0]), float(point[1]), "end")
        for (name, point), number in zip(ends, numbers_of_ends, strict=True)
    )
    # One marker is enough for both ends if they lie within 50 m horizontally.
    are_close = float(np.hypot(*(ends[0][1][:2] - ends[1][1][:2]))) < 50.0
    if not are_close:
        return [start, destination]
    return [replace(start, text=f"{start.text}, {destination.text}")]


def position_text(lat_deg: float, lon_deg: float) -> str:
    """Format a position for the label of an axis; "" if its latitude is NaN.

    >>> position_text(46.0, -8.5)
    '46.0000°, −8.5000°'
    """
    return f"{lat_deg:.4f}°, {lon_deg:.4f}°".replace("-", "\N{MINUS SIGN}") if math.isfinite(lat_deg) else ""
