"""Legs and corners of a path as they are measured once, and the length of leg that turns take."""

import math

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY
from aircraft.path_limits import PerformanceTable, corner_tangent, fly_over_run, roll_reversal_length
from aircraft.tracking import corner_room, faster_by
from planner.evaluation.problem_arrays import ProblemArrays
from world.kernels import Record, Records, compiled, inlined

Floats = NDArray[np.float64]
# East and north of the unit vector that the wind blows towards.
Wind = tuple[float, float]

# A leg: its unit course (0, 0 for none), its horizontal length and its length, m.
LEG = np.dtype([("east", np.float64), ("north", np.float64), ("run", np.float64), ("length", np.float64)])
# A corner: length of leg that its fly-by arc takes on either side, and the arc's radius; lengths of the legs before and
# after it that turning there takes, the autopilot's settling included; and how far it then strays from the legs, m.
CORNER = np.dtype([(name, np.float64) for name in ("tangent", "radius", "before", "after", "excursion")])

# Leg left over between its two turns: this share of the leg, and this length (m) or what small turns use of it.
SETTLING_SHARE = 0.05
SETTLING_LENGTH = 20.0


@inlined
def measure_legs(path: Floats, legs: Records) -> None:  # pragma: no cover - compiled
    """Fill `LEG` records (w - 1,) of a path (w, 3)."""
    for i in range(legs.shape[0]):
        dx, dy = path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1]
        dz = path[i + 1, 2] - path[i, 2]
        run = math.sqrt(dx * dx + dy * dy)
        legs[i].east = dx / run if run > 0.0 else 0.0
        legs[i].north = dy / run if run > 0.0 else 0.0
        legs[i].run = run
        legs[i].length = math.sqrt(dx * dx + dy * dy + dz * dz)


@compiled
def measure_corners(
    data: ProblemArrays, wind: Wind, path: Floats, legs: Records, corners: Records
) -> None:  # pragma: no cover - compiled
    """Fill `CORNER` records (w,) of a path (w, 3) whose legs are measured."""
    aircraft, tracking = data.aircraft, data.tracking
    last: int = legs.shape[0]
    for i in range(1, last):
        ux, uy, vx, vy = legs[i - 1].east, legs[i - 1].north, legs[i].east, legs[i].north
        some = (ux != 0.0 or uy != 0.0) and (vx != 0.0 or vy != 0.0)
        measure_corner(aircraft, tracking, wind, some, ux, uy, vx, vy, path[i, 2], corners[i])
    for i, asked in ((0, data.start_course), (last, data.destination_course)):
        ux, uy, vx, vy = courses_at(data, legs, i)
        some = not math.isnan(asked) and legs[min(i, last - 1)].run > 0.0
        measure_corner(aircraft, tracking, wind, some, ux, uy, vx, vy, path[i, 2], corners[i])


@compiled
def measure_corner(
    aircraft: PerformanceTable,
    tracking: Record,
    wind: Wind,
    some: bool,
    ux: float,
    uy: float,
    vx: float,
    vy: float,
    amsl: float,
    corner: Record,
) -> None:  # pragma: no cover - compiled
    """Fill the `CORNER` record of a turn between the unit courses u and v; of none where there is no such turn."""
    tangent, radius, excursion = 0.0, 0.0, 0.0
    if some:
        tangent, radius = corner_tangent(aircraft, ux, uy, vx, vy, amsl, wind[0], wind[1])
    before, after = tangent, tangent
    if tracking.strays and 0.0 < tangent < math.inf:
        turn = math.atan2(abs(ux * vy - uy * vx), ux * vx + uy * vy)
        # The highest ground speed on the way, which the arc's radius is of.
        speed = math.sqrt(radius * GRAVITY * aircraft.tan_max_bank) + faster_by(tracking, amsl)
        excursion, room_before, room_after = corner_room(tracking, turn, speed)
        before, after = max(tangent, room_before), max(tangent, room_after)
    corner.tangent, corner.radius = tangent, radius
    corner.before, corner.after, corner.excursion = before, after, excursion


@inlined
def courses_at(
    data: ProblemArrays, legs: Records, i: int
) -> tuple[float, float, float, float]:  # pragma: no cover - compiled
    """Unit courses before and after waypoint i; at the ends those asked for, else the leg's own."""
    last = legs.shape[0]
    after, before = min(i, last - 1), max(i - 1, 0)
    ux, uy, vx, vy = legs[before].east, legs[before].north, legs[after].east, legs[after].north
    if i == 0 and not math.isnan(data.start_course):
        ux, uy = math.sin(data.start_course), math.cos(data.start_course)
    if i == last and not math.isnan(data.destination_course):
        vx, vy = math.sin(data.destination_course), math.cos(data.destination_course)
    return ux, uy, vx, vy


@inlined
def settling_length(need: float, run: float) -> float:  # pragma: no cover - compiled
    """Length of a leg (m) that stays straight between its turns, so that the first has settled; need: what they use."""
    return SETTLING_SHARE * run + min(SETTLING_LENGTH, need)


@inlined
def turn_length(fly_over: bool, corners: Records, i: int) -> float:  # pragma: no cover - compiled
    """Length of leg i that its two turns use, m: of a fly-over only the one at its beginning, on the way back to it."""
    if not fly_over:
        need: float = corners[i].after + corners[i + 1].before
        return need
    if corners[i].tangent <= 0.0:
        return 0.0
    if math.isinf(corners[i].tangent):
        return math.inf
    back: float = corners[i].radius * fly_over_run(2.0 * math.atan(corners[i].tangent / corners[i].radius))
    return max(back, corners[i].after) if corners[i].excursion > 0.0 else back


@compiled
def roll_length(
    aircraft: PerformanceTable, legs: Records, corners: Records, i: int, amsl: float, wind: Wind
) -> float:  # pragma: no cover - compiled
    """Length of leg i that the roll from its first fly-by turn into its second uses, m; 0 for turns of one side."""
    if i == 0 or i == legs.shape[0] - 1 or corners[i].tangent <= 0.0 or corners[i + 1].tangent <= 0.0:
        return 0.0
    ux, uy = legs[i].east, legs[i].north
    into, onward = legs[i - 1].east * uy - legs[i - 1].north * ux, ux * legs[i + 1].north - uy * legs[i + 1].east
    if into * onward >= 0.0 or math.isinf(corners[i].tangent + corners[i + 1].tangent):
        return 0.0
    length: float = roll_reversal_length(
        aircraft, ux, uy, amsl, corners[i].radius, corners[i + 1].radius, wind[0], wind[1]
    )
    return length
