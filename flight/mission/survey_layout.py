"""Another layout of a survey: longer turn-arounds, every second line first, lines on another course.

What is not of the survey stays as it is in the mission, and each line keeps its items, the camera's among them.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flight.mission.items import Command, Mission, MissionItem, is_navigation, on_grid, renumbered
from flight.mission.route import Route
from flight.mission.surveys import PhotoLine, Survey
from world.frames import GeoOrigin, to_geo

Floats = NDArray[np.float64]

# A line of a survey on another course is at least this long, m.
_SHORTEST = 50.0
# A lead is as long as the turn-arounds to within this, m.
_SAME_LEAD = 1.0


class SurveyLayout(NamedTuple):
    """How to fly a survey.

    turn_around: m from each line's end to where its turn begins, and from there to the next line's begin; 0 for none.
    every: 2 for every second line on the way there and the others on the way back, 3 for every third, and so on.
    course: of the lines, rad; None for the one they have.
    backwards: whether to begin with the line on the other side.
    """

    turn_around: float
    every: int = 1
    course: float | None = None
    backwards: bool = False


class _Line(NamedTuple):
    """A line to fly: its end points (2, 2) m in its direction, the items of its ends and between, and its height."""

    ends: Floats
    items: tuple[MissionItem, ...]


def turn_around_of(route: Route, survey: Survey) -> float:
    """Least distance (m) that a survey's lines go straight on beyond their photos, at either end of a turn-around."""
    points = route.waypoints[:, :2]
    beyond = [
        min(math.dist(points[one.last], points[one.ends]), math.dist(points[other.begins], points[other.first]))
        for one, other in zip(survey.lines[:-1], survey.lines[1:], strict=True)
    ]
    return min(beyond)


def with_layout(
    mission: Mission, route: Route, survey: Survey, layout: SurveyLayout, origin: GeoOrigin
) -> Mission | None:
    """The mission with a survey laid out otherwise; None where that cannot be done.

    route: of the mission, on the map about ``origin``.  A mission that jumps, or whose lines are no items of their own,
    keeps its layout; lines on another course need one height for all.
    """
    if any(item.command in (Command.DO_JUMP, Command.DO_JUMP_TAG, Command.JUMP_TAG) for item in mission.items):
        return None
    at = {item.seq: k for k, item in enumerate(mission.items)}
    seqs = [int(seq) for seq in route.items]
    if any(seqs[i] not in at for line in survey.lines for i in range(line.first, line.last + 1)):
        return None
    blocks = [_block(mission, at, seqs, line) for line in survey.lines]
    if not _only_waypoints(mission, at, seqs, survey):
        return None
    lines = [
        _Line(route.waypoints[[line.first, line.last], :2], block)
        for line, block in zip(survey.lines, blocks, strict=True)
    ]
    if layout.course is not None:
        turned = _turned(lines, survey, layout.course, origin)
        if turned is None:
            return None
        lines = turned
    first, last = at[seqs[survey.lines[0].first]], at[seqs[survey.lines[-1].last]]
    before, after = list(mission.items[:first]), list(mission.items[last + len(_trailing(mission, last)) + 1 :])
    _drop_extension(before, after, route, seqs, survey)
    made = list(before)
    for line in _ordered(lines, layout):
        made += _with_ends(line, layout.turn_around, origin)
    # Two items of one number cannot be told apart: all are numbered anew.
    numbered = [replace(item, seq=k) for k, item in enumerate([*made, *after], 1)]
    return renumbered(replace(mission, items=tuple(numbered)))


def _block(mission: Mission, at: dict[int, int], seqs: Sequence[int], line: PhotoLine) -> tuple[MissionItem, ...]:
    """A line's items, with those that stand behind its last waypoint."""
    first, last = at[seqs[line.first]], at[seqs[line.last]]
    return (*mission.items[first : last + 1], *_trailing(mission, last))


def _only_waypoints(mission: Mission, at: dict[int, int], seqs: Sequence[int], survey: Survey) -> bool:
    """Whether lines are flown by waypoints, and nothing but waypoints stands between them."""
    for line in survey.lines:
        steps = [mission.items[at[seqs[i]]] for i in range(line.first, line.last + 1)]
        if any(item.command != Command.NAV_WAYPOINT for item in steps):
            return False
    for first, last in survey.turn_arounds():
        end = at[seqs[first]]
        between = mission.items[end + 1 + len(_trailing(mission, end)) : at[seqs[last]]]
        if any(item.command != Command.NAV_WAYPOINT for item in between):
            return False
    return True


def _trailing(mission: Mission, at: int) -> list[MissionItem]:
    """The items behind one, up to the next step of the flight."""
    out: list[MissionItem] = []
    for item in mission.items[at + 1 :]:
        if is_navigation(item.command):
            break
        out.append(item)
    return out


def _drop_extension(
    before: list[MissionItem], after: list[MissionItem], route: Route, seqs: Sequence[int], survey: Survey
) -> None:
    """Take out the waypoints that lead straight into the first line and out of the last: they are laid out anew.

    What is further away than the turn-arounds are long is on the way to the survey, and stays.
    """
    into, out, longest = survey.lines[0], survey.lines[-1], turn_around_of(route, survey) + _SAME_LEAD
    points = route.waypoints[:, :2]
    leads = dict.fromkeys(range(into.begins, into.first), into.first)
    leads |= dict.fromkeys(range(out.last + 1, out.ends + 1), out.last)
    beyond = {seqs[i] for i, end in leads.items() if math.dist(points[i], points[end]) <= longest}
    for items in (before, after):
        items[:] = [item for item in items if item.seq not in beyond or item.command != Command.NAV_WAYPOINT]


def _ordered(lines: Sequence[_Line], layout: SurveyLayout) -> list[_Line]:
    """Lines in the order of flight, each the other way round than the one before; the first as the first is.

    Those of a survey that keeps its order stay as they are.
    """
    if layout.every == 1 and layout.course is None and not layout.backwards:
        return list(lines)
    start, end = lines[0].ends
    unit = (end - start) / max(float(np.hypot(*(end - start))), 1e-9)
    right = np.array([unit[1], -unit[0]])
    offsets = [float((line.ends.mean(axis=0) - start) @ right) for line in lines]
    aside = sorted(range(len(lines)), key=lambda k: offsets[k])
    if (offsets[0] > 0.5 * (min(offsets) + max(offsets))) is not layout.backwards:
        aside.reverse()
    out: list[_Line] = []
    for begin in range(layout.every):
        for k in aside[begin :: layout.every]:
            line, ahead = lines[k], len(out) % 2 == 0
            out.append(line if (float((line.ends[1] - line.ends[0]) @ unit) > 0.0) == ahead else _reversed(line))
    return out


def _reversed(line: _Line) -> _Line:
    """A line the other way round: its waypoints change places, what stands behind each stays where it is."""
    steps = [item for item in line.items if is_navigation(item.command)]
    backwards = iter(reversed(steps))
    return _Line(
        line.ends[::-1], tuple(next(backwards) if is_navigation(item.command) else item for item in line.items)
    )


def _with_ends(line: _Line, turn_around: float, origin: GeoOrigin) -> list[MissionItem]:
    """A line's items between the waypoints at which its turn-arounds end and begin."""
    if turn_around <= 0.0:
        return list(line.items)
    steps = [item for item in line.items if is_navigation(item.command)]
    start, end = line.ends
    step = turn_around * (end - start) / max(float(np.hypot(*(end - start))), 1e-9)
    into, out = _waypoint(steps[0], start - step, origin), _waypoint(steps[-1], end + step, origin)
    return [into, *line.items, out]


def _waypoint(like: MissionItem, place: Floats, origin: GeoOrigin) -> MissionItem:
    """A plain waypoint at the height of another item."""
    lat, lon = (on_grid(float(value)) for value in to_geo(origin, float(place[0]), float(place[1])))
    nothing = (0.0, 0.0, 0.0, like.params[3] if math.isnan(like.params[3]) else 0.0)
    return replace(like, command=int(Command.NAV_WAYPOINT), params=nothing, lat_deg=lat, lon_deg=lon)


def _turned(lines: Sequence[_Line], survey: Survey, course: float, origin: GeoOrigin) -> list[_Line] | None:
    """Lines on another course over the same area, which is the hull of the lines that there are."""
    ends = [item for line in lines for item in line.items if is_navigation(item.command)]
    if len({(item.frame, item.alt) for item in ends}) != 1:
        return None
    corners = np.concatenate([line.ends for line in lines])
    hull = convex_hull(corners)
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
    start = pattern.ends[0]
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
