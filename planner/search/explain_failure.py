"""Why no path was found: what stands across the whole way, and what the search could not have tried."""

import itertools
import math
from collections.abc import Iterator

import numpy as np

from aircraft.path_limits import Limits
from planner.evaluation.clearance_buffer import BUFFER_GROWTH
from planner.evaluation.encoding import rotated_frame
from planner.evaluation.problem import Problem, make_problem
from planner.plan import Plan, Violation
from planner.search.algorithms import ALGORITHMS
from planner.search.closing_zones import closing_zones
from planner.search.limits_for import limits_for
from planner.search.narrow_bands import highest_allowed, narrow_bands
from world.airspace.zone_kernels import edge_distance, outside_band, zone_records
from world.scenario import Scenario

# Places looked at along and across the way.
ALONG, ACROSS = 200, 400
# Names of zones that are said, at most; and between places of a path that is looked at for them, m.
MOST_NAMES, ZONE_PITCH = 4, 20.0


def what_blocks(plan: Plan, limits: Limits | None = None) -> list[str]:
    """Lines that say what is in the way of a plan that is not feasible, and what a search in its encoding cannot do.

    limits: of the path; where they are given, what a plan keeps in reserve is looked at, too.

    >>> from planner.plan import Certificate
    >>> from world.scenario import load_scenario
    >>> from world.scenario_variants import with_threats
    >>> guarded = with_threats(load_scenario("hard-07"), [(5000.0, 5000.0, 8000.0, 0.0)], "--add-threat")
    >>> path = np.stack([guarded.start, guarded.destination])
    >>> certificate = Certificate(0.1, np.inf, 0.1, 9.0, -50.0, -50.0, ())
    >>> found = np.array([0, 0, 1, 1]), np.zeros(4)
    >>> plan = Plan(guarded, path, *found, certificate, 1, "umda", 60, np.zeros((0, 3)))
    >>> print(what_blocks(plan)[0])
    terrain and missiles together close the way 65 m from the start, at every height
    """
    scenario = plan.scenario
    chosen = ALGORITHMS.get(plan.algorithm)
    lines = _walls(scenario)
    if limits is not None:
        problem = make_problem(scenario, limits if chosen is None else limits_for(chosen, limits))
        lines += narrow_bands(problem) or ([] if lines else _reserve_walls(problem))
    closed = closing_zones(scenario)
    if closed is not None:
        names = ", ".join(closed.zones[:MOST_NAMES]) + (" and more" if len(closed.zones) > MOST_NAMES else "")
        lines.append(f"zones close the whole way (gaps narrower than {closed.pitch:.0f} m count as closed): {names}")
    violated_zones = zones_entered(scenario, plan.waypoints)
    if violated_zones:
        lines.append(f"the best path does not keep to: {', '.join(violated_zones[:MOST_NAMES])}")
    elif not lines:
        violated = [item.name.lower() for item in Violation if plan.violations[item]]
        if violated:
            lines.append(f"nothing stands across the whole way; the best path fails by: {', '.join(violated)}")
    if chosen is not None and chosen.encoding == "rotated" and chosen.seeded:
        lines.append("ways that turn back, or go round to climb, were looked for too, on a coarse lattice")
    elif chosen is not None and chosen.encoding == "rotated":
        lines.append(
            "paths of the rotated frame only ever get nearer to the destination along the line to it; "
            "a way that must turn back was not looked for"
        )
    return lines


def _walls(scenario: Scenario) -> list[str]:
    """Where, across the whole map, the ground leaves no height below the ceiling, or missiles cover every height."""
    terrain = scenario.terrain
    if terrain is None:
        return []
    lines: list[str] = []
    for along, places in _lines_across(scenario):
        lowest = terrain.height(places[:, 0], places[:, 1]) + scenario.limits.min_clearance_m
        lowest = np.maximum(lowest, scenario.floor)
        gaps = scenario.ceiling - lowest
        if not (gaps > 0.0).any():
            lines.append(
                f"terrain closes the way {along:.0f} m from the start, across the whole map: its lowest place and the "
                f"clearance take {np.nanmin(lowest):.0f} m, the ceiling is {scenario.ceiling:.0f} m"
            )
            break
        if not _unguarded(scenario, places[gaps > 0.0], lowest[gaps > 0.0]):
            lines.append(f"terrain and missiles together close the way {along:.0f} m from the start, at every height")
            break
    return lines


def _lines_across(scenario: Scenario) -> Iterator[tuple[float, np.ndarray]]:
    """Lines across the map between the ends: how far from the start, m, and places (n, 2) on it."""
    frame = rotated_frame(scenario.start, scenario.destination)
    widest = float(np.hypot(*np.diff(scenario.bounds, axis=1)[:, 0]))
    across = np.linspace(-widest, widest, ACROSS)
    for along in np.linspace(0.0, frame.length, ALONG)[1:-1]:
        places = frame.restore(np.column_stack([np.full(ACROSS, along), across, np.zeros(ACROSS)]))[:, :2]
        inside = ((places >= scenario.bounds[:, 0]) & (places <= scenario.bounds[:, 1])).all(axis=1)
        if inside.any():
            yield float(along), places[inside]


def _reserve_walls(problem: Problem) -> list[str]:
    """Where, across the whole map, ground, clearance and what a plan keeps in reserve leave no height."""
    scenario, data = problem.scenario, problem.certified
    if scenario.terrain is None:
        return []
    (top, name), reserve = highest_allowed(problem), float(data.buffer)
    length = math.dist(scenario.start[:2], scenario.destination[:2])
    for along, places in _lines_across(scenario):
        # Near the ends a plan keeps as much as they leave.
        if min(along, length - along) < reserve / BUFFER_GROWTH:
            continue
        lowest = float(np.nanmin(scenario.terrain.height(places[:, 0], places[:, 1]))) + data.clearance
        if lowest + reserve > top:
            return [
                f"the heights left are too narrow {along:.0f} m from the start, across the whole map: its lowest place,"
                f" the clearance and a reserve of {reserve:.1f} m take {lowest + reserve:.0f} m, {name} leaves"
                f" {top:.0f} m"
            ]
    return []


def _unguarded(scenario: Scenario, places: np.ndarray, lowest: np.ndarray) -> bool:
    """Whether some height at some of the places (n, 2) is outside every kill sphere."""
    threats = scenario.threats
    armed = threats.kill_radius > 0.0
    position, radius = threats.position[armed], threats.kill_radius[armed]
    for share in np.linspace(0.0, 1.0, 9):
        up = lowest + share * (scenario.ceiling - lowest)
        free = np.ones(len(places), dtype=np.bool_)
        for centre, kill_radius in zip(position, radius, strict=True):
            away = (places[:, 0] - centre[0]) ** 2 + (places[:, 1] - centre[1]) ** 2 + (up - centre[2]) ** 2
            free &= away > kill_radius * kill_radius
        if free.any():
            return True
    return math.isinf(scenario.ceiling)


def zones_entered(scenario: Scenario, path: np.ndarray) -> list[str]:
    """Names of the exclusions that places of a path (w, 3) are inside, and of the inclusions that they are outside.

    >>> from world.scenario import load_scenario
    >>> zones_entered(load_scenario("tight"), np.zeros((2, 3)))
    []
    """
    if not scenario.zones:
        return []
    records = zone_records(scenario.zones)
    counts = [max(2, math.ceil(math.dist(a, b) / ZONE_PITCH)) for a, b in itertools.pairwise(path)]
    legs = zip(path[:-1], path[1:], counts, strict=True)
    places = np.concatenate([np.linspace(a, b, count) for a, b, count in legs])
    ground = np.full(len(places), math.nan)
    if scenario.terrain is not None:
        ground = scenario.terrain.height(places[:, 0], places[:, 1])
    found = []
    for z, zone in enumerate(scenario.zones):
        inside = (
            edge_distance(records, z, east, north) <= 0.0 and not outside_band(records.zones[z], up, under) > 0.0
            for (east, north, up), under in zip(places, ground, strict=True)
        )
        if any(inside) if zone.kind == "exclusion" else not all(inside):
            found.append(zone.name)
    return found
