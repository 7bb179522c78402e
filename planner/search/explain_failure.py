"""Explain why a search found no feasible path.

Reasons are obstacles that block all routes, and limits of the method.

`explain_failure` collects lines for the user. It looks for lines across the map on which the ground plus clearance
reaches the ceiling, or missiles cover the remaining heights; for zones that separate the start from the destination on
a coarse grid (connected components); for vertical bands that the required margins close; and for missiles that leave no
path, as `planner.search.infeasibility_proof` proves.
"""

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from aircraft.path_limits import Limits
from planner.evaluation.certify import certify
from planner.evaluation.encoding import rotated_frame
from planner.evaluation.problem import Problem, make_problem
from planner.plan import Plan, Violation
from planner.search.algorithms import ALGORITHMS, limits_for
from planner.search.infeasibility_proof import blocking_missiles, highest_level_flight, highest_waypoint
from world.airspace.zone_kernels import ZoneRecords, edge_distance, height_outside_band, zone_records
from world.arrays import Flags, Floats, Ints
from world.kernels import compiled
from world.scenario import Scenario

# --- Zones that separate start and destination ---


# Number of cells along the map's longer side.
CELL_COUNT = 150
# Number of levels of cells, from the lowest to the highest allowed altitude.
LEVEL_COUNT = 5
# State of an open cell; the state of a cell closed by a zone is the index of the zone.
_OPEN_CELL = -1
# State of a cell closed by the ground.
_GROUND_CELL = -2


class SeparatingZones(NamedTuple):
    """Zones that separate start and destination.

    zones: names of the zones that are adjacent both to the cells that can be reached from the start and to the cells
        that can be reached from the destination; if there are none, of the zones that are adjacent to either.
    cell_side: side of the cells of the examined grid, m.
    """

    zones: tuple[str, ...]
    cell_side: float


def find_separating_zones(scenario: Scenario) -> SeparatingZones | None:
    """Find the zones that separate start and destination, on a grid of cells at several altitudes.

    Zones close cells, and start and destination are separated if no chain of open cells connects them. A gap narrower
    than a cell is treated as closed. Missiles and the aircraft's climb are ignored.

    Returns None if they are connected, if the ground alone separates them, or without terrain or zones.

    >>> from world.scenario import load_scenario
    >>> find_separating_zones(load_scenario("tight")) is None
    True
    """
    terrain = scenario.terrain
    if terrain is None or not scenario.zones:
        return None
    cell_side = float(np.ptp(scenario.bounds, axis=1).max()) / CELL_COUNT
    east, north = (np.arange(lower + 0.5 * cell_side, upper, cell_side) for lower, upper in scenario.bounds)
    ground_altitudes = terrain.height(east[None, :], north[:, None])
    min_altitudes = np.maximum(ground_altitudes + scenario.limits.min_clearance_m, scenario.floor)
    max_altitudes = np.full(ground_altitudes.shape, scenario.ceiling)
    if scenario.limits.max_height_m is not None:
        max_altitudes = np.minimum(max_altitudes, ground_altitudes + scenario.limits.max_height_m)
    cells = np.full((LEVEL_COUNT, *ground_altitudes.shape), _OPEN_CELL, dtype=np.int64)
    cells[:, ~(min_altitudes <= max_altitudes)] = _GROUND_CELL
    # Level, row and column of the cells of both ends; the levels divide each column evenly between its altitudes.
    ends = []
    for position in (scenario.start, scenario.destination):
        cell = ((position[:2] - scenario.bounds[:, 0]) / cell_side).astype(np.int64)
        row, column = (
            int(np.clip(index, 0, size - 1)) for index, size in zip(cell[::-1], ground_altitudes.shape, strict=True)
        )
        min_altitude, max_altitude = min_altitudes[row, column], max_altitudes[row, column]
        fraction = (position[2] - min_altitude) / max(float(max_altitude - min_altitude), 1e-6)
        level = int(np.clip(round(fraction * (LEVEL_COUNT - 1)), 0, LEVEL_COUNT - 1))
        ends.append((level, row, column))
    if not _are_connected(cells, ends):
        return None
    _close_cells(zone_records(scenario.zones), east, north, ground_altitudes, min_altitudes, max_altitudes, cells)
    for end in ends:
        cells[end] = _OPEN_CELL
    if _are_connected(cells, ends):
        return None
    adjacent_cells = [_grow_cells(_reachable_cells(cells == _OPEN_CELL, end)) for end in ends]
    adjacent_zones = [set(cells[edge_cells].tolist()) for edge_cells in adjacent_cells]
    zone_indices = (adjacent_zones[0] & adjacent_zones[1]) or (adjacent_zones[0] | adjacent_zones[1])
    return SeparatingZones(tuple(scenario.zones[z].name for z in sorted(zone_indices) if z >= 0), cell_side)


def _are_connected(cells: Ints, ends: list[tuple[int, int, int]]) -> bool:
    """Return True if the two ends are connected by open cells."""
    return bool(_reachable_cells(cells == _OPEN_CELL, ends[0])[ends[1]])


def _reachable_cells(is_open: Flags, start: tuple[int, int, int]) -> Flags:
    """Return a mask (as `is_open`) of the open cells that are connected to the start cell.

    Cells are connected if they share a side. No cell is reachable if the start cell is not open.
    """
    is_reachable = np.zeros_like(is_open)
    is_reachable[start] = is_open[start]
    count = -1
    while count != (count := int(is_reachable.sum())):
        is_reachable = _grow_cells(is_reachable) & is_open
    return is_reachable


def _grow_cells(cells: Flags) -> Flags:
    """Return a mask of the given cells and of all cells that share a side with one of them."""
    grown = cells.copy()
    for axis in range(cells.ndim):
        target, source = np.moveaxis(grown, axis, 0), np.moveaxis(cells, axis, 0)
        target[1:] |= source[:-1]
        target[:-1] |= source[1:]
    return grown


@compiled
def _close_cells(
    records: ZoneRecords,
    east: Floats,
    north: Floats,
    ground_altitudes: Floats,
    min_altitudes: Floats,
    max_altitudes: Floats,
    cells: Ints,
) -> None:
    """Set each open cell that a zone blocks to the index of the first such zone.

    east, north: (columns,) and (rows,) centres of the cells, m.
    ground_altitudes, min_altitudes, max_altitudes: (rows, columns) ground, and lowest and highest allowed altitude, m.
    cells: (levels, rows, columns) states of the cells, changed in place.
    """
    for z in range(records.zones.shape[0]):
        zone = records.zones[z]
        for i in range(north.size):
            for j in range(east.size):
                is_near = zone.south <= north[i] <= zone.north and zone.west <= east[j] <= zone.east
                is_inside = is_near and edge_distance(records, z, east[j], north[i]) <= 0.0
                if zone.exclusion and not is_inside:
                    continue
                for k in range(cells.shape[0]):
                    altitude = min_altitudes[i, j] + (max_altitudes[i, j] - min_altitudes[i, j]) * k / (
                        cells.shape[0] - 1
                    )
                    is_within = is_inside and not height_outside_band(zone, altitude, ground_altitudes[i, j]) > 0.0
                    if cells[k, i, j] == _OPEN_CELL and is_within == zone.exclusion:
                        cells[k, i, j] = z


# --- Bands of heights closed by the required margins ---


def describe_closed_bands(problem: Problem) -> list[str]:
    """Describe each altitude band that is closed by the margins that a plan requires, one line per band.

    The bands are those between the clearance and the maximum height above ground, and between the limits of each
    inclusion.

    >>> from planfly.workflow.uav import load_uav
    >>> from planner.evaluation.problem import make_problem
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("tight")
    >>> describe_closed_bands(make_problem(scenario, load_uav(scenario).limits))
    []
    """
    data, lines = problem.certified, []
    space, min_height = data.airspace, data.clearance + data.buffer
    if min_height > space.max_height - space.buffer:
        lines.append(
            f"the band from limits.min_clearance_m {data.clearance:g} m to limits.max_height_m {space.max_height:g} m"
            f" is {min_height + space.buffer - space.max_height:.1f} m too narrow: a plan needs margins of"
            f" {data.buffer:.1f} m at its lower edge and {space.buffer:.1f} m at its upper edge"
        )
    for required in space.zones.required:
        zone = problem.scenario.zones[int(required["number"])]
        ceiling, floor, margin = zone.ceiling, zone.floor, float(required["vertical"])
        if zone.kind != "inclusion" or ceiling is None:
            continue
        bottoms = {f"the clearance of {data.clearance:g} m": min_height} if ceiling.datum == "ground" else {}
        if floor is not None and floor.datum == ceiling.datum:
            bottoms[f"its floor at {floor.height:g} m"] = floor.height + margin
        name, bottom_height = max(bottoms.items(), key=lambda entry: entry[1], default=("", -math.inf))
        if bottom_height > ceiling.height - margin:
            lines.append(
                f"{zone.name} is {bottom_height + margin - ceiling.height:.1f} m too low: a plan needs margins above"
                f" {name} and below the zone's ceiling at {ceiling.height:g} m"
            )
    return lines


def max_altitude(problem: Problem) -> tuple[float, str]:
    """Return the maximum altitude of a plan, m AMSL, and the name of the limit that determines it.

    >>> from planfly.workflow.uav import load_uav
    >>> from planner.evaluation.problem import make_problem
    >>> from world.scenario import load_scenario
    >>> scenario = load_scenario("tight")
    >>> max_altitude(make_problem(scenario, load_uav(scenario).limits))[1]
    'the ceiling'
    """
    scenario: Scenario = problem.scenario
    limits = [(float(problem.certified.ceiling), "the ceiling")]
    for required in problem.certified.airspace.zones.required:
        zone = scenario.zones[int(required["number"])]
        if zone.kind == "inclusion" and zone.ceiling is not None and zone.ceiling.datum == "amsl":
            limits.append((zone.ceiling.height - float(required["vertical"]), f"the ceiling of {zone.name}"))
    return min(limits)


# --- Lines for the user ---

# Number of points along the direct line.
POINTS_ALONG = 200
# Number of points across the direct line.
POINTS_ACROSS = 400
# Maximum number of zones that are named.
MAX_NAMES = 4
# Maximum number of missiles that are named.
MAX_NAMED_MISSILES = 12
# Spacing of points on a path that is tested against zones, m.
ZONE_SAMPLE_SPACING_M = 20.0


def explain_failure(plan: Plan, limits: Limits | None = None) -> list[str]:
    """Explain in lines of text why a plan is infeasible, and which routes its search could not find.

    limits: limits of the path. If given, the margins that a plan requires are also checked, and the result is empty if
        the path keeps all of them.

    >>> from planner.plan import Certificate
    >>> from world.scenario import load_scenario
    >>> from world.scenario import with_threats
    >>> threat = {"east_m": 5000.0, "north_m": 5000.0, "kill_radius_m": 8000.0}
    >>> guarded = with_threats(load_scenario("hard-07"), [threat], "threats")
    >>> path = np.stack([guarded.start, guarded.destination])
    >>> certificate = Certificate(0.1, np.inf, 0.1, 9.0, -50.0, -50.0, ())
    >>> found = np.array([0, 0, 1, 1]), np.zeros(4)
    >>> plan = Plan(guarded, path, *found, certificate, 1, "umda", 60, np.zeros((0, 3)))
    >>> print(explain_failure(plan)[0])
    terrain and missiles together block every route 65 m from the start, at every height
    """
    scenario = plan.scenario
    algorithm = ALGORITHMS.get(plan.algorithm)
    lines = _describe_walls(scenario)
    if limits is not None:
        problem = make_problem(scenario, limits if algorithm is None else limits_for(algorithm, limits))
        certificate = certify(problem, plan.waypoints)
        if certificate.ok and certificate.kill_distance > 0.0 and not any(plan.violations):
            # The path itself is safe: the problem concerns the autopilot, and the plan's certificate states it.
            return []
        lines += describe_closed_bands(problem) or ([] if lines else _describe_margin_walls(problem))
        lines += _describe_proven_closure(problem)
    barrier = find_separating_zones(scenario)
    if barrier is not None:
        names = ", ".join(barrier.zones[:MAX_NAMES]) + (" and more" if len(barrier.zones) > MAX_NAMES else "")
        lines.append(
            f"zones block every route: {names} (gaps narrower than {barrier.cell_side:.0f} m are treated as closed)"
        )
    has_no_explanation, violated_names = not lines, violated_zones(scenario, plan.waypoints)
    if violated_names:
        lines.append(f"the best path violates: {', '.join(violated_names[:MAX_NAMES])}")
    elif not lines:
        failed_constraints = [violation.name.lower() for violation in Violation if plan.violations[violation]]
        if failed_constraints:
            lines.append(f"no obstacle blocks every route; the best path violates: {', '.join(failed_constraints)}")
    if algorithm is not None and algorithm.encoding == "rotated" and algorithm.seeded:
        lines.append("the search also tried routes that turn back or circle to climb, on a coarse lattice")
        if has_no_explanation and algorithm.optimiser == "waypoints" and scenario.planner.budget is None:
            lines.append(
                f"it is not proven that no path exists: [planner] waypoints = {2 * len(plan.waypoints)} allows more"
                " turns, and --budget 1000000 searches for longer"
            )
    elif algorithm is not None and algorithm.encoding == "rotated":
        lines.append(
            "this algorithm searches only paths that always advance along the straight line to the destination; "
            "it searched no route that turns back"
        )
    return lines


def _describe_walls(scenario: Scenario) -> list[str]:
    """Return a line if the ground, or ground and missiles together, block the map's whole width; else [].

    The tested lines cross the map at right angles to the direct line from start to destination.
    """
    terrain = scenario.terrain
    if terrain is None:
        return []
    has_missile = scenario.threats.kill_radius > 0.0
    positions, kill_radii = scenario.threats.position[has_missile], scenario.threats.kill_radius[has_missile]
    lines: list[str] = []
    for distance, points in _map_crossings(scenario):
        min_altitudes = terrain.height(points[:, 0], points[:, 1]) + scenario.limits.min_clearance_m
        min_altitudes = np.maximum(min_altitudes, scenario.floor)
        gaps = scenario.ceiling - min_altitudes
        if not (gaps > 0.0).any():
            lines.append(
                f"{distance:.0f} m from the start, terrain blocks the whole width of the map: over its lowest point"
                f" the clearance requires {np.nanmin(min_altitudes):.0f} m AMSL, but the ceiling is at"
                f" {scenario.ceiling:.0f} m AMSL"
            )
            break
        # Nine altitudes are tested at each point, from the lowest allowed one to the ceiling. Without a ceiling there
        # is always a gap.
        open_points, lowest_altitudes = points[gaps > 0.0], min_altitudes[gaps > 0.0]
        has_gap = math.isinf(scenario.ceiling)
        for fraction in np.linspace(0.0, 1.0, 9):
            altitudes = lowest_altitudes + fraction * (scenario.ceiling - lowest_altitudes)
            squares = (np.column_stack([open_points, altitudes])[:, None] - positions) ** 2
            distances2 = squares[..., 0] + squares[..., 1] + squares[..., 2]
            if (distances2 > kill_radii * kill_radii).all(axis=1).any():
                has_gap = True
                break
        if not has_gap:
            line = f"terrain and missiles together block every route {distance:.0f} m from the start, at every height"
            lines.append(line)
            break
    return lines


def _map_crossings(scenario: Scenario) -> Iterator[tuple[float, np.ndarray]]:
    """Yield lines across the map, at right angles to the direct line from start to destination.

    Each is the distance of the line from the start, m, and its points on the map, (n, 2) m.
    """
    frame = rotated_frame(scenario.start, scenario.destination)
    half_width = float(np.hypot(*np.diff(scenario.bounds, axis=1)[:, 0]))
    across = np.linspace(-half_width, half_width, POINTS_ACROSS)
    for along in np.linspace(0.0, frame.length, POINTS_ALONG)[1:-1]:
        frame_points = np.column_stack([np.full(POINTS_ACROSS, along), across, np.zeros(POINTS_ACROSS)])
        points = frame.to_world(frame_points)[:, :2]
        is_on_map = ((points >= scenario.bounds[:, 0]) & (points <= scenario.bounds[:, 1])).all(axis=1)
        if is_on_map.any():
            yield float(along), points[is_on_map]


def _describe_margin_walls(problem: Problem) -> list[str]:
    """Return a line if ground, clearance and margins leave no altitude across the whole map; else [].

    The lines across the map are those of `_describe_walls`, except near the ends, where the margins are reduced.
    """
    scenario, data = problem.scenario, problem.certified
    if scenario.terrain is None:
        return []
    (ceiling, name), margin = max_altitude(problem), float(data.buffer)
    length = math.dist(scenario.start[:2], scenario.destination[:2])
    for distance, points in _map_crossings(scenario):
        # Near the ends the margins are reduced.
        if min(distance, length - distance) < margin / max(1e-9, data.buffer_growth):
            continue
        min_altitude = float(np.nanmin(scenario.terrain.height(points[:, 0], points[:, 1]))) + data.clearance
        if min_altitude + margin > ceiling:
            return [
                f"{distance:.0f} m from the start, the ground is too high across the whole map: over its lowest point"
                f" the clearance and a margin of {margin:.1f} m require {min_altitude + margin:.0f} m AMSL, but"
                f" {name} allows {ceiling:.0f} m AMSL"
            ]
    return []


def _describe_proven_closure(problem: Problem) -> list[str]:
    """Return a line if missiles, ground or an altitude limit provably block every path; else []."""
    data, ceiling = problem.certified, "the ceiling"
    missiles, max_level_altitude = blocking_missiles(data), highest_level_flight(data)
    if missiles is None:
        return []
    if max_level_altitude < data.ceiling:
        ceiling = (
            f"{max(max_level_altitude, 0.0):.0f} m, above which the aircraft cannot fly level at"
            f" {data.aircraft.airspeed:g} m/s"
        )
        for name, end in (("start", data.start), ("destination", data.destination)):
            if end[2] > max_level_altitude:
                return [f"no path exists: the {name} is at {end[2]:.0f} m, higher than {ceiling}"]
    max_waypoint_altitude = highest_waypoint(data)
    if max_waypoint_altitude < min(data.ceiling, max_level_altitude):
        ceiling = (
            f"{max_waypoint_altitude:.0f} m, the highest altitude to which the aircraft can climb at"
            f" {data.aircraft.airspeed:g} m/s with the planner's slope margin of {math.degrees(data.angle_margin):g}°"
        )
        if data.destination[2] > max_waypoint_altitude:
            return [f"no path exists: the destination is at {data.destination[2]:.0f} m, higher than {ceiling}"]
    if not missiles:
        return [f"no path exists: the ground blocks every path below {ceiling}"]
    names = [problem.scenario.threats.names[k] for k in missiles[:MAX_NAMED_MISSILES]]
    others = f" and {len(missiles) - MAX_NAMED_MISSILES} more" if len(missiles) > MAX_NAMED_MISSILES else ""
    verb = "block" if len(missiles) > 1 else "blocks"
    return [
        f"no path exists: {', '.join(names)}{others} {verb} every path between the ground, {ceiling} and the edges of"
        " the map; without any one of these missiles a path may exist"
    ]


def violated_zones(scenario: Scenario, path: np.ndarray) -> list[str]:
    """Return the names of the zones that a path (w, 3) violates.

    They are the exclusions that the path enters, and the inclusions that it leaves, at points at most
    `ZONE_SAMPLE_SPACING_M` apart.

    >>> from world.scenario import load_scenario
    >>> violated_zones(load_scenario("tight"), np.zeros((2, 3)))
    []
    """
    if not scenario.zones:
        return []
    records = zone_records(scenario.zones)
    counts = [max(2, math.ceil(math.dist(a, b) / ZONE_SAMPLE_SPACING_M)) for a, b in itertools.pairwise(path)]
    legs = zip(path[:-1], path[1:], counts, strict=True)
    points = np.concatenate([np.linspace(a, b, count) for a, b, count in legs])
    ground = np.full(len(points), math.nan)
    if scenario.terrain is not None:
        ground = scenario.terrain.height(points[:, 0], points[:, 1])
    names = []
    for z, zone in enumerate(scenario.zones):
        is_inside = (
            edge_distance(records, z, east, north) <= 0.0
            and not height_outside_band(records.zones[z], up, ground_height) > 0.0
            for (east, north, up), ground_height in zip(points, ground, strict=True)
        )
        if any(is_inside) if zone.kind == "exclusion" else not all(is_inside):
            names.append(zone.name)
    return names
