"""Routes that may turn back and go round to climb: over a lattice of places, heights and courses, pulled taut."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.certify_kernels import turn_and_roll_lengths
from planner.evaluation.encoding import RotatedFrame
from planner.evaluation.leg_constraints import slope_limits
from planner.evaluation.leg_geometry import settling_length
from planner.evaluation.problem_arrays import ProblemArrays
from planner.seeding.lattice_kernels import (
    LATTICE_CELL,
    Lattice,
    begin_lattice_search,
    pulled_taut,
    search_lattice_on,
    traced,
)
from world.kernels import Records

Floats = NDArray[np.float64]

# Shortest step, m, and the longest that a step has to be for two right angles in it, whatever the aircraft, m.
LEAST_STEP, LONGEST_STEP = 100.0, 2000.0
# Layers that the gentler slope limit climbs or sinks in a step along.
LAYERS_A_STEP = 2
# States of a lattice, and how many of them are looked at, at most.
MOST_LATTICE, MOST_STATES = 4_000_000, 600_000
# States that are looked at before the caller may end the work: some 10 ms.
STATES_AT_ONCE = 2000


def turning_step(data: ProblemArrays) -> float:
    """Length of a leg between two right angles of one side, m: what they take of it, and settling between them."""
    if not data.legs_hold_turns:
        return LEAST_STEP
    long = LONGEST_STEP
    square = np.array([[0.0, 0.0], [long, 0.0], [long, long], [0.0, long]]) + data.start[:2]
    path = np.column_stack([square, np.full(4, data.start[2])])
    turns, rolls = turn_and_roll_lengths(data, path)
    need = float(turns[1] + rolls[1])
    return min(LONGEST_STEP, max(LEAST_STEP, need + settling_length(need, 1.1 * need)))


def make_lattice(data: ProblemArrays, frame: RotatedFrame, step: float) -> Lattice:
    """A lattice over the whole map whose steps are at most so long, one of them on each end; longer if it must be.

    step: m.  A lattice of more than `MOST_LATTICE` states has longer steps.
    """
    corners = [(e, n, 0.0) for e in (data.west, data.east) for n in (data.south, data.north)]
    low, high = frame.rotate(corners)[:, :2].min(axis=0), frame.rotate(corners)[:, :2].max(axis=0)
    level = np.array([*data.destination[:2], data.start[2]])
    gentlest = math.tan(max(0.01, min(slope_limits(data, np.array(data.start), level))))
    bottom = max(data.floor, float(np.nanmin(data.heights)) + data.clearance)
    stages = max(1, math.ceil(frame.length / step))
    while True:
        step = frame.length / stages
        pitch = gentlest * step / LAYERS_A_STEP
        behind, right = math.floor(-low[0] / step), math.floor(-low[1] / step)
        along, across = behind + math.floor(high[0] / step) + 1, right + math.floor(high[1] / step) + 1
        below = max(0, math.floor((data.start[2] - bottom) / pitch))
        layers = below + max(0, math.floor((data.ceiling - data.start[2]) / pitch)) + 1
        if stages == 1 or along * across * layers * 8 <= MOST_LATTICE:
            break
        stages -= 1
    goal_layer = min(layers - 1, max(0, round((data.destination[2] - data.start[2]) / pitch) + below))
    start = data.start[2] - below * pitch
    return Lattice(step, behind, right, along, across, behind + stages, start, pitch, layers, below, goal_layer)


def cheapest_lattice_route(
    data: ProblemArrays,
    frame: RotatedFrame,
    lattice: Lattice,
    courses: int,
    most_states: int,
    pause: Callable[[], None] = lambda: None,
) -> Records:
    """`LATTICE_CELL` records of the cheapest route from start to destination; none where there is none.

    courses: by which one step may differ from the last, in eighths of a circle.  most_states: that are looked at.
    """
    search = begin_lattice_search(data, frame, lattice)
    while search.found < 0 and len(search.states) and search.seen < most_states:
        search = search_lattice_on(
            data, frame, lattice, courses, search, min(STATES_AT_ONCE, most_states - search.seen)
        )
        pause()
    if search.found < 0:
        return np.zeros(0, dtype=LATTICE_CELL)
    return traced(search.reached.came, search.found, lattice)


def lattice_route(
    data: ProblemArrays, frame: RotatedFrame, step: float, pause: Callable[[], None] = lambda: None
) -> Floats:
    """World points (k, 3) of a route from start to destination over a lattice of this step (m); (0, 3) for none.

    pause: called after every `STATES_AT_ONCE` states; what it raises ends the work.
    """
    lattice = make_lattice(data, frame, step)
    # Right angles at most, where the limits allow them; a way of eight courses has eighths of a circle at least.
    courses = 2 if data.max_turn >= math.radians(90.0) else 1
    cells = cheapest_lattice_route(data, frame, lattice, courses, MOST_STATES, pause)
    if not len(cells):
        return np.empty((0, 3))
    places = np.column_stack([cells["along"], cells["across"]]) * lattice.step
    up = lattice.low + cells["layer"] * lattice.pitch
    points = frame.restore(np.column_stack([places, up]))
    points[0], points[-1] = data.start, data.destination
    return np.asarray(pulled_taut(data, np.ascontiguousarray(points)))
