"""Find routes that may turn back or circle to climb.

They are found by A* over a lattice of positions, heights and eight courses.

A* search (Hart, Nilsson and Raphael, 1968) over states; a state is a lattice point and one of eight courses. A step
leads to a neighbouring point, turns by no more than a right angle, and climbs or descends within the slope limits; a
route that needs more distance to climb than is available therefore circles. The heuristic is the straight distance to
the goal, or in a guided search an estimate that knows obstacles and slopes. The resulting route is simplified by
replacing steps with feasible straight legs (`simplify_route`).
"""

import heapq
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.evaluation.certify_kernels import turn_and_roll_lengths
from planner.evaluation.corners import settling_length
from planner.evaluation.encoding import RotatedFrame
from planner.evaluation.leg_constraints import PrecomputedLimits, precompute_limits, slope_limits
from planner.evaluation.problem import ProblemArrays
from planner.seeding.grids import to_world_position
from planner.seeding.waypoint_fitting import penalised_leg_cost
from world.arrays import Flags, Floats
from world.by_reference import by_reference
from world.kernels import Records, compiled, copy_into, inner

Codes = NDArray[np.int64]
Numbers = NDArray[np.int32]
Bytes = NDArray[np.int8]


# --- A* search ---


# Steps to the eight neighbours, along and across, in the order of their courses.
_STEPS = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]])
# Cost per 45 degrees of turn, as a fraction of a step, so that of equally long routes the one with fewest turns is
# best.
TURN_COST = 0.1
# A step is closed if its cost exceeds its length by this factor.
MAX_COST_RATIO = 1.05
# Status of a step.
_UNKNOWN = 0
_FREE = 1
_CLOSED = 2
# Parent of a state of the start.
_FIRST = -1
# A point of a route: steps along and across from the start, and its layer.
LATTICE_CELL = np.dtype([("along", np.int64), ("across", np.int64), ("layer", np.int64)], align=True)


@by_reference
class Lattice(NamedTuple):
    """Regular points in the rotated frame, along and across, in layers of height.

    A point (along, across) is also called a column; its number is along * `across` + across.

    step: spacing of the points, m.
    behind, right: number of points behind the start and to its right.
    along, across: number of points in each direction.
    goal: index along of the destination.
    low: height of the first layer, m.
    layer_spacing: m.
    layers: number of layers.
    start_layer, goal_layer: layers of the ends.
    """

    step: float
    behind: int
    right: int
    along: int
    across: int
    goal: int
    low: float
    layer_spacing: float
    layers: int
    start_layer: int
    goal_layer: int


@inner
def _set_position(frame: RotatedFrame, lattice: Lattice, along: int, across: int, layer: int, out: Floats) -> None:
    """Fill `out` (3,) with the world position of the lattice point with the given indices, m."""
    out[0], out[1] = to_world_position(
        frame, (along - lattice.behind) * lattice.step, (across - lattice.right) * lattice.step
    )
    out[2] = lattice.low + layer * lattice.layer_spacing


@compiled
def _climb_layers(data: ProblemArrays, frame: RotatedFrame, lattice: Lattice) -> Codes:
    """Return the maximum climb and descent of a step on each of the eight courses, in layers, (8, 2)."""
    layers, start, end = np.zeros((8, 2), dtype=np.int64), np.zeros(3), np.zeros(3)
    _set_position(frame, lattice, lattice.behind, lattice.right, lattice.start_layer, start)
    for course in range(8):
        step_across, step_along = _STEPS[course, 1], _STEPS[course, 0]
        _set_position(
            frame, lattice, lattice.behind + step_along, lattice.right + step_across, lattice.start_layer, end
        )
        horizontal_length = math.hypot(end[0] - start[0], end[1] - start[1])
        climb, dive = slope_limits(data, start, end)
        layers[course, 0] = max(0, math.floor(math.tan(climb) * horizontal_length / lattice.layer_spacing))
        layers[course, 1] = max(0, math.floor(math.tan(dive) * horizontal_length / lattice.layer_spacing))
    return layers


class Heuristic(NamedTuple):
    """Estimate of the remaining length of a state's route to the goal.

    squared_distances: (along x across,) square of the horizontal length from each column to the goal, m2.
    climb_length, descent_length: minimum horizontal length per metre of climb or descent, m; 0 to ignore it.
    weight: factor on the estimate. Above 1 the search finds a route sooner, but not the cheapest.
    """

    squared_distances: Floats
    climb_length: float
    descent_length: float
    weight: float


class _StateTable(NamedTuple):
    """Tables of an A* search with an entry for each state: a point, a layer and one of eight courses.

    cost: cost of the cheapest known route to each state, m.
    parents: the parent's number plus 1; 0 for an unreached state, whose cost is not set, and `_FIRST` for a state of
        the start.
    is_expanded: True for a state whose successors have been reached.
    layer_limits: (8, 2) maximum climb and descent of a step on each course, in layers.
    steps: status of the steps by cell, course and change of layer: `_UNKNOWN`, `_FREE` or `_CLOSED`.
    heuristic: estimate of the remaining length.
    """

    cost: Floats
    parents: Numbers
    is_expanded: Flags
    layer_limits: Codes
    steps: Bytes
    heuristic: Heuristic


@inner
def _remaining_cost(lattice: Lattice, heuristic: Heuristic, position: int, altitude: float) -> float:
    """Estimate the cost from a column of a lattice at an altitude to the goal, m.

    position: index of the column in `heuristic.squared_distances`.
    altitude: m.

    It is the length of a sloped line that covers both the distance and the length that the climb or descent needs,
    times the heuristic's weight.
    """
    climb = lattice.low + lattice.goal_layer * lattice.layer_spacing - altitude
    slope_length = climb * heuristic.climb_length if climb > 0.0 else climb * heuristic.descent_length
    squared_distance = max(heuristic.squared_distances[position], slope_length * slope_length)
    return heuristic.weight * math.sqrt(squared_distance + climb * climb)


@inner
def _expand_state(
    data: ProblemArrays,
    limits: PrecomputedLimits,
    frame: RotatedFrame,
    lattice: Lattice,
    table: _StateTable,
    state: int,
    max_turn: int,
    open_states: list[tuple[float, int]],
) -> None:
    """Expand a state: add the successors that it reaches at a lower cost than before to the open list.

    lattice: points of the lattice; a state is a point, a layer and one of eight courses.
    table: costs, parents and flags of all states; updated.
    state: number of the state: (point x layers + layer) x 8 + course.
    max_turn: largest turn per step, in units of 45 degrees.
    open_states: heap of (priority, state), to which the successors are added.

    A successor is the next point on a course that differs by at most `max_turn`, in a layer that the aircraft can climb
    or descend to; the step to it must be free of violations. The priority of a successor is its cost plus its remaining
    cost.
    """
    layer_limits, course, cell = table.layer_limits, state % 8, state // 8
    layer, position = cell % lattice.layers, cell // lattice.layers
    along, across = position // lattice.across, position % lattice.across
    max_descent = np.max(layer_limits[:, 1])
    width = np.max(layer_limits[:, 0]) + max_descent + 1
    start, end = np.empty(3), np.empty(3)
    _set_position(frame, lattice, along, across, layer, start)
    for turn in range(-max_turn, max_turn + 1):
        next_course = (course + turn) % 8
        next_along, next_across = along + _STEPS[next_course, 0], across + _STEPS[next_course, 1]
        if not (0 <= next_along < lattice.along and 0 <= next_across < lattice.across):
            continue
        lowest_layer = max(0, layer - layer_limits[next_course, 1])
        highest_layer = min(lattice.layers - 1, layer + layer_limits[next_course, 0])
        for next_layer in range(lowest_layer, highest_layer + 1):
            next_position = next_along * lattice.across + next_across
            next_state = (next_position * lattice.layers + next_layer) * 8 + next_course
            _set_position(frame, lattice, next_along, next_across, next_layer, end)
            length = math.sqrt((end[0] - start[0]) ** 2 + (end[1] - start[1]) ** 2 + (end[2] - start[2]) ** 2)
            total = table.cost[state] + length + TURN_COST * lattice.step * abs(turn)
            if table.is_expanded[next_state] or (table.parents[next_state] != 0 and total >= table.cost[next_state]):
                continue
            # The feasibility of a step does not depend on the course before it.
            step_index = (cell * 8 + next_course) * width + next_layer - layer + max_descent
            if table.steps[step_index] == _UNKNOWN:
                is_free = (
                    _is_inside(data, end)
                    and penalised_leg_cost(data, limits, start, end, MAX_COST_RATIO * length) <= MAX_COST_RATIO * length
                )
                table.steps[step_index] = _FREE if is_free else _CLOSED
            if table.steps[step_index] == _FREE:
                table.cost[next_state], table.parents[next_state] = total, state + 1
                remaining_cost = _remaining_cost(lattice, table.heuristic, next_position, end[2])
                heapq.heappush(open_states, (total + remaining_cost, next_state))


class LatticeSearch(NamedTuple):
    """State of an A* search over a lattice, which is continued a number of expansions at a time.

    table: costs, parents and flags of all states.
    costs, states: (k,) priorities and states of the open list, in heap order.
    expanded_count: number of states expanded.
    goal_state: the goal's state once it is reached, or -1.
    """

    table: _StateTable
    costs: Floats
    states: Codes
    expanded_count: int
    goal_state: int


# Factor on the length of a step that is closed in every layer, in the distances of a guided search. A sloped step may
# be free there.
CLOSED_LENGTH_FACTOR = 100.0
# Factor on the estimate of a guided search: many routes climb or descend equally well, and one of them is enough.
GUIDED_WEIGHT = 1.5


@compiled
def _straight_distances(frame: RotatedFrame, lattice: Lattice) -> Floats:
    """Return the squared straight distance from each column of a lattice to the goal, m2.

    The shape is (along x across,).
    """
    squared_distances, point, goal = np.empty(lattice.along * lattice.across), np.empty(3), np.empty(3)
    _set_position(frame, lattice, lattice.goal, lattice.right, lattice.goal_layer, goal)
    for position in range(squared_distances.size):
        _set_position(frame, lattice, position // lattice.across, position % lattice.across, 0, point)
        squared_distances[position] = (point[0] - goal[0]) ** 2 + (point[1] - goal[1]) ** 2
    return squared_distances


@compiled
def _distances_around_obstacles(data: ProblemArrays, frame: RotatedFrame, lattice: Lattice) -> Floats:
    """Return the length of the shortest path around obstacles from each column to the goal, m.

    Dijkstra's algorithm (1959) over steps to the eight neighbours, on the map. The length of a step that is not free of
    violations in any layer is multiplied by `CLOSED_LENGTH_FACTOR`. Returns (along x across,): one length for each
    column.
    """
    limits = precompute_limits(data)
    distances, start, end = np.full(lattice.along * lattice.across, np.inf), np.empty(3), np.empty(3)
    goal = lattice.goal * lattice.across + lattice.right
    distances[goal], open_layer = 0.0, lattice.goal_layer
    open_columns = [(0.0, goal)]
    while len(open_columns) > 0:
        distance, position = heapq.heappop(open_columns)
        if distance > distances[position]:
            continue
        along, across = position // lattice.across, position % lattice.across
        for course in range(8):
            next_along, next_across = along + _STEPS[course, 0], across + _STEPS[course, 1]
            if not (0 <= next_along < lattice.along and 0 <= next_across < lattice.across):
                continue
            next_position = next_along * lattice.across + next_across
            length = lattice.step * math.hypot(_STEPS[course, 0], _STEPS[course, 1])
            if distance + length >= distances[next_position]:
                continue
            is_free = False
            for k in range(lattice.layers):
                # First the layer that was free for the previous step.
                layer = (open_layer + k) % lattice.layers
                _set_position(frame, lattice, next_along, next_across, layer, start)
                _set_position(frame, lattice, along, across, layer, end)
                max_cost = MAX_COST_RATIO * length
                if (
                    _is_inside(data, start)
                    and _is_inside(data, end)
                    and penalised_leg_cost(data, limits, start, end, max_cost) <= max_cost
                ):
                    is_free, open_layer = True, layer
                    break
            next_distance = distance + (length if is_free else CLOSED_LENGTH_FACTOR * length)
            if next_distance < distances[next_position]:
                distances[next_position] = next_distance
                heapq.heappush(open_columns, (next_distance, next_position))
    return distances


def begin_lattice_search(
    data: ProblemArrays, frame: RotatedFrame, lattice: Lattice, *, is_guided: bool = False
) -> LatticeSearch:
    """Make a search for a route from start to destination, before its first expansion.

    is_guided: True for an estimate of the remaining length that knows obstacles and slopes.
    """
    layer_limits = _climb_layers(data, frame, lattice)
    if is_guided:
        # The path is long enough to climb or descend.
        step_lengths = lattice.step * np.hypot(_STEPS[:, 0], _STEPS[:, 1])
        slopes = (layer_limits * lattice.layer_spacing / step_lengths[:, None]).max(axis=0)
        climb_length, descent_length = (1.0 / slope if slope > 0.0 else 0.0 for slope in slopes)
        distances = _distances_around_obstacles(data, frame, lattice)
        heuristic = Heuristic(distances**2, climb_length, descent_length, GUIDED_WEIGHT)
    else:
        heuristic = Heuristic(_straight_distances(frame, lattice), 0.0, 0.0, 1.0)
    state_count = lattice.along * lattice.across * lattice.layers * 8
    width = int(layer_limits.max(axis=0).sum()) + 1
    # Large arrays of zeros from NumPy take memory only where they are written to, mostly a small part.
    table = _StateTable(
        np.empty(state_count),
        np.zeros(state_count, dtype=np.int32),
        np.zeros(state_count, dtype=np.bool_),
        layer_limits,
        np.zeros(state_count * width, dtype=np.int8),
        heuristic,
    )
    states = _start_states(data, frame, lattice, table)
    return LatticeSearch(table, np.zeros(states.size), states, 0, -1)


@compiled
def _start_states(data: ProblemArrays, frame: RotatedFrame, lattice: Lattice, table: _StateTable) -> Codes:
    """Mark the states at the start as reached and return them, (k,).

    frame: frame of the direct line.
    lattice: points of the lattice; a state is a point, a layer and one of eight courses.
    table: costs and parents of all states, in which the states at the start get the cost 0.

    There is a state for the prescribed course, or one for each of the eight courses if none is prescribed.
    """
    first_state = ((lattice.behind * lattice.across + lattice.right) * lattice.layers + lattice.start_layer) * 8
    start_course = _nearest_course(frame, data.start_course)
    states = np.arange(first_state, first_state + 8) if start_course < 0 else np.array([first_state + start_course])
    for state in states:
        table.cost[state], table.parents[state] = 0.0, _FIRST
    return states


@compiled
def continue_lattice_search(
    data: ProblemArrays,
    frame: RotatedFrame,
    lattice: Lattice,
    max_turn: int,
    search: LatticeSearch,
    max_expansions: int,
) -> LatticeSearch:
    """Continue a search by up to `max_expansions` expansions; return its state.

    max_turn: largest turn per step, in units of 45 degrees.

    The search succeeds when the goal is reached on the prescribed course, which sets `goal_state`; it fails when the
    open list is empty.
    """
    limits, table, expanded_count = precompute_limits(data), search.table, search.expanded_count
    goal_cell = (lattice.goal * lattice.across + lattice.right) * lattice.layers + lattice.goal_layer
    goal_course = _nearest_course(frame, data.destination_course)
    # The open list is stored in heap order and needs no sorting.
    open_states = [(search.costs[k], search.states[k]) for k in range(search.states.size)]
    goal_state = -1
    while len(open_states) > 0 and expanded_count < search.expanded_count + max_expansions:
        _, state = heapq.heappop(open_states)
        if table.is_expanded[state]:
            continue
        table.is_expanded[state] = True
        expanded_count += 1
        if state // 8 == goal_cell and (goal_course < 0 or abs((state % 8 - goal_course + 4) % 8 - 4) <= max_turn):
            goal_state = state
            break
        _expand_state(data, limits, frame, lattice, table, state, max_turn, open_states)
    costs, states = np.empty(len(open_states)), np.empty(len(open_states), dtype=np.int64)
    for k in range(len(open_states)):
        costs[k], states[k] = open_states[k]
    return LatticeSearch(table, costs, states, expanded_count, goal_state)


@inner
def _nearest_course(frame: RotatedFrame, course: float) -> int:
    """Return the index of the lattice course nearest to a course (rad, clockwise from north); -1 for NaN."""
    if math.isnan(course):
        return -1
    angle = 0.5 * math.pi - course - math.atan2(frame.sine, frame.cosine)
    return round(angle / (0.25 * math.pi)) % 8


@inner
def _is_inside(data: ProblemArrays, point: Floats) -> bool:
    """Return True if a point (3,) is on the map and between floor and ceiling."""
    is_on_map: bool = data.west <= point[0] <= data.east and data.south <= point[1] <= data.north
    return is_on_map and data.floor <= point[2] <= data.ceiling


@compiled
def trace_route(parents: Numbers, goal_state: int, lattice: Lattice) -> Records:
    """Return `LATTICE_CELL` records of the route from the start to a given state.

    parents: parent of each state plus 1, as the search stores them; -1 for a state at the start.
    goal_state: number of the state at the end of the route.
    lattice: points of the lattice.
    """
    count, state = 0, goal_state
    while state >= 0:
        count, state = count + 1, parents[state] - 1
    cells = np.zeros(count, dtype=LATTICE_CELL)
    state = goal_state
    for k in range(count - 1, -1, -1):
        cell = state // 8
        position = cell // lattice.layers
        cells[k].layer = cell % lattice.layers
        cells[k].along = position // lattice.across - lattice.behind
        cells[k].across = position % lattice.across - lattice.right
        state = parents[state] - 1
    return cells


@compiled
def simplify_route(data: ProblemArrays, points: Floats) -> Floats:
    """Reduce a route (k, 3) to few points (j, 3), by a greedy choice of long legs.

    From each remaining point, the next leg leads to the last point of the route that it can reach without a violation.
    """
    limits = precompute_limits(data)
    out = np.empty(points.shape)
    copy_into(out[0], points[0])
    count, current_index, last_index = 1, 0, points.shape[0] - 1
    while current_index < last_index:
        next_index = current_index + 1
        for candidate_index in range(last_index, current_index + 1, -1):
            start, end = points[current_index], points[candidate_index]
            length = math.sqrt((end[0] - start[0]) ** 2 + (end[1] - start[1]) ** 2 + (end[2] - start[2]) ** 2)
            if penalised_leg_cost(data, limits, start, end, MAX_COST_RATIO * length) <= MAX_COST_RATIO * length:
                next_index = candidate_index
                break
        current_index = next_index
        copy_into(out[count], points[current_index])
        count += 1
    return out[:count]


# --- Lattices and routes ---

# Minimum step, m.
MIN_STEP_M = 100.0
# Upper limit on the step that two right-angled turns require, m.
MAX_STEP_M = 2000.0
# Layers that the gentler slope limit climbs or descends in a step along.
LAYERS_PER_STEP = 2
# Maximum number of states of a lattice.
MAX_LATTICE_STATES = 4_000_000
# Factor on the step of a lattice that has too many states, if the ends are closer together than a step.
SPACING_FACTOR = 1.1
# Maximum number of expanded states of all lattices of a search together.  In 600 scenarios, no finer lattice had a
# route if the first lattice had used up this number.
MAX_EXPANDED = 60_000
# The same for guided searches. In 2,000 scenarios, those that led to a safe path expanded at most 2,100 states.
MAX_GUIDED_EXPANDED = 20_000
# States expanded between two calls of `check_stop`: some 10 ms.
STATES_PER_CHECK = 2000


def turning_step(data: ProblemArrays) -> float:
    """Return the length that a leg needs between two right-angled turns to the same side, m.

    It includes the length for settling between the turns.
    """
    if not data.legs_hold_turns:
        return MIN_STEP_M
    side = MAX_STEP_M
    square = np.array([[0.0, 0.0], [side, 0.0], [side, side], [0.0, side]]) + data.start[:2]
    path = np.column_stack([square, np.full(4, data.start[2])])
    turns, rolls = turn_and_roll_lengths(data, path)
    turn_length = float(turns[1] + rolls[1])
    # Settling depends on the length of the leg, which is about a tenth longer than the turns.
    return min(MAX_STEP_M, max(MIN_STEP_M, turn_length + settling_length(turn_length, 1.1 * turn_length)))


def make_lattice(data: ProblemArrays, frame: RotatedFrame, step: float) -> Lattice:
    """Make a lattice over the whole map that has points at both ends of the path.

    step: maximum spacing of the points, m. It is increased if the lattice would otherwise have more than
        `MAX_LATTICE_STATES` states.

    If the ends are closer together than a step, the goal is the point a step from the start.
    """
    corners = [(east, north, 0.0) for east in (data.west, data.east) for north in (data.south, data.north)]
    min_corner, max_corner = frame.to_frame(corners)[:, :2].min(axis=0), frame.to_frame(corners)[:, :2].max(axis=0)
    level_point = np.array([*data.destination[:2], data.start[2]])
    # The lower of the climb and the descent limit on the direct course, but at least 0.01 rad.
    gentler_slope = math.tan(max(0.01, min(slope_limits(data, np.array(data.start), level_point))))
    min_altitude = max(data.floor, float(np.nanmin(data.heights)) + data.clearance)
    stages, spacing = max(1, math.ceil(frame.length / step)), frame.length
    # Enlarge the spacing until the lattice is small enough.
    while True:
        spacing = frame.length / stages if stages > 1 else max(frame.length, step)
        layer_spacing = gentler_slope * spacing / LAYERS_PER_STEP
        behind, right = math.floor(-min_corner[0] / spacing), math.floor(-min_corner[1] / spacing)
        along = behind + math.floor(max_corner[0] / spacing) + 1
        across = right + math.floor(max_corner[1] / spacing) + 1
        layers_below = max(0, math.floor((data.start[2] - min_altitude) / layer_spacing))
        layers = layers_below + max(0, math.floor((data.ceiling - data.start[2]) / layer_spacing)) + 1
        if along * across * layers * 8 <= MAX_LATTICE_STATES:
            break
        if stages > 1:
            stages -= 1
        else:
            step *= SPACING_FACTOR
    goal_layer = min(layers - 1, max(0, round((data.destination[2] - data.start[2]) / layer_spacing) + layers_below))
    first_altitude = data.start[2] - layers_below * layer_spacing
    return Lattice(
        spacing,
        behind,
        right,
        along,
        across,
        behind + stages,
        first_altitude,
        layer_spacing,
        layers,
        layers_below,
        goal_layer,
    )


def cheapest_lattice_route(
    data: ProblemArrays,
    frame: RotatedFrame,
    lattice: Lattice,
    max_turn: int,
    max_states: int,
    check_stop: Callable[[], None] = lambda: None,
    *,
    is_guided: bool = False,
) -> tuple[Records, int]:
    """Find the cheapest route over a lattice; return its `LATTICE_CELL` records and the work.

    max_turn: largest turn per step, in units of 45 degrees.
    max_states: maximum number of expanded states.
    check_stop: called after every `STATES_PER_CHECK` states; an exception raised there stops the search.
    is_guided: as in `begin_lattice_search`.

    The work is the number of expanded states. There are no records if no route is found within the maximum number. A
    guided search may find a route that is not the cheapest.
    """
    search = begin_lattice_search(data, frame, lattice, is_guided=is_guided)
    while search.goal_state < 0 and len(search.states) and search.expanded_count < max_states:
        search = continue_lattice_search(
            data, frame, lattice, max_turn, search, min(STATES_PER_CHECK, max_states - search.expanded_count)
        )
        check_stop()
    if search.goal_state < 0:
        return np.zeros(0, dtype=LATTICE_CELL), search.expanded_count
    return trace_route(search.table.parents, search.goal_state, lattice), search.expanded_count


def lattice_route(
    data: ProblemArrays,
    frame: RotatedFrame,
    step: float,
    check_stop: Callable[[], None] = lambda: None,
    max_states: int = MAX_EXPANDED,
    *,
    is_guided: bool = False,
) -> tuple[Floats, int]:
    """Find a route over a lattice; return its points, (k, 3) m, and the number of expanded states.

    step: spacing of the lattice, m.
    check_stop: called after every `STATES_PER_CHECK` states; an exception raised there stops the search.
    max_states: maximum number of expanded states.
    is_guided: as in `begin_lattice_search`.

    If there is no route, k is 0.
    """
    lattice = make_lattice(data, frame, step)
    # Turns of up to 90 degrees where the limits allow them; with eight courses 45 degrees is the minimum.
    max_turn = 2 if data.max_turn >= math.radians(90.0) else 1
    cells, expanded_count = cheapest_lattice_route(
        data, frame, lattice, max_turn, max_states, check_stop, is_guided=is_guided
    )
    if not len(cells):
        return np.empty((0, 3)), expanded_count
    positions = np.column_stack([cells["along"], cells["across"]]) * lattice.step
    heights = lattice.low + cells["layer"] * lattice.layer_spacing
    points = frame.to_world(np.column_stack([positions, heights]))
    points[0], points[-1] = data.start, data.destination
    return np.asarray(simplify_route(data, np.ascontiguousarray(points))), expanded_count


def ceiling_route(
    data: ProblemArrays, frame: RotatedFrame, step: float, depth: float, check_stop: Callable[[], None] = lambda: None
) -> Floats:
    """Find a route at the altitude of the ceiling; return its points, (k, 3) m; k is 0 if there is none.

    step: spacing of the lattice, m.
    depth: depth to which the route may enter the missiles' spheres, m.
    check_stop: called from time to time; an exception raised there stops the search.

    The spheres of missiles on the ground are narrowest at the ceiling. Only one layer is searched, which takes
    milliseconds. The climb to the ceiling at the start and the descent at the destination may therefore be too steep.
    """
    start, destination = (np.array([*end[:2], data.ceiling]) for end in (data.start, data.destination))
    for end in (start, destination):
        # Read-only like a scenario's ends: for a writable array the kernels would be compiled again.
        end.setflags(write=False)
    level_data = data._replace(start=start, destination=destination, floor=data.ceiling, kill_margin=-depth)
    return lattice_route(level_data, frame, step, check_stop)[0]
