"""Convert the world, the mission with its states, and the profile to page data.

The page draws these data, which are in m.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flight.mission.edits import movable_indices
from flight.mission.items import AMSL, LANDINGS, OVER_HOME, Command, Mission, MissionItem, command_name
from flight.mission.route import Route
from flight.simulation.setup import FlightSetup
from logs.verdict.document import finding_document
from logs.verdict.measures.route_requirements import judged_airspace
from logs.verdict.places import Suggestion, TriedSuggestions
from logs.verdict.presentation import PlaceState, finding_words
from logs.verdict.rules.registry import with_passing_suggestions
from logs.verdict.verdict import Verdict
from logs.verdict.wording import suggestion_text
from logs.views.failures import route_distance, route_samples
from logs.views.map import map_extent
from logs.views.profile import terrain_altitudes
from logs.views.threats_and_zones import PathPlane, threat_cuts, zone_cuts, zone_text
from planfly.studio.edit_context import EditContext
from planfly.studio.incremental_verdict import Window
from planfly.studio.states import PlaceStates, place_states
from planfly.workflow.apply_suggestion import can_apply
from planfly.workflow.mission_context import JudgedMission
from world.airspace.zones_on_map import zone_rings, zone_walls
from world.arrays import Floats
from world.scenario import Scenario

Json = dict[str, Any]

# Number of samples of the profile.
_PROFILE_SAMPLES = 500
# Maximum number of findings that are listed.
_MAX_LISTED_FINDINGS = 60
# Height of the wall of a zone without a ceiling above the highest waypoint, m.
_WALL_MARGIN_M = 50.0
# Maximum number of zones and threats whose cross-sections the profile shows.
_MAX_CUTS = 120
_OK_STATE = PlaceState("ok")
# Closeness of a failure without a margin, which is infinite, in page data.
_MIN_CLOSENESS = -1e6
# Ratio of the drawn ground to the area, along each side.
_GROUND_RATIO = 1.2
# Minimum ratio of the width of the drawn ground to the longer side of the area.
_MIN_WIDTH_RATIO = 1.5
# Minimum ratio of the height of the drawn ground to the longer side of the area.
_MIN_HEIGHT_RATIO = 0.9


def round_to_json(values: Any, digits: int = 1) -> Any:
    """Return an array as (nested) lists of numbers rounded to a number of decimals (`digits`).

    NaN and infinity become None.
    """
    array = np.round(np.asarray(values, dtype=np.float64), digits)
    if np.isfinite(array).all():
        return array.tolist()
    return np.where(np.isfinite(array), array.astype(object), np.array(None, dtype=object)).tolist()


# ----------------------------------------------------------------------
# Data of the world.


def world_json(context: EditContext, setup: FlightSetup) -> Json:
    """Return page data of a mission's surroundings: area, threats, zones, ends and limits."""
    scenario, mission = context.scenario, setup.mission
    extent = scenario.bounds if scenario.external else map_extent(scenario, context.item_positions(mission), [])
    # The terrain is shown on a larger extent, so that it also fills browser windows of other shapes.
    east_north = np.asarray(extent, dtype=np.float64)
    center, size = east_north.mean(axis=1), np.diff(east_north, axis=1)[:, 0]
    longer_side = float(size.max())
    min_size = np.array([_MIN_WIDTH_RATIO * longer_side, _MIN_HEIGHT_RATIO * longer_side])
    half_size = 0.5 * np.maximum(_GROUND_RATIO * size, min_size)
    threats = scenario.threats
    # First the zones of the scenario, then those of the mission's fence: findings number the zones in this order.
    zones = judged_airspace(setup).zones if mission.fences else scenario.zones
    # A wall in the 3-D view reaches from the floor or the ground to the ceiling, or above the route without a ceiling.
    altitudes = setup.route.positions[:, 2]
    lowest, highest = float(altitudes.min()), float(altitudes.max()) + _WALL_MARGIN_M
    return {
        "name": scenario.name,
        "origin": [scenario.origin.lat_deg, scenario.origin.lon_deg],
        "extent": round_to_json(extent),
        "shown": round_to_json(np.stack([center - half_size, center + half_size], axis=1)),
        "bounds": None if scenario.external else round_to_json(scenario.bounds),
        "floor": None if scenario.external else float(scenario.floor),
        "ceiling": None if scenario.external else float(scenario.ceiling),
        "clearance": float(scenario.limits.min_clearance_m),
        "ends": None if scenario.external else round_to_json(np.stack([scenario.start, scenario.destination])),
        "ground": scenario.terrain is not None,
        "threats": [
            {"name": name, "at": round_to_json(position), "kill": round(kill, 1), "detection": round(detection, 1)}
            for name, position, kill, detection in zip(
                threats.names,
                threats.position.tolist(),
                threats.kill_radius.tolist(),
                threats.detection_radius.tolist(),
                strict=True,
            )
        ],
        "zones": [
            {
                "name": zone_text(zone),
                "kind": zone.kind,
                "rings": [round_to_json(ring) for ring in zone_rings(zone)],
                "walls": [round_to_json(wall) for wall in zone_walls(zone, scenario.terrain, lowest, highest)],
            }
            for zone in zones
        ],
    }


# ----------------------------------------------------------------------
# Data of the mission.


def mission_json(context: EditContext, judged_mission: JudgedMission) -> Json:
    """Return page data of a mission and its geometric verdict.

    The data include items, route, path, states, findings and profile.
    """
    verdict, setup = judged_mission.verdict, judged_mission.setup
    states = place_states(judged_mission.requirements, verdict.findings)
    path = judged_mission.requirements.path
    return {
        "items": items_json(context, judged_mission.mission),
        "commands": commands_json(judged_mission.mission),
        **route_json(judged_mission.mission, setup.route, 0, setup.route.legs),
        "path": _leg_paths(path.points, path.legs, 0, setup.route.legs),
        "states": states_json(states, 0, setup.route.legs),
        "violated": {"threats": sorted(states.threats), "zones": sorted(states.zones)},
        "verdict": verdict_page_data(verdict),
        "findings": findings_json(verdict, ()),
        "profile": profile_json(context.scenario, setup),
        "total": {
            "km": round(float(route_distance(setup.route.positions)[-1]) / 1000.0, 2),
            "s": round(path.times[-1]),
        },
    }


def windows_json(mission: Mission, route: Route, windows: Sequence[Window]) -> Json:
    """Return page data of the windows: the legs and corners that were judged near a moved item.

    route: the whole route of the mission.
    """
    windows_data = []
    for window in windows:
        first, last = window.first, window.last
        path = window.requirements.path
        states = place_states(window.requirements, window.findings, shift=window.start)
        windows_data.append(
            {
                "first": first,
                "last": last,
                **route_json(mission, route, first, last),
                "path": _leg_paths(path.points, path.legs + window.start, first, last),
                "states": states_json(states, first, last),
            }
        )
    return {"total_legs": route.legs, "windows": windows_data}


def items_json(context: EditContext, mission: Mission) -> list[Json]:
    """Return page data of the items that can be moved, with their positions on the map and in the mission.

    A landing has a touchdown at a known altitude, while the route ends above it, at the altitude of the previous item.
    """
    points, flown_seqs = context.item_positions(mission), context.reached_items(mission)
    entries = []
    for k, (east, north, altitude) in zip(movable_indices(mission), points.tolist(), strict=True):
        item = mission.items[k]
        entries.append(
            {
                "k": k,
                "seq": item.seq,
                "what": command_name(item.command).removeprefix("NAV_").replace("_", " ").lower(),
                "at": round_to_json([east, north, altitude]),
                "alt": None if np.isnan(item.alt) else round(item.alt, 1),
                "frame": "AMSL" if item.frame in AMSL else "over home" if item.frame in OVER_HOME else "over ground",
                "lat": item.lat_deg,
                "lon": item.lon_deg,
                "state": "" if item.seq in flown_seqs else "not flown",
                "touchdown": item.command in LANDINGS and math.isfinite(altitude),
            }
        )
    return entries


def commands_json(mission: Mission) -> list[Json]:
    """Return page data of the items without a position, which cannot be edited.

    Examples are changes of speed and jumps.
    """
    places = set(movable_indices(mission))
    return [
        {"k": k, "seq": item.seq, "text": _command_text(item)}
        for k, item in enumerate(mission.items)
        if k not in places
    ]


def _command_text(item: MissionItem) -> str:
    """Return a text on an item without a position: command and parameters.

    >>> _command_text(MissionItem(3, 178, 3, (0.0, 21.0, -1.0, 0.0), 0.0, 0.0, 0.0))
    'change speed: airspeed 21 m/s'
    >>> _command_text(MissionItem(8, 177, 3, (4.0, -1.0, 0.0, 0.0), 0.0, 0.0, 0.0))
    'jump to item 4, indefinitely'
    >>> _command_text(MissionItem(9, 206, 3, (25.0, 0.0, 1.0, 0.0), 0.0, 0.0, 0.0))
    'set cam trigg dist (25, 0, 1, 0)'
    """
    first, second, third, _ = item.params
    if item.command == Command.DO_CHANGE_SPEED:
        kind = {0.0: "airspeed", 1.0: "ground speed"}.get(first, f"speed of type {first:g}")
        texts = [f"{kind} {second:g} m/s"] if second >= 0.0 else []
        texts += [f"throttle {third:g} %"] if third >= 0.0 else []
        return f"change speed: {', '.join(texts) or 'no change'}"
    if item.command == Command.DO_JUMP:
        count_text = "indefinitely" if second < 0.0 else f"{second:g} time{'s' * (second != 1.0)}"
        return f"jump to item {first:g}, {count_text}"
    name = command_name(item.command).removeprefix("NAV_").removeprefix("DO_").replace("_", " ").lower()
    # Parameters of 0 and NaN are the defaults of a command.
    return f"{name} ({', '.join(f'{value:g}' for value in item.params)})" if any(item.params) else name


def route_json(mission: Mission, route: Route, first: int, last: int) -> Json:
    """Return page data of the waypoints `first` to `last`.

    They are positions, m, and the indices of their items.

    The index of an item is its position in the mission's list; -1 for a waypoint without an item.
    """
    numbers = {item.seq: k for k, item in enumerate(mission.items)}
    items = [numbers.get(seq, -1) for seq in route.items[first : last + 1].tolist()]
    return {"route": round_to_json(route.positions[first : last + 1]), "of": items}


def _leg_paths(points: Floats, legs: NDArray[np.int64], first: int, last: int) -> list[list[float]]:
    """Return the path of each leg as a flat list, m: east, north, up of the first point, then the next.

    points: points of the path, (p, 3), m.
    legs: number of the leg on which each point lies, (p,).
    first, last: first and last waypoint; the legs between them are returned.
    """
    edges = np.searchsorted(legs, np.arange(first, last + 1))
    rounded_points = np.round(points, 1)
    return [rounded_points[start : end + 1].ravel().tolist() for start, end in pairwise(edges.tolist())]


def states_json(states: PlaceStates, first: int, last: int) -> Json:
    """Return page data of the legs and corners between two waypoints.

    Each has its state, text and closeness.

    first, last: numbers of the two waypoints in the route.
    """
    return {
        "legs": [_state_data(states.legs.get(k, _OK_STATE)) for k in range(first, last)],
        "corners": [_state_data(states.corners.get(k, _OK_STATE)) for k in range(first, last + 1)],
    }


def _state_data(state: PlaceState) -> list[str | float | None]:
    """Return a state as page data: its name, its text, and its closeness, or None if no limit is near.

    The page uses the closeness to find the worst of several laps past the same item.
    """
    closeness = None if state.closeness == math.inf else max(_MIN_CLOSENESS, round(state.closeness, 3))
    return [state.state, state.text, closeness]


# ----------------------------------------------------------------------
# Data of the verdict.


def verdict_page_data(verdict: Verdict) -> Json:
    """Return page data of a verdict: state, answer, headline, reasons, lines, level and count of failures."""
    return {
        "state": verdict.state,
        "answer": verdict.answer,
        "headline": verdict.headline,
        "reasons": verdict.reasons,
        "lines": list(verdict.details),
        "level": verdict.level,
        "failed": len(verdict.failed),
    }


def findings_json(verdict: Verdict, tried: Sequence[TriedSuggestions]) -> list[Json]:
    """Return page data of the findings to list, each as in ``verdict.json``.

    Number, title, state and offers are added.

    The offers of a finding are its suggestions.  Listed are the failed and undecided findings, then the finding closest
    to its limit for each rule.

    tried: suggestions that passed their trials; failed findings offer no others.
    """
    verdict = replace(verdict, findings=with_passing_suggestions(verdict.findings, tried))
    return [
        {
            **asdict(finding_document(finding)),
            "number": number,
            "title": finding_words(finding).title,
            "state": finding.state,
            "offers": [
                {"text": suggestion_text(suggestion), "apply": can_apply_in_studio(suggestion)}
                for suggestion in finding.suggestions
            ],
        }
        for number, finding in verdict.findings_to_list(_MAX_LISTED_FINDINGS)
    ]


def can_apply_in_studio(suggestion: Suggestion) -> bool:
    """Return True if the studio can make every change of a suggestion: to the items, or to a parameter."""
    item_changes = tuple(change for change in suggestion if change.what != "parameter")
    return bool(suggestion) and (not item_changes or can_apply(item_changes))


# ----------------------------------------------------------------------
# Data of the profile.


def profile_json(scenario: Scenario, setup: FlightSetup) -> Json:
    """Return page data of the profile along the route.

    It has terrain, waypoints, and cross-sections of threats and zones.
    """
    route = setup.route.positions
    waypoint_distance = route_distance(route)
    distance, points = route_samples(route, max(float(waypoint_distance[-1]) / _PROFILE_SAMPLES, 1.0))
    ground = terrain_altitudes(scenario, points)
    # The picture begins 50 m below path and ground, and ends 300 m above the path.
    bottom = float(min(points[:, 2].min(), np.nanmin(ground) if ground is not None else np.inf)) - 50.0
    top = float(points[:, 2].max()) + 300.0
    view = PathPlane(distance, points, ground, bottom, top)
    cuts: list[Json] = []
    if len(scenario.threats) <= _MAX_CUTS:
        cuts += [
            {
                "role": layer.role,
                "name": layer.name,
                "x": round_to_json(layer.x),
                "top": round_to_json(layer.y),
                "low": round_to_json(layer.lower_edge),
            }
            for layer in threat_cuts(scenario.threats, view, frozenset())[0]
        ]
    if len(scenario.zones) <= _MAX_CUTS:
        cuts += [
            {
                "role": "zone",
                "name": cut.zone.name,
                "x": round_to_json(distance),
                "top": round_to_json(np.where(cut.is_forbidden, cut.top, np.nan)),
                "low": round_to_json(cut.bottom),
            }
            for cut in zone_cuts(scenario.zones, view)
        ]
    return {
        "at": round_to_json(waypoint_distance),
        "x": round_to_json(distance),
        "ground": None if ground is None else round_to_json(ground),
        "cuts": cuts,
    }
