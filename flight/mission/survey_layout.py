"""Change the layout of a survey: longer turn-arounds, interleaved lines, or lines on another course.

Items outside the survey are unchanged, and each line keeps its items, including camera commands.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flight.mission.items import (
    Command,
    Mission,
    MissionItem,
    command_name,
    is_navigation,
    renumber_items,
    round_to_grid,
)
from flight.mission.route import Route
from flight.mission.surveys import Survey
from world.arrays import Floats
from world.frames import GeoOrigin, to_geo

# Minimum length of a survey line on another course, m.
_MIN_LINE_LENGTH_M = 50.0
# Maximum distance of a straight line's corners from the straight line between its ends, m.
_BEND_TOLERANCE_M = 5.0
# Tolerance for the length of leads, m.
_LEAD_LENGTH_TOLERANCE_M = 1.0


class SurveyLayout(NamedTuple):
    """Settings for flying a survey.

    turn_around: distance from each line's end to the start of its turn, and from the turn's end to the next line's
        start, m; 0 for none.
    every: interleave stride; 2 flies every second line first and then the others, from the same side; 3 every third.
    course: course of the lines, rad; None to keep it.
    backwards: True to start with the line on the other side.
    lead_in: straight distance before the first line, m, if it exceeds ``turn_around``, because the entry to the first
        line may come from any direction.
    """

    turn_around: float
    every: int = 1
    course: float | None = None
    backwards: bool = False
    lead_in: float = 0.0


class _Line(NamedTuple):
    """A survey line to fly.

    corners: corners of the line in flying order, (k, 2) m.
    items: mission items from its first waypoint to its last, with the commands after the last.
    flown: numbers of the items that the route leads to.
    """

    corners: Floats
    items: tuple[MissionItem, ...]
    flown: frozenset[int]

    @property
    def point_items(self) -> list[MissionItem]:
        """Items that are points of the line."""
        return [item for item in self.items if _is_line_point(item, self.flown)]


class _SurveyItems(NamedTuple):
    """Indices of a survey's items in the mission's list of items.

    lines: for each line, the index of its first item and the index after its last item. If the item at the line's start
        is no NAV_WAYPOINT, the first item is the next one.
    begin: index of the first item of the survey, with the lead-in to its first line.
    end: index of the first item after the survey and the lead-out of its last line.
    """

    lines: tuple[tuple[int, int], ...]
    begin: int
    end: int


def min_turn_around(route: Route, survey: Survey) -> float:
    """Return the length of the shortest straight run between photos and turn in a survey, m."""
    return min(_lead_lengths(route, survey))


def _lead_lengths(route: Route, survey: Survey) -> list[float]:
    """Return the length of the straight run between photos and turn, at both ends of each turn-around, m."""
    points, pairs = route.positions[:, :2], zip(survey.lines[:-1], survey.lines[1:], strict=True)
    ends = [pair for line, next_line in pairs for pair in ((line.last, line.ends), (next_line.begins, next_line.first))]
    return [math.dist(points[start], points[end]) for start, end in ends]


def fixed_layout_reason(mission: Mission, route: Route, survey: Survey) -> str:
    """Return the reason why the layout of a survey cannot be changed, or "" if it can be changed.

    route: the mission's route, in which the survey was found.
    """
    if any(item.command in (Command.DO_JUMP, Command.DO_JUMP_TAG, Command.JUMP_TAG) for item in mission.items):
        return "the mission contains jumps"
    index_by_seq = {item.seq: index for index, item in enumerate(mission.items)}
    if any(int(route.items[i]) not in index_by_seq for line in survey.lines for i in range(line.first, line.last + 1)):
        return "a line begins or ends at a waypoint without an item"
    items = _find_survey_items(mission, route, survey)
    for first, end in items.lines:
        for item in mission.items[first:end]:
            if is_navigation(item.command) and item.command != Command.NAV_WAYPOINT:
                return f"item {item.seq}, {command_name(item.command)}, lies on a line"
    for (_, end), (first, _) in zip(items.lines[:-1], items.lines[1:], strict=True):
        for item in mission.items[end:first]:
            if item.command != Command.NAV_WAYPOINT:
                return f"item {item.seq}, {command_name(item.command)}, lies between two lines"
    return ""


def with_layout(
    mission: Mission, route: Route, survey: Survey, layout: SurveyLayout, origin: GeoOrigin
) -> Mission | None:
    """Return the mission with a new layout of a survey, or None if that is impossible.

    route: the mission's route, on the map about ``origin``. A survey with a `fixed_layout_reason` cannot be changed. A
        change of course is possible only if all lines are straight and have the same altitude.
    """
    if fixed_layout_reason(mission, route, survey):
        return None
    items, lines, flown = _find_survey_items(mission, route, survey), list[_Line](), _flown_item_numbers(route)
    for photo_line, (first, end) in zip(survey.lines, items.lines, strict=True):
        corners, line_items = route.positions[photo_line.first : photo_line.last + 1, :2], mission.items[first:end]
        line = _Line(corners, line_items, flown)
        if _waypoint_of_item(mission, route)[line.point_items[0].seq] != photo_line.first:
            line = line._replace(items=(_make_waypoint(line.point_items[0], corners[0], origin), *line_items))
        lines.append(line)
    if layout.course is not None:
        turned_lines = _lines_on_course(lines, survey, layout.course, origin)
        if turned_lines is None:
            return None
        lines = turned_lines
    max_lead_length = max(_lead_lengths(route, survey)) + _LEAD_LENGTH_TOLERANCE_M
    (first, _), (_, end) = items.lines[0], items.lines[-1]
    new_items = [*mission.items[: items.begin]]
    new_items += _without_lead_waypoints(
        mission, route, mission.items[items.begin : first], survey.lines[0].first, max_lead_length
    )
    for number, line in enumerate(_order_lines(lines, layout)):
        new_items += _items_with_turn_arounds(line, layout.turn_around, layout.lead_in if number == 0 else 0.0, origin)
    new_items += _without_lead_waypoints(
        mission, route, mission.items[end : items.end], survey.lines[-1].last, max_lead_length
    )
    # Renumber all items: two items with one number would be ambiguous.
    numbered = [replace(item, seq=seq) for seq, item in enumerate([*new_items, *mission.items[items.end :]], 1)]
    return renumber_items(replace(mission, items=tuple(numbered)))


def _flown_item_numbers(route: Route) -> frozenset[int]:
    """Return the item numbers (seq) of a route's waypoints."""
    return frozenset(int(seq) for seq in route.items)


def _is_line_point(item: MissionItem, flown: Collection[int]) -> bool:
    """Return True if an item is a point of a survey line: a navigation item, or a gate on the route.

    flown: numbers of the items that the route leads to. A gate that is not flown, such as every gate with ArduPlane, is
        treated like a command.
    """
    return is_navigation(item.command) or (item.command == Command.CONDITION_GATE and item.seq in flown)


def _find_survey_items(mission: Mission, route: Route, survey: Survey) -> _SurveyItems:
    """Return the indices of a survey's items, line by line.

    The items of a line include the commands after its last waypoint, such as one that switches the camera.
    """
    index_by_seq = {item.seq: item_index for item_index, item in enumerate(mission.items)}
    item_count = len(mission.items)
    seqs, flown = [int(seq) for seq in route.items], _flown_item_numbers(route)

    def index(waypoint: int) -> int:
        """Return the list index of a waypoint's item; the length of the list for a waypoint without an item."""
        return index_by_seq.get(seqs[waypoint], item_count) if 0 <= waypoint < len(seqs) else item_count

    lines = []
    for line in survey.lines:
        # An item at the same position, such as a take-off, may have been merged with the line's first waypoint.
        first = max(
            item_index
            for item_index in range(index(line.first), index(line.first + 1))
            if _is_line_point(mission.items[item_index], flown)
        )
        if mission.items[first].command not in (Command.NAV_WAYPOINT, Command.CONDITION_GATE):
            first += 1
        end_index = index(line.last) + 1
        while end_index < item_count and not _is_line_point(mission.items[end_index], flown):
            end_index += 1
        lines.append((first, end_index))
    first_line, last_line = survey.lines[0], survey.lines[-1]
    begin_index = min(index(first_line.begins), lines[0][0])
    return _SurveyItems(tuple(lines), begin_index, max(lines[-1][1], index(last_line.ends + 1)))


def _waypoint_of_item(mission: Mission, route: Route) -> dict[int, int]:
    """Return the index of the waypoint of each navigation item and gate, by item number.

    For an item without a waypoint the result has the previous waypoint.
    """
    waypoint_by_seq, waypoint, waypoints = {int(seq): i for i, seq in enumerate(route.items)}, 0, dict[int, int]()
    for item in mission.items:
        if _is_line_point(item, waypoint_by_seq):
            waypoint = waypoint_by_seq.get(item.seq, waypoint)
            waypoints[item.seq] = waypoint
    return waypoints


def _without_lead_waypoints(
    mission: Mission, route: Route, items: Sequence[MissionItem], end: int, max_lead_length: float
) -> list[MissionItem]:
    """Return the items before or after a survey without its lead waypoints, which the new layout replaces.

    items: items between the transit and the first line of the survey, or between its last line and the transit.
    end: index of the waypoint at which the survey starts or ends.
    max_lead_length: distance from that waypoint within which a waypoint is a lead waypoint, m. More distant waypoints
        belong to the transit, and are kept.
    """
    points, waypoint_of = route.positions[:, :2], _waypoint_of_item(mission, route)

    def is_lead(item: MissionItem) -> bool:
        """Return True if an item is a waypoint near the end of the survey."""
        is_near = item.seq in waypoint_of and math.dist(points[waypoint_of[item.seq]], points[end]) <= max_lead_length
        return is_near and item.command == Command.NAV_WAYPOINT

    return [item for item in items if not is_lead(item)]


def _order_lines(lines: Sequence[_Line], layout: SurveyLayout) -> list[_Line]:
    """Return the lines in the flying order of a layout, in alternating directions.

    The first line keeps its direction. The lines are unchanged if the layout keeps their order.
    """
    if layout.every == 1 and layout.course is None and not layout.backwards:
        return list(lines)
    start, end = lines[0].corners[[0, -1]]
    direction = (end - start) / max(float(np.hypot(*(end - start))), 1e-9)
    right = np.array([direction[1], -direction[0]])
    offsets = [float((line.corners[[0, -1]].mean(axis=0) - start) @ right) for line in lines]
    lateral = sorted(range(len(lines)), key=lambda index: offsets[index])
    if (offsets[0] > 0.5 * (min(offsets) + max(offsets))) is not layout.backwards:
        lateral.reverse()
    ordered: list[_Line] = []
    for first in range(layout.every):
        for index in lateral[first :: layout.every]:
            line, is_forward = lines[index], len(ordered) % 2 == 0
            runs_forward = float((line.corners[-1] - line.corners[0]) @ direction) > 0.0
            if runs_forward != is_forward:
                # The waypoints are reversed, but the commands between them keep their positions in the list.
                points = reversed(line.point_items)
                items = tuple(next(points) if _is_line_point(item, line.flown) else item for item in line.items)
                line = _Line(line.corners[::-1], items, line.flown)
            ordered.append(line)
    return ordered


def _items_with_turn_arounds(line: _Line, turn_around: float, lead_in: float, origin: GeoOrigin) -> list[MissionItem]:
    """Return the items of a line, with added waypoints on its straight extensions before and after it.

    turn_around: length of both extensions, m; 0 for none.
    lead_in: length of the extension before the line, m, if it exceeds ``turn_around``.

    Without turn-arounds, gates at the line's points become waypoints.
    """
    point_items = line.point_items
    entry_direction, exit_direction = line.corners[0] - line.corners[1], line.corners[-1] - line.corners[-2]
    entry_direction, exit_direction = (
        direction / max(float(np.hypot(*direction)), 1e-9) for direction in (entry_direction, exit_direction)
    )
    leads = sorted({turn_around, max(turn_around, lead_in)} - {0.0}, reverse=True)
    items = [_make_waypoint(point_items[0], line.corners[0] + length * entry_direction, origin) for length in leads]
    if turn_around > 0.0:
        exit_waypoint = _make_waypoint(point_items[-1], line.corners[-1] + turn_around * exit_direction, origin)
        return [*items, *line.items, exit_waypoint]
    # No autopilot flies to a gate: without waypoints beyond the line, its gates must become waypoints.
    for item in line.items:
        is_gate = item.command == Command.CONDITION_GATE and _is_line_point(item, line.flown)
        params = (0.0, 0.0, 0.0, math.nan)
        items.append(replace(item, command=int(Command.NAV_WAYPOINT), params=params) if is_gate else item)
    return items


def _make_waypoint(model_item: MissionItem, position: Floats, origin: GeoOrigin) -> MissionItem:
    """Return a plain waypoint at a position (east, north, m), with another item's altitude and number."""
    lat, lon = (round_to_grid(float(value)) for value in to_geo(origin, float(position[0]), float(position[1])))
    params = (0.0, 0.0, 0.0, model_item.params[3] if math.isnan(model_item.params[3]) else 0.0)
    return replace(model_item, command=int(Command.NAV_WAYPOINT), params=params, lat_deg=lat, lon_deg=lon)


def _lines_on_course(lines: Sequence[_Line], survey: Survey, course: float, origin: GeoOrigin) -> list[_Line] | None:
    """Return lines on another course that cover the convex hull of the present lines; None if impossible.

    course: course of the new lines, rad.

    It is impossible if the lines differ in altitude, if a line bends, or if no new line is long enough.
    """
    waypoint_items = [item for line in lines for item in line.point_items]
    if len({(item.frame, item.alt) for item in waypoint_items}) != 1:
        return None
    for line in lines:
        # A line bends if it deviates from the straight line between its ends.
        start, step = line.corners[0], line.corners[-1] - line.corners[0]
        offsets = (line.corners - start) @ np.array([step[1], -step[0]]) / max(float(np.hypot(*step)), 1e-9)
        if np.abs(offsets).max() > _BEND_TOLERANCE_M:
            return None
    hull = convex_hull(np.concatenate([line.corners for line in lines]))
    if hull is None:
        return None
    direction = np.array([math.sin(course), math.cos(course)])
    right = np.array([direction[1], -direction[0]])
    lateral, longitudinal = hull @ right, hull @ direction
    count = max(1, round((lateral.max() - lateral.min()) / survey.spacing))
    margin = 0.5 * (lateral.max() - lateral.min() - (count - 1) * survey.spacing)
    first_line, line_ends = lines[0], list[Floats]()
    for number in range(count):
        offset = float(lateral.min()) + margin + number * survey.spacing
        crossings = _line_within_outline(lateral, longitudinal, offset)
        if crossings is None or crossings[1] - crossings[0] < _MIN_LINE_LENGTH_M:
            continue
        line_ends.append(np.array([offset * right + distance * direction for distance in crossings]))
    if not line_ends:
        return None
    # The survey starts near its previous start: at the nearest end of the nearest line.
    start = first_line.corners[0]
    if math.dist(line_ends[-1].mean(axis=0), start) < math.dist(line_ends[0].mean(axis=0), start):
        line_ends.reverse()
    if math.dist(line_ends[0][1], start) < math.dist(line_ends[0][0], start):
        line_ends = [ends[::-1] for ends in line_ends]
    return [_Line(ends, _move_items(first_line, ends, origin), first_line.flown) for ends in line_ends]


def convex_hull(points: Floats) -> Floats | None:
    """Return the corners of the convex hull of (n, 2) points; None if all points lie on one line.

    The corners are in counter-clockwise order (Andrew 1979).

    >>> convex_hull(np.array([[0.0, 0.0], [2.0, 0.0], [1.0, 0.5], [2.0, 2.0], [1.0, 0.0]])).tolist()
    [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]]
    """
    ordered = points[np.lexsort((points[:, 1], points[:, 0]))].tolist()
    hull: list[list[float]] = []
    for half in (ordered, ordered[::-1]):
        chain: list[list[float]] = []
        for x, y in half:
            while len(chain) > 1:
                (x0, y0), (x1, y1) = chain[-2:]
                if (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) > 0.0:
                    break
                chain.pop()
            chain.append([x, y])
        hull += chain[:-1]
    return np.array(hull) if len(hull) > 2 else None


def _line_within_outline(lateral: Floats, longitudinal: Floats, offset: float) -> tuple[float, float] | None:
    """Return the coordinates along a line at which it enters and leaves a convex outline, m.

    None if the line misses the outline.

    lateral, longitudinal: coordinates of the outline's corners across and along the line, m.
    offset: lateral coordinate of the line, m.
    """
    crossings = []
    for index in range(len(lateral)):
        start_distance, end_distance = lateral[index - 1] - offset, lateral[index] - offset
        if start_distance * end_distance <= 0.0 and start_distance != end_distance:
            crossings.append(
                float(
                    longitudinal[index - 1]
                    + (longitudinal[index] - longitudinal[index - 1]) * start_distance / (start_distance - end_distance)
                )
            )
    return (min(crossings), max(crossings)) if len(crossings) >= 2 else None


def _move_items(line: _Line, ends: Floats, origin: GeoOrigin) -> tuple[MissionItem, ...]:
    """Return a line's items with its first and last waypoint moved to the ends of another line.

    Waypoints between the ends are left out.

    ends: ends of the other line, (2, 2) m.
    """
    waypoint_indices = [index for index, item in enumerate(line.items) if _is_line_point(item, line.flown)]
    moved = []
    for index, item in enumerate(line.items):
        if index in (waypoint_indices[0], waypoint_indices[-1]):
            lat, lon = (
                round_to_grid(float(value))
                for value in to_geo(origin, *ends[0 if index == waypoint_indices[0] else 1].tolist())
            )
            item = replace(item, lat_deg=lat, lon_deg=lon)
        elif _is_line_point(item, line.flown):
            continue
        moved.append(item)
    return tuple(moved)
