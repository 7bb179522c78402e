"""Chart the profile of a flight: terrain, plan, track and threats in the plane along the path."""

from collections.abc import Sequence

import numpy as np

from flight.mission.itinerary import NO_ITEM
from flight.simulation.track import Track
from logs.verdict.verdict import Verdict
from logs.views.charts import NUMBERED_ITEM, NUMBERED_WAYPOINT, Chart, Label, Layer, Panel, find_outline_rows, shorten
from logs.views.failures import (
    Failures,
    collect_failures,
    find_rows_inside_threats,
    make_fail_labels,
    route_distance,
    route_samples,
    stop_start_indices,
    track_distance,
)
from logs.views.threats_and_zones import PathPlane, entered_cuts, threat_cuts, zone_bands
from world.arrays import Floats
from world.scenario import Scenario

# Number of samples along the path.
_SAMPLES = 1200
# Number of blocks to which the flown track is thinned, see `find_outline_rows`.
_BLOCKS = 800
# Smallest range of altitudes shown, m.
_MIN_SPAN = 50.0
# With more waypoints than this, only every n-th waypoint is numbered.
_MAX_NUMBERS = 40
# With more waypoints than this, their dots are small.
_MAX_DOTS = 80


def profile_chart(
    scenario: Scenario,
    *,
    plan_waypoints: Floats | None,
    route_waypoints: Floats | None,
    track: Track | None,
    verdict: Verdict | None,
    stops: Sequence[int] | None = None,
    items: Sequence[int] | None = None,
    above_ground: Floats | None = None,
) -> Chart:
    """Chart altitudes (m AMSL) over the distance along the route (km).

    Ground, threats and zones are cut by the vertical plane along the route.  Without a route, this is the plan, or else
    the straight line from start to destination.  Flown altitudes are drawn at the flight's progress along the route.

    plan_waypoints, route_waypoints: waypoints of the plan and of the mission's route, m, (p, 3) and (w, 3), or None.
    track, verdict, items: as in `logs.views.map.flight_map`.
    stops: number of the stop of each waypoint, shown at the stop's first waypoint; None if each waypoint is a stop.
    above_ground: height above ground at the end of each leg, m, (w,), NaN for legs that do not follow the terrain; None
        if no leg follows it.

    >>> from logs.recording.example_log import example_log
    >>> setup = example_log().setup
    >>> chart = profile_chart(
    ...     setup.scenario, plan_waypoints=None, route_waypoints=setup.route.positions, track=None, verdict=None
    ... )
    >>> chart.unit, [layer.name for layer in chart.panels[0].layers][-2:]
    ('km', ['planned', 'waypoint, numbered'])
    """
    route = route_waypoints if route_waypoints is not None else plan_waypoints
    is_straight_line = route is None
    if route is None:
        route = np.vstack([scenario.start, scenario.destination])
    track = track if track is not None and len(track) else None
    waypoint_distances = route_distance(route)
    distance, points = route_samples(route, max(float(waypoint_distances[-1]) / _SAMPLES, 1.0))
    ground = terrain_altitudes(scenario, points)
    if above_ground is not None and ground is not None and len(above_ground) == len(route):
        points[:, 2] = _compute_planned_altitudes(
            waypoint_distances, route, above_ground, distance, points[:, 2], ground, scenario
        )
    altitude_span = _choose_altitude_limits(scenario, route, track, ground)
    plane = PathPlane(distance / 1000.0, points, ground, *altitude_span)
    failed = collect_failures(verdict, len(route))
    stops = range(len(route)) if stops is None else stops
    stop_starts = stop_start_indices(stops)
    zones, zone_labels = zone_bands(scenario.zones, plane)
    cuts, cut_names = threat_cuts(scenario.threats, plane, frozenset(failed.threat_names()))
    flown_layers, entered_positions = _make_flown_layers(scenario, route, track, failed, plane)
    layers = [*zones, *cuts, *make_ground_bands(scenario, plane)]
    kilometres = waypoint_distances / 1000.0
    layers += [
        Layer("line", "leg that fails a rule", "failing-leg", kilometres[k : k + 2], route[k : k + 2, 2], quiet=True)
        for k in failed.legs
    ]
    layers += [] if is_straight_line else [Layer("line", "planned", "planned", plane.kilometres, points[:, 2])]
    layers += flown_layers
    labels: list[Label] = []
    if not is_straight_line:
        role = "waypoint" if len(stop_starts) <= _MAX_DOTS else "waypoint-small"
        positions = kilometres[stop_starts], route[stop_starts, 2]
        name = NUMBERED_WAYPOINT if items is None else NUMBERED_ITEM
        layers.append(Layer("dots", name, role, *positions, quiet=True))
        labels = _make_waypoint_labels(waypoint_distances, route, stops, stops if items is None else items, failed)
    if failed.waypoints:
        rows = list(failed.waypoints)
        layers.append(
            Layer("rings", "waypoint that fails a rule", "fail", kilometres[rows], route[rows, 2], quiet=True)
        )
    corners = np.column_stack([kilometres, route[:, 2]])
    labels = [*make_fail_labels(failed, corners, entered_positions), *labels, *cut_names, *zone_labels]
    # A mission without a scenario has neither ceiling nor floor.
    altitudes = () if scenario.external else (("ceiling", scenario.ceiling), ("floor", scenario.floor))
    lines = [(f"{name}, {altitude:.0f} m AMSL", altitude) for name, altitude in altitudes]
    limits = tuple(line for line in lines if altitude_span[0] < line[1] < altitude_span[1])
    note = f"{lines[0][0]}, off the picture" if lines and lines[0] not in limits else ""
    panel = Panel("altitude", "m AMSL", tuple(layers), limits, span=altitude_span, note=note, labels=tuple(labels))
    return _make_chart(scenario, waypoint_distances, stop_starts, panel, is_straight=is_straight_line)


def _make_chart(
    scenario: Scenario, waypoint_distances: Floats, stop_starts: list[int], panel: Panel, *, is_straight: bool
) -> Chart:
    """Make the chart of the profile from its panel, with a mark at the start of each leg.

    waypoint_distances: distance of each waypoint along the route, m, (w,).
    stop_starts: index of the first waypoint of each stop, as returned by `stop_start_indices`.
    is_straight: True if there is no route, only the straight line from start to destination.
    """
    path = "the straight line from start to destination" if is_straight else "the planned path"
    title = f"{shorten(scenario.name, 60)}: heights along the path"
    # Each displayed leg begins at the end of the stop before it.
    leg_starts = [0, *(k - 1 for k in stop_starts[2:])] if len(waypoint_distances) > 1 else []
    return Chart(
        title if scenario.terrain is not None else f"{title} (no terrain was given)",
        f"distance along {path}",
        "km",
        (panel,),
        axis_range=(0.0, max(float(waypoint_distances[-1]), 1.0) / 1000.0),
        # The leg to a loiter includes the loiter.
        marks=tuple((float(waypoint_distances[end]) / 1000.0, f"leg {n}") for n, end in enumerate(leg_starts)),
        page_height=420,
        print_height=4.05,
        legend="below",
        scaled=True,
    )


def _compute_planned_altitudes(
    waypoint_distances: Floats,
    route: Floats,
    height_above_ground: Floats,
    distance: Floats,
    line_altitude: Floats,
    ground: Floats,
    scenario: Scenario,
) -> Floats:
    """Return the planned altitude at each sample of the route, m AMSL, (s,).

    On a leg that follows the terrain, the height above ground changes linearly from start to end.  Other legs, and
    samples over unknown ground, have the altitude of the straight line between the waypoints.

    waypoint_distances: distance of each waypoint along the route, m, (w,).
    route: waypoints, m, (w, 3).
    height_above_ground: height above ground at the end of each leg, m, (w,); NaN for legs that ignore the terrain.
    distance, line_altitude, ground: distance along the route, straight-line altitude and ground altitude of each
        sample, m, (s,).
    """
    ground_altitudes = terrain_altitudes(scenario, route)
    waypoint_heights = route[:, 2] - (0.0 if ground_altitudes is None else ground_altitudes)
    end = np.clip(np.searchsorted(waypoint_distances, distance, side="left"), 1, len(waypoint_distances) - 1)
    fraction = (distance - waypoint_distances[end - 1]) / np.maximum(
        waypoint_distances[end] - waypoint_distances[end - 1], 1e-9
    )
    altitudes = ground + waypoint_heights[end - 1] + fraction * (height_above_ground[end] - waypoint_heights[end - 1])
    return np.where(np.isfinite(altitudes), altitudes, line_altitude)


def terrain_altitudes(scenario: Scenario, points: Floats) -> Floats | None:
    """Return the terrain elevation under points (s, 3), m AMSL, (s,).

    Return None if it is unknown at all of them.
    """
    if scenario.terrain is None:
        return None
    heights = scenario.terrain.height(points[:, 0], points[:, 1])
    return heights if np.isfinite(heights).any() else None


def _choose_altitude_limits(
    scenario: Scenario, route: Floats, track: Track | None, ground: Floats | None
) -> tuple[float, float]:
    """Return the range of the altitude axis, (low, high) m AMSL, which contains ground, plan and flight.

    The maximum height above ground is included up to its value above the highest waypoint.  The ceiling is included if
    it is not far above the rest.

    route: waypoints, m, (w, 3).
    ground: ground altitude of each sample of the route, m AMSL, (s,); None without terrain.
    """
    heights = [route[:, 2]] + ([] if track is None else [track.position[:, 2]])
    if ground is not None:
        heights.append(ground)
        if scenario.limits.max_height_m is not None:
            max_limit = float(route[:, 2].max()) + scenario.limits.max_height_m
            heights.append(np.minimum(ground + scenario.limits.max_height_m, max_limit))
    altitudes = np.concatenate(heights)
    altitudes = altitudes[np.isfinite(altitudes)]
    min_altitude, max_altitude = float(altitudes.min()), float(altitudes.max())
    span = max(max_altitude - min_altitude, _MIN_SPAN)
    if max_altitude < scenario.ceiling <= max_altitude + 1.2 * span:
        max_altitude = scenario.ceiling
        span = max_altitude - min_altitude
    return min_altitude - 0.12 * span, max_altitude + 0.14 * span


def make_ground_bands(scenario: Scenario, plane: PathPlane) -> list[Layer]:
    """Return layers of terrain, required clearance above it, and maximum height above ground.

    A limit that the scenario does not set has no layer.  Return [] without terrain.
    """
    ground, along = plane.ground, plane.kilometres
    if ground is None:
        return []
    layers = []
    min_clearance, max_height = scenario.limits.min_clearance_m, scenario.limits.max_height_m
    if min_clearance > 0.0:
        layers.append(
            Layer(
                "band", f"required clearance, {min_clearance:g} m", "clearance", along, ground + min_clearance, ground
            )
        )
    layers.append(Layer("band", "terrain", "terrain", along, ground, np.full(len(ground), plane.min_altitude)))
    if max_height is not None:
        name = f"maximum height, {max_height:g} m above ground"
        layers.append(Layer("line", name, "limit", along, ground + max_height))
    return layers


def _make_flown_layers(
    scenario: Scenario, route: Floats, track: Track | None, failed: Failures, plane: PathPlane
) -> tuple[list[Layer], dict[int, tuple[float, float]]]:
    """Return layers of the flown altitudes and of threats that failed, and label positions.

    The label positions are keyed by the index of the threat.

    route: waypoints, m, (w, 3).
    track: flown track; None for a plan, of which only the threats that failed are drawn.
    plane: vertical plane along the planned path; threats that failed in a flight are cut along its track instead.
    """
    if track is None:
        return entered_cuts(scenario.threats, failed, plane)
    progress, heights = track_distance(route, track) / 1000.0, track.position[:, 2]
    rows = find_outline_rows(heights, _BLOCKS)
    line = Layer("line", "flown", "flown", progress[rows], heights[rows])
    if not failed.threats:
        return [line], {}
    ground = terrain_altitudes(scenario, track.position)
    layers, label_positions = entered_cuts(
        scenario.threats, failed, PathPlane(progress, track.position, ground, plane.min_altitude, plane.max_altitude)
    )
    altitudes_inside = np.where(find_rows_inside_threats(failed, scenario.threats, track), heights, np.nan)
    return [
        *layers,
        line,
        Layer("line", "flown inside a threat's reach", "inside", progress, altitudes_inside, quiet=True),
    ], label_positions


def _make_waypoint_labels(
    waypoint_distances: Floats, route: Floats, stops: Sequence[int], numbers: Sequence[int], failed: Failures
) -> list[Label]:
    """Return labels with the numbers of at most about `_MAX_NUMBERS` waypoints.

    All waypoints that fail a rule are labelled, too.

    waypoint_distances: distance of each waypoint along the route, m, (w,).
    stops: number of the stop to which each waypoint belongs, (w,).
    numbers: number to show for each waypoint, (w,); `NO_ITEM` for none.
    """
    stop_starts = stop_start_indices(stops)
    step = max(1, -(-len(stop_starts) // _MAX_NUMBERS))
    numbered_waypoints = {k for n, k in enumerate(stop_starts) if n % step == 0 or n == len(stop_starts) - 1} | set(
        failed.waypoints
    )
    return [
        Label(str(numbers[k]), float(waypoint_distances[k]) / 1000.0, float(route[k, 2]), "number", "waypoint")
        for k in sorted(numbered_waypoints)
        if numbers[k] != NO_ITEM
    ]
