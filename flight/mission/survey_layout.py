"""Another layout of a survey: longer turn-arounds, every second line first, lines on another course.

What is not of the survey stays as it is in the mission, and each line keeps its items, the camera's among them.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flight.mission.items import Command, Mission, MissionItem, command_name, is_navigation, on_grid, renumbered
from flight.mission.route import Route
from flight.mission.surveys import Survey
from world.frames import GeoOrigin, to_geo

Floats = NDArray[np.float64]

# A line of a survey on another course is at least this long, m.
_SHORTEST = 50.0
# A line bends where it strays further than this from the straight one between its ends, m.
_STRAIGHT = 5.0
# A lead is as long as the turn-arounds to within this, m.
_SAME_LEAD = 1.0


class SurveyLayout(NamedTuple):
    """How to fly a survey.

    turn_around: m from each line's end to where its turn begins, and from there to the next line's begin; 0 for none.
    every: 2 for every second line first and then the others, from the same side on; 3 for every third, and so on.
    course: of the lines, rad; None for the one they have.
    backwards: whether to begin with the line on the other side.
    lead_in: m straight on before the first line, where that is more: one comes to it from anywhere.
    """

    turn_around: float
    every: int = 1
    course: float | None = None
    backwards: bool = False
    lead_in: float = 0.0


class _Line(NamedTuple):
    """A line to fly: its corners (k, 2) m in its direction, and its items, those of its ends and of what is between."""

    corners: Floats
    items: tuple[MissionItem, ...]


class _Items(NamedTuple):
    """Where a survey's items stand in a mission's list, as indices.

    lines: of each, the first item and the one behind its last; without a waypoint of its own at its begin, the first
    behind what is there instead.
    behind: the first item that is flown behind the survey's last run.
    before: the first behind what is flown before its first run.
    """

    lines: tuple[tuple[int, int], ...]
    before: int
    behind: int


def turn_around_of(route: Route, survey: Survey) -> float:
    """Least distance (m) that a survey's lines go straight on beyond their photos, at either end of a turn-around."""
    return min(_beyond(route, survey))


def _beyond(route: Route, survey: Survey) -> list[float]:
    """How far (m) the lines go straight on at each end of each turn-around."""
    points, pairs = route.waypoints[:, :2], zip(survey.lines[:-1], survey.lines[1:], strict=True)
    ends = [pair for one, other in pairs for pair in ((one.last, one.ends), (other.begins, other.first))]
    return [math.dist(points[one], points[other]) for one, other in ends]


def kept_layout(mission: Mission, route: Route, survey: Survey) -> str:
    """Why a survey's layout cannot be changed, in words; "" where it can."""
    if any(item.command in (Command.DO_JUMP, Command.DO_JUMP_TAG, Command.JUMP_TAG) for item in mission.items):
        return "the mission jumps"
    at = {item.seq: k for k, item in enumerate(mission.items)}
    if any(int(route.items[i]) not in at for line in survey.lines for i in range(line.first, line.last + 1)):
        return "a line begins or ends where no item is"
    items = _items_of(mission, route, survey)
    for first, end in items.lines:
        for item in mission.items[first:end]:
            if is_navigation(item.command) and item.command != Command.NAV_WAYPOINT:
                return f"item {item.seq}, {command_name(item.command)}, stands on a line"
    for (_, end), (first, _) in zip(items.lines[:-1], items.lines[1:], strict=True):
        for item in mission.items[end:first]:
            if item.command != Command.NAV_WAYPOINT:
                return f"item {item.seq}, {command_name(item.command)}, stands between two lines"
    return ""


def with_layout(
    mission: Mission, route: Route, survey: Survey, layout: SurveyLayout, origin: GeoOrigin
) -> Mission | None:
    """The mission with a survey laid out otherwise; None where that cannot be done.

    route: of the mission, on the map about ``origin``.  Where `kept_layout` says why, nothing can be changed; lines on
    another course need straight ones, and one height for all.
    """
    if kept_layout(mission, route, survey):
        return None
    items, lines = _items_of(mission, route, survey), list[_Line]()
    for photo_line, (first, end) in zip(survey.lines, items.lines, strict=True):
        corners, own = route.waypoints[photo_line.first : photo_line.last + 1, :2], mission.items[first:end]
        steps = [item for item in own if is_navigation(item.command)]
        if _place_of(mission, route)[steps[0].seq] != photo_line.first:
            own = (_waypoint(steps[0], corners[0], origin), *own)
        lines.append(_Line(corners, own))
    if layout.course is not None:
        turned = _turned(lines, survey, layout.course, origin)
        if turned is None:
            return None
        lines = turned
    longest = max(_beyond(route, survey)) + _SAME_LEAD
    (first, _), (_, end) = items.lines[0], items.lines[-1]
    made = [*mission.items[: items.before]]
    made += _without_leads(mission, route, mission.items[items.before : first], survey.lines[0].first, longest)
    for number, line in enumerate(_ordered(lines, layout)):
        made += _with_ends(line, layout.turn_around, layout.lead_in if number == 0 else 0.0, origin)
    made += _without_leads(mission, route, mission.items[end : items.behind], survey.lines[-1].last, longest)
    # Two items of one number cannot be told apart: all are numbered anew.
    numbered = [replace(item, seq=k) for k, item in enumerate([*made, *mission.items[items.behind :]], 1)]
    return renumbered(replace(mission, items=tuple(numbered)))


def _items_of(mission: Mission, route: Route, survey: Survey) -> _Items:
    """Where the items of a survey's lines stand, each with those that switch what is switched at its ends."""
    at, count = {item.seq: k for k, item in enumerate(mission.items)}, len(mission.items)
    seqs = [int(seq) for seq in route.items]

    def index(waypoint: int) -> int:
        return at.get(seqs[waypoint], count) if 0 <= waypoint < len(seqs) else count

    lines = []
    for line in survey.lines:
        # What is merged with its first waypoint stands at the same place: a take-off, say, and a waypoint.
        first = max(
            k for k in range(index(line.first), index(line.first + 1)) if is_navigation(mission.items[k].command)
        )
        if mission.items[first].command != Command.NAV_WAYPOINT:
            first += 1
        end = index(line.last) + 1
        while end < count and not is_navigation(mission.items[end].command):
            end += 1
        lines.append((first, end))
    into, out = survey.lines[0], survey.lines[-1]
    before = min(index(into.begins), lines[0][0])
    return _Items(tuple(lines), before, max(lines[-1][1], index(out.ends + 1)))


def _place_of(mission: Mission, route: Route) -> dict[int, int]:
    """The waypoint at which each step of the flight stands, by its number; that before for one without its own."""
    own, here, out = {int(seq): i for i, seq in enumerate(route.items)}, 0, dict[int, int]()
    for item in mission.items:
        if is_navigation(item.command):
            here = own.get(item.seq, here)
            out[item.seq] = here
    return out


def _without_leads(
    mission: Mission, route: Route, items: Sequence[MissionItem], end: int, longest: float
) -> list[MissionItem]:
    """Items beyond an end of a survey, without the waypoints that lead straight on from it: they are laid out anew.

    end: the waypoint.  What is further away than the turn-arounds are long is on the way to the survey, and stays.
    """
    points, places = route.waypoints[:, :2], _place_of(mission, route)

    def leads(item: MissionItem) -> bool:
        near = item.seq in places and math.dist(points[places[item.seq]], points[end]) <= longest
        return near and item.command == Command.NAV_WAYPOINT

    return [item for item in items if not leads(item)]


def _ordered(lines: Sequence[_Line], layout: SurveyLayout) -> list[_Line]:
    """Lines in the order of flight, each the other way round than the one before; the first as the first is.

    Those of a survey that keeps its order stay as they are.
    """
    if layout.every == 1 and layout.course is None and not layout.backwards:
        return list(lines)
    start, end = lines[0].corners[[0, -1]]
    unit = (end - start) / max(float(np.hypot(*(end - start))), 1e-9)
    right = np.array([unit[1], -unit[0]])
    offsets = [float((line.corners[[0, -1]].mean(axis=0) - start) @ right) for line in lines]
    aside = sorted(range(len(lines)), key=lambda k: offsets[k])
    if (offsets[0] > 0.5 * (min(offsets) + max(offsets))) is not layout.backwards:
        aside.reverse()
    out: list[_Line] = []
    for begin in range(layout.every):
        for k in aside[begin :: layout.every]:
            line, ahead = lines[k], len(out) % 2 == 0
            along = float((line.corners[-1] - line.corners[0]) @ unit) > 0.0
            out.append(line if along == ahead else _reversed(line))
    return out


def _reversed(line: _Line) -> _Line:
    """A line the other way round: its waypoints change places, what stands behind each stays where it is."""
    steps = [item for item in line.items if is_navigation(item.command)]
    backwards = iter(reversed(steps))
    return _Line(
        line.corners[::-1], tuple(next(backwards) if is_navigation(item.command) else item for item in line.items)
    )


def _with_ends(line: _Line, turn_around: float, lead_in: float, origin: GeoOrigin) -> list[MissionItem]:
    """A line's items between the waypoints at which its turn-arounds end and begin, and that of a longer lead."""
    steps = [item for item in line.items if is_navigation(item.command)]
    into, out = line.corners[0] - line.corners[1], line.corners[-1] - line.corners[-2]
    into, out = (way / max(float(np.hypot(*way)), 1e-9) for way in (into, out))
    leads = sorted({turn_around, max(turn_around, lead_in)} - {0.0}, reverse=True)
    made = [_waypoint(steps[0], line.corners[0] + metres * into, origin) for metres in leads]
    made += line.items
    return made if turn_around <= 0.0 else [*made, _waypoint(steps[-1], line.corners[-1] + turn_around * out, origin)]


def _waypoint(like: MissionItem, place: Floats, origin: GeoOrigin) -> MissionItem:
    """A plain waypoint at the height of another item."""
    lat, lon = (on_grid(float(value)) for value in to_geo(origin, float(place[0]), float(place[1])))
    nothing = (0.0, 0.0, 0.0, like.params[3] if math.isnan(like.params[3]) else 0.0)
    return replace(like, command=int(Command.NAV_WAYPOINT), params=nothing, lat_deg=lat, lon_deg=lon)


def _turned(lines: Sequence[_Line], survey: Survey, course: float, origin: GeoOrigin) -> list[_Line] | None:
    """Lines on another course over the same area, which is the hull of the lines that there are."""
    ends = [item for line in lines for item in line.items if is_navigation(item.command)]
    if len({(item.frame, item.alt) for item in ends}) != 1 or any(_bends(line.corners) for line in lines):
        return None
    hull = convex_hull(np.concatenate([line.corners for line in lines]))
    if hull is None:
        return None
    unit = np.array([math.sin(course), math.cos(course)])
    right = np.array([unit[1], -unit[0]])
    aside, along = hull @ right, hull @ unit
    count = max(1, round((aside.max() - aside.min()) / survey.spacing))
    margin = 0.5 * (aside.max() - aside.min() - (count - 1) * survey.spacing)
    pattern, out = lines[0], list[Floats]()
    for k in range(count):
        at = float(aside.min()) + margin + k * survey.spacing
        crossed = _crossed(aside, along, at)
        if crossed is None or crossed[1] - crossed[0] < _SHORTEST:
            continue
        out.append(np.array([at * right + metres * unit for metres in crossed]))
    if not out:
        return None
    # It begins where it did: at the nearest end of the nearest line.
    start = pattern.corners[0]
    if math.dist(out[-1].mean(axis=0), start) < math.dist(out[0].mean(axis=0), start):
        out.reverse()
    if math.dist(out[0][1], start) < math.dist(out[0][0], start):
        out = [places[::-1] for places in out]
    return [_Line(places, _moved(pattern.items, places, origin)) for places in out]


def convex_hull(points: Floats) -> Floats | None:
    """Corners of the convex hull of (n, 2) points, counter-clockwise (Andrew 1979); None where all lie on a line.

    >>> convex_hull(np.array([[0.0, 0.0], [2.0, 0.0], [1.0, 0.5], [2.0, 2.0], [1.0, 0.0]])).tolist()
    [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]]
    """
    ordered = points[np.lexsort((points[:, 1], points[:, 0]))].tolist()
    hull: list[list[float]] = []
    for way in (ordered, ordered[::-1]):
        chain: list[list[float]] = []
        for x, y in way:
            while len(chain) > 1:
                (x0, y0), (x1, y1) = chain[-2:]
                if (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) > 0.0:
                    break
                chain.pop()
            chain.append([x, y])
        hull += chain[:-1]
    return np.array(hull) if len(hull) > 2 else None


def _bends(corners: Floats) -> bool:
    """Whether a line strays from the straight one between its ends by more than its legs' rounding."""
    start, step = corners[0], corners[-1] - corners[0]
    off = (corners - start) @ np.array([step[1], -step[0]]) / max(float(np.hypot(*step)), 1e-9)
    return bool(np.abs(off).max() > _STRAIGHT)


def _crossed(aside: Floats, along: Floats, at: float) -> tuple[float, float] | None:
    """Where a line across a convex outline enters and leaves it, m along it; None where it does not."""
    found = []
    for k in range(len(aside)):
        one, other = aside[k - 1] - at, aside[k] - at
        if one * other <= 0.0 and one != other:
            found.append(float(along[k - 1] + (along[k] - along[k - 1]) * one / (one - other)))
    return (min(found), max(found)) if len(found) >= 2 else None


def _moved(items: Sequence[MissionItem], ends: Floats, origin: GeoOrigin) -> tuple[MissionItem, ...]:
    """A line's items for another line: of its waypoints the first and the last, moved to its ends."""
    steps = [k for k, item in enumerate(items) if is_navigation(item.command)]
    out = []
    for k, item in enumerate(items):
        if k in (steps[0], steps[-1]):
            lat, lon = (on_grid(float(value)) for value in to_geo(origin, *ends[0 if k == steps[0] else 1].tolist()))
            item = replace(item, lat_deg=lat, lon_deg=lon)
        elif is_navigation(item.command):
            continue
        out.append(item)
    return tuple(out)
