"""Cost of a leg: its length, its time in the wind, or the energy of its flight.

A leg d that is flown at true airspeed V in the wind w takes the time T with |d - w T| = V T. This is the wind triangle
in three dimensions, whose larger part is horizontal (Zermelo's problem in a steady wind, "Über das Navigationsproblem
bei ruhender oder veränderlicher Windverteilung", Zeitschrift für Angewandte Mathematik und Mechanik 11, 1931). There is
no such time if the wind is faster than the aircraft and does not blow along the leg. Wind and airspeed change with
height, so a leg is integrated by Simpson's rule over its two ends and its middle.

In a uniform wind a straight line takes the least time, and T is a norm of d plus a term that is the same for all paths
to a destination. Only the direction of a detour then matters, by a factor of at most V / sqrt(V^2 - w^2).

In a forecast the wind also changes with place and time, so a detour may save time. The wind at a place is taken at the
time at which a straight flight to the destination has covered the distance between the start and that place.
"""

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import Envelope
from aircraft.path_limits import PerformanceTable, downwind_vector, true_airspeed, wind_speed_at
from world.arrays import Floats
from world.by_reference import by_reference
from world.kernels import compiled, inner
from world.scenario import Scenario

# The third coordinate.
UP_AXIS = 2
# Half-step of the finite difference in height, m.
HEIGHT_STEP_M = 2.0
# Half-step of the finite difference east and north in a forecast's wind, m.
HORIZONTAL_STEP_M = 25.0
# Numbers of places east, north and up at which the wind of a forecast is taken.
WIND_GRID_SHAPE = (33, 33, 17)
# Ground speed assumed on a leg that is not flyable, as a fraction of the airspeed, so that a search avoids it.
UNFLYABLE_SPEED_RATIO = 0.01
# Fractions of a leg for Simpson's rule.
_SIMPSON_FRACTIONS = (0.0, 0.5, 1.0)
# Weights of Simpson's rule.
_SIMPSON_WEIGHTS = (1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0)


class WindGrid(NamedTuple):
    """Wind at the places of a regular grid, each at the time at which a plan passes there.

    first: (3,) place of velocities[0, 0, 0], m.
    step: (3,) distances between neighbouring places east, north and up, m.
    velocities: (x, y, z, 2) east and north wind at each place, m/s; of size 0 without a forecast, when the performance
    table gives the wind.
    """

    first: Floats
    step: Floats
    velocities: NDArray[np.float64]


@by_reference
class TravelCost(NamedTuple):
    """Weights of length, time and energy in a path's cost, with the aircraft's power and the wind.

    length: cost per metre of path.
    time: cost per second.
    energy: cost per joule.
    level, linear, square: (h,) coefficients of the power (W) at the heights of the performance table and at its
        airspeed: level + linear x + square x^2, where x is the sine of the climb angle relative to the air.
    min_sine, max_sine: (h,) bounds of x, beyond which power is constant: idle and full throttle.
    winds: wind of a forecast.
    """

    length: float
    time: float
    energy: float
    level: Floats
    linear: Floats
    square: Floats
    min_sine: Floats
    max_sine: Floats
    winds: WindGrid


Objective = Literal["length", "time", "energy"]
_EMPTY_TABLE = np.zeros(0)
_EMPTY_TABLE.setflags(write=False)
_NO_VELOCITIES = np.zeros((0, 0, 0, 2))
_NO_VELOCITIES.setflags(write=False)
# No forecast: only the wind of the performance table.
NO_WINDS = WindGrid(_EMPTY_TABLE, _EMPTY_TABLE, _NO_VELOCITIES)
# Cost of a search for the shortest path.
LENGTH_COST = TravelCost(1.0, 0.0, 0.0, _EMPTY_TABLE, _EMPTY_TABLE, _EMPTY_TABLE, _EMPTY_TABLE, _EMPTY_TABLE, NO_WINDS)


def make_wind_grid(scenario: Scenario, table: PerformanceTable) -> WindGrid:
    """Sample the wind of a scenario's forecast on a grid over its map; `NO_WINDS` without a forecast.

    table: performance of the aircraft in the mean wind.

    The wind at each place is taken at the time at which a straight flight from the start has covered the distance to
    that place.
    """
    if scenario.wind.field is None:
        return NO_WINDS
    (west, east), (south, north) = scenario.bounds.tolist()
    axes = [
        np.linspace(low, max(high, low + 1.0), count)
        for low, high, count in zip(
            (west, south, float(scenario.floor)), (east, north, float(scenario.ceiling)), WIND_GRID_SHAPE, strict=True
        )
    ]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    ends = np.stack([scenario.start, scenario.destination])
    straight_m = path_cost(LENGTH_COST, table, ends)
    straight_s = path_cost(LENGTH_COST._replace(length=0.0, time=1.0), table, ends)
    ground_speed = straight_m / straight_s if 0.0 < straight_s < math.inf else table.airspeed
    distances = np.hypot(places[..., 0] - scenario.start[0], places[..., 1] - scenario.start[1])
    velocities = scenario.wind_velocities(places.reshape(-1, 3), distances.ravel() / ground_speed)
    first, step = np.array([axis[0] for axis in axes]), np.array([axis[1] - axis[0] for axis in axes])
    grid = WindGrid(first, step, velocities.reshape(*WIND_GRID_SHAPE, 2))
    for array in grid:
        array.setflags(write=False)
    return grid


def make_travel_cost(
    objective: Objective, envelope: Envelope, table: PerformanceTable, winds: WindGrid = NO_WINDS
) -> TravelCost | None:
    """Make the cost function of an objective, in equivalent metres.

    The cost is the path's length, or its time or energy divided by that of one metre of level flight in still air.
    Returns None for the objective energy if the aircraft's power is unknown.

    table: performance of the aircraft at the airspeed of the path.
    winds: wind of a forecast; without it, only the mean wind is used.

    >>> from planfly.workflow.uav import load_uav
    >>> from world.scenario import load_scenario
    >>> limits = load_uav(load_scenario("tight")).limits
    >>> make_travel_cost("time", limits.envelope, limits.performance()).time
    25.0
    """
    if objective == "length":
        return LENGTH_COST
    return make_time_cost(table, winds) if objective == "time" else make_energy_cost(envelope, table, winds)


def make_time_cost(table: PerformanceTable, winds: WindGrid = NO_WINDS) -> TravelCost:
    """Make the cost function of a path's time, in m of level flight in still air."""
    return LENGTH_COST._replace(length=0.0, time=float(table.airspeed), winds=winds)


def make_energy_cost(envelope: Envelope, table: PerformanceTable, winds: WindGrid = NO_WINDS) -> TravelCost | None:
    """Make the cost function of a path's energy, in m of level flight; None if the power is unknown.

    table: performance of the aircraft at the airspeed of the path.
    winds: wind of a forecast; without it, only the mean wind is used.

    The power follows `Envelope.power`: a parabola through idle at the steepest descent, level flight, and full
    throttle. At a height at which level flight is impossible, the power at the nearest height with level flight
    applies.
    """
    # Level, linear, square, min_sine and max_sine at each altitude, as in `TravelCost`; NaN if the power is unknown or
    # level flight is impossible.
    rows = np.full((len(table.amsl), 5), math.nan)
    for row, amsl in zip(rows, map(float, table.amsl), strict=True):
        airspeed = true_airspeed(table, amsl)
        climb, descent = envelope.air_angles(airspeed, amsl)
        min_sine, max_sine = -math.sin(descent), math.sin(climb)
        level = envelope.power(airspeed, amsl, 0.0)
        if min_sine < 0.0 < max_sine and math.isfinite(level):
            idle, full_throttle = (envelope.power(airspeed, amsl, angle) for angle in (-0.5 * math.pi, 0.5 * math.pi))
            idle_slope, full_throttle_slope = (idle - level) / min_sine, (full_throttle - level) / max_sine
            square = (full_throttle_slope - idle_slope) / (max_sine - min_sine)
            row[:] = level, full_throttle_slope - square * max_sine, square, min_sine, max_sine
    is_known = np.isfinite(rows).all(axis=1)
    if not is_known.any():
        return None
    columns = [np.interp(table.amsl, table.amsl[is_known], rows[is_known, k]) for k in range(5)]
    for column in columns:
        column.setflags(write=False)
    levels, linears, squares, min_sines, max_sines = columns
    return TravelCost(
        0.0, 0.0, float(table.airspeed / levels[0]), levels, linears, squares, min_sines, max_sines, winds
    )


class LegTime(NamedTuple):
    """Time of a leg with its derivatives, as `leg_time` computes them.

    seconds: time, s.
    by_east, by_north, by_up: change of the time with each component of the leg's vector, s/m.
    root: D of `leg_time`.
    is_flyable: True if the aircraft can hold the leg's course in the wind.
    """

    seconds: float
    by_east: float
    by_north: float
    by_up: float
    root: float
    is_flyable: bool


@inner
def leg_time(dx: float, dy: float, dz: float, wind_east: float, wind_north: float, airspeed: float) -> LegTime:
    """Return the time of a leg d in wind w: the smaller positive T with |d - w T| = V T.

    dx, dy, dz: vector d of the leg, m.
    wind_east, wind_north, airspeed: wind w and airspeed V, m/s.

    T solves |d|^2 - 2 T w.d - (V^2 - w^2) T^2 = 0: T = |d|^2 / (w.d + D), D^2 = (w.d)^2 + (V^2 - w^2) |d|^2. Its
    derivative with respect to d is (d - w T) / D.

    If the wind permits no such T, the leg is not flyable, and T is its time at `UNFLYABLE_SPEED_RATIO` of the airspeed.
    """
    length2 = max(1e-6, dx * dx + dy * dy + dz * dz)
    tailwind_product = wind_east * dx + wind_north * dy
    discriminant = (
        tailwind_product * tailwind_product
        + (airspeed * airspeed - wind_east * wind_east - wind_north * wind_north) * length2
    )
    root = math.sqrt(max(0.0, discriminant))
    if discriminant <= 0.0 or tailwind_product + root <= 1e-9 * length2:
        length, speed = math.sqrt(length2), UNFLYABLE_SPEED_RATIO * airspeed
        scale = 1.0 / (length * speed)
        return LegTime(length / speed, scale * dx, scale * dy, scale * dz, speed * length, False)
    seconds = length2 / (tailwind_product + root)
    return LegTime(
        seconds, (dx - wind_east * seconds) / root, (dy - wind_north * seconds) / root, dz / root, root, True
    )


class _FlightConditions(NamedTuple):
    """Airspeed (m/s), wind (m/s) and power coefficients at a place; see `TravelCost`."""

    airspeed: float
    wind_east: float
    wind_north: float
    level: float
    linear: float
    square: float
    min_sine: float
    max_sine: float


@inner
def _interpolate_wind(winds: WindGrid, x: float, y: float, z: float) -> tuple[float, float]:
    """Return the east and north wind at a place, m/s, interpolated between the places of a grid.

    winds: velocities at the places of a regular grid; the eight around the place are used.
    x, y, z: east, north and altitude of the place, m.

    Beyond the grid the wind at its edge applies.
    """
    velocities = winds.velocities
    place_x = min(velocities.shape[0] - 1.0, max(0.0, (x - winds.first[0]) / winds.step[0]))
    place_y = min(velocities.shape[1] - 1.0, max(0.0, (y - winds.first[1]) / winds.step[1]))
    place_z = min(velocities.shape[2] - 1.0, max(0.0, (z - winds.first[2]) / winds.step[2]))
    i = min(velocities.shape[0] - 2, int(place_x))
    j = min(velocities.shape[1] - 2, int(place_y))
    k = min(velocities.shape[2] - 2, int(place_z))
    east, north = 0.0, 0.0
    for corner in range(8):
        di, dj, dk = corner & 1, corner >> 1 & 1, corner >> 2
        weight = abs(1 - di - place_x + i) * abs(1 - dj - place_y + j) * abs(1 - dk - place_z + k)
        east += weight * velocities[i + di, j + dj, k + dk, 0]
        north += weight * velocities[i + di, j + dj, k + dk, 1]
    return east, north


@inner
def _conditions_at(travel: TravelCost, table: PerformanceTable, x: float, y: float, amsl: float) -> _FlightConditions:
    """Return the airspeed, the wind and the power coefficients at a place.

    travel: weights of the cost, with the wind of a forecast if there is one.
    table: performance of the aircraft, with the mean wind.
    x, y: east and north, m.
    amsl: altitude, m.

    Without a cost of energy the power coefficients are 0.
    """
    airspeed = true_airspeed(table, amsl)
    if travel.winds.velocities.size == 0:
        (wx, wy), wind_speed = downwind_vector(table), wind_speed_at(table, amsl)
        wind_east, wind_north = wind_speed * wx, wind_speed * wy
    else:
        wind_east, wind_north = _interpolate_wind(travel.winds, x, y, amsl)
    if travel.energy == 0.0:
        return _FlightConditions(airspeed, wind_east, wind_north, 0.0, 0.0, 0.0, -1.0, 1.0)
    # Interpolate the power coefficients between the altitudes of the table.
    count, row = table.amsl.size, 0
    while row + 2 < count and table.amsl[row + 1] <= amsl:
        row += 1
    fraction = 0.0
    if count > 1:
        fraction = min(1.0, max(0.0, (amsl - table.amsl[row]) / (table.amsl[row + 1] - table.amsl[row])))
    next_row = min(row + 1, count - 1)
    return _FlightConditions(
        airspeed,
        wind_east,
        wind_north,
        travel.level[row] + fraction * (travel.level[next_row] - travel.level[row]),
        travel.linear[row] + fraction * (travel.linear[next_row] - travel.linear[row]),
        travel.square[row] + fraction * (travel.square[next_row] - travel.square[row]),
        travel.min_sine[row] + fraction * (travel.min_sine[next_row] - travel.min_sine[row]),
        travel.max_sine[row] + fraction * (travel.max_sine[next_row] - travel.max_sine[row]),
    )


@inner
def _time_energy_cost(
    travel: TravelCost,
    table: PerformanceTable,
    leg: tuple[float, float, float],
    x: float,
    y: float,
    amsl: float,
) -> tuple[float, bool]:
    """Return the cost of a leg's time and energy, and True if the leg can be flown.

    travel: weights of time and energy in the cost.
    table: performance of the aircraft.
    leg: vector of the leg, m.
    x, y, amsl: east, north and altitude of the place whose wind is applied to the whole leg, m.
    """
    dx, dy, dz = leg
    conditions = _conditions_at(travel, table, x, y, amsl)
    time = leg_time(dx, dy, dz, conditions.wind_east, conditions.wind_north, conditions.airspeed)
    cost = travel.time * time.seconds
    if travel.energy != 0.0:
        sine = min(conditions.max_sine, max(conditions.min_sine, dz / (conditions.airspeed * time.seconds)))
        cost += (
            travel.energy * time.seconds * (conditions.level + sine * (conditions.linear + conditions.square * sine))
        )
    return cost, time.is_flyable


@inner
def leg_cost(
    travel: TravelCost, table: PerformanceTable, start: NDArray[np.float64], end: NDArray[np.float64]
) -> float:
    """Return the cost of a leg; inf if the leg cannot be flown.

    travel: weights of length, time and energy in the cost.
    table: performance of the aircraft.
    start, end: (3,) ends of the leg, m.

    Time and energy are integrated along the leg by Simpson's rule with three points.
    """
    dx, dy, dz = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    total = travel.length * math.sqrt(dx * dx + dy * dy + dz * dz)
    if travel.time == 0.0 and travel.energy == 0.0:
        return total
    for point in range(3):
        fraction = _SIMPSON_FRACTIONS[point]
        x, y, amsl = start[0] + fraction * dx, start[1] + fraction * dy, start[2] + fraction * dz
        timed_cost, is_flyable = _time_energy_cost(travel, table, (dx, dy, dz), x, y, amsl)
        if not is_flyable:
            return math.inf
        total += _SIMPSON_WEIGHTS[point] * timed_cost
    return total


@compiled
def path_cost(travel: TravelCost, table: PerformanceTable, path: Floats) -> float:
    """Return the cost of a path (w, 3), m: the sum over its legs; inf if a leg cannot be flown.

    >>> from planfly.workflow.uav import load_uav
    >>> from world.scenario import load_scenario
    >>> table = load_uav(load_scenario("tight")).limits.performance()
    >>> path_cost(LENGTH_COST, table, np.array([[0.0, 0.0, 9.0], [30.0, 0.0, 9.0], [30.0, 40.0, 9.0]]))
    70.0
    """
    total = 0.0
    for i in range(path.shape[0] - 1):
        total += leg_cost(travel, table, path[i], path[i + 1])
    return total


class LegModel(NamedTuple):
    """Derivatives of a leg's cost with respect to its two ends, as `model_leg` fills them.

    slopes: (2, 3) first derivatives: [0] with respect to the start (east, north, up), [1] with respect to the end.
    curvature: (2, 3, 2, 3) second derivatives: [i, j, k, l] with respect to axis j of end i and axis l of end k.
    """

    slopes: Floats
    curvature: Floats


@inner
def model_leg(travel: TravelCost, table: PerformanceTable, start: Floats, finish: Floats, model: LegModel) -> float:
    """Return the cost of a leg, and fill its first and second derivatives with respect to the leg's ends.

    travel, table: weights of length, time and energy in the cost, and performance of the aircraft.
    start, finish: (3,) ends of the leg, m.
    model: the derivatives to fill.

    The cost is finite even if the leg cannot be flown. Its second derivative has three parts: length, time at each
    height, and power. All are convex, and the coupling of height and course is omitted, so the matrix has no negative
    eigenvalue. Time and energy are integrated along the leg by Simpson's rule with three points.
    """
    slopes, curvature = model.slopes, model.curvature
    slopes[:], curvature[:] = 0.0, 0.0
    dx, dy, dz = finish[0] - start[0], finish[1] - start[1], finish[2] - start[2]
    length = max(1e-3, math.sqrt(dx * dx + dy * dy + dz * dz))
    step = (dx, dy, dz)
    step_curvature = np.empty((3, 3))
    _add_step_model(
        curvature,
        slopes,
        _fill_length_hessian(step_curvature, step, length),
        travel.length,
        step,
        travel.length / length,
    )
    total = travel.length * length
    if travel.time == 0.0 and travel.energy == 0.0:
        return total
    for point in range(3):
        fraction, weight = _SIMPSON_FRACTIONS[point], _SIMPSON_WEIGHTS[point]
        x, y, amsl = start[0] + fraction * dx, start[1] + fraction * dy, start[2] + fraction * dz
        conditions = _conditions_at(travel, table, x, y, amsl)
        time = leg_time(dx, dy, dz, conditions.wind_east, conditions.wind_north, conditions.airspeed)
        # The cost is time x rate, plus a cost per metre of climb.
        rate = travel.time
        climb_cost = 0.0
        power_curvature = 0.0
        timed_cost = travel.time * time.seconds
        if travel.energy != 0.0:
            sine = dz / (conditions.airspeed * time.seconds)
            is_interior = conditions.min_sine < sine < conditions.max_sine
            sine = min(conditions.max_sine, max(conditions.min_sine, sine))
            power = conditions.level + sine * (conditions.linear + conditions.square * sine)
            timed_cost += travel.energy * power * time.seconds
            slope = conditions.linear + 2.0 * conditions.square * sine if is_interior else 0.0
            rate += travel.energy * (power - slope * sine)
            climb_cost = travel.energy * slope / conditions.airspeed
            if is_interior:
                power_curvature = max(
                    0.0, travel.energy * 2.0 * conditions.square / (conditions.airspeed**2 * time.seconds)
                )
        total += weight * timed_cost
        gradient = (time.by_east, time.by_north, time.by_up)
        _fill_time_curvature(step_curvature, time, conditions)
        step_curvature[UP_AXIS, UP_AXIS] += power_curvature / max(1e-9, rate)
        _add_step_model(curvature, slopes, step_curvature, weight * rate, gradient, weight * rate)
        slopes[0, UP_AXIS] -= weight * climb_cost
        slopes[1, UP_AXIS] += weight * climb_cost
        _add_place_model(travel, table, start, step, fraction, weight, timed_cost, model)
    return total


@inner
def _add_place_model(
    travel: TravelCost,
    table: PerformanceTable,
    start: Floats,
    step: tuple[float, float, float],
    fraction: float,
    weight: float,
    timed_cost: float,
    model: LegModel,
) -> None:
    """Add the derivatives of a leg's cost that result from moving the place of its wind and power.

    start: (3,) start of the leg, m.
    step: vector of the leg, m.
    fraction: fraction of the leg at which the place lies.
    weight: weight of the place in the cost of the leg.
    timed_cost: cost of time and energy of the leg in the wind of the place.
    model: derivatives of the leg's cost with respect to both ends; updated.

    A place at fraction f moves by 1 - f times the movement of the start, and by f times the movement of the end. The
    derivatives with respect to the place are central differences over `HORIZONTAL_STEP_M` and `HEIGHT_STEP_M`.
    """
    x, y, amsl = start[0] + fraction * step[0], start[1] + fraction * step[1], start[2] + fraction * step[2]
    # A forecast changes wind on each axis, the mean profile only with altitude.
    for axis in range(UP_AXIS if travel.winds.velocities.size == 0 else 0, 3):
        shift = HEIGHT_STEP_M if axis == UP_AXIS else HORIZONTAL_STEP_M
        east_step, north_step, up_step = shift * (axis == 0), shift * (axis == 1), shift * (axis == UP_AXIS)
        cost_above, _ = _time_energy_cost(travel, table, step, x + east_step, y + north_step, amsl + up_step)
        cost_below, _ = _time_energy_cost(travel, table, step, x - east_step, y - north_step, amsl - up_step)
        slope = weight * (cost_above - cost_below) / (2.0 * shift)
        curvature = weight * max(0.0, cost_above - 2.0 * timed_cost + cost_below) / shift**2
        end_weights = (1.0 - fraction, fraction)
        for end in range(2):
            model.slopes[end, axis] += end_weights[end] * slope
            for other_end in range(2):
                model.curvature[end, axis, other_end, axis] += curvature * end_weights[end] * end_weights[other_end]


@inner
def _fill_length_hessian(hessian: Floats, displacement: tuple[float, float, float], length: float) -> Floats:
    """Fill and return the second derivatives (3, 3) of a leg's length with respect to its vector.

    hessian: (3, 3) array to fill.
    displacement: vector of the leg: east, north and up, m.
    length: its length, m.
    """
    for axis in range(3):
        for other_axis in range(3):
            identity = 1.0 if axis == other_axis else 0.0
            outer = displacement[axis] * displacement[other_axis]
            hessian[axis, other_axis] = (identity - outer / (length * length)) / length
    return hessian


@inner
def _fill_time_curvature(curvature: Floats, time: LegTime, conditions: _FlightConditions) -> None:
    """Fill the second derivatives (3, 3) of a leg's time with respect to the leg's vector.

    They are (1 - w g' - g w' - (V^2 - w^2) g g') / D. Here g is the gradient of the time, w is the wind, V is the
    airspeed, and D is as in `leg_time`. For a leg that is not flyable they are 1 / D on the diagonal, and 0 elsewhere.
    """
    wind = (conditions.wind_east, conditions.wind_north, 0.0)
    gradient = (time.by_east, time.by_north, time.by_up)
    speed2_difference = conditions.airspeed**2 - conditions.wind_east**2 - conditions.wind_north**2
    for axis in range(3):
        for other_axis in range(3):
            element = 1.0 if axis == other_axis else 0.0
            if time.is_flyable:
                element -= wind[axis] * gradient[other_axis] + gradient[axis] * wind[other_axis]
                element -= speed2_difference * gradient[axis] * gradient[other_axis]
            curvature[axis, other_axis] = element / time.root


@inner
def _add_step_model(
    curvature: Floats,
    slopes: Floats,
    step_curvature: Floats,
    factor: float,
    gradient: tuple[float, float, float],
    slope_factor: float,
) -> None:
    """Add derivatives with respect to a leg's vector to the derivatives with respect to its ends.

    curvature: (2, 3, 2, 3) second derivatives of the leg's cost by its ends; updated.
    slopes: (2, 3) derivatives of the leg's cost by its ends; updated.
    step_curvature: (3, 3) second derivatives with respect to the vector.
    factor: factor on `step_curvature`.
    gradient: derivatives with respect to the vector.
    slope_factor: factor on `gradient`.

    The vector is the end minus the start, so the gradient with respect to the start has the opposite sign.
    """
    for axis in range(3):
        slopes[0, axis] -= slope_factor * gradient[axis]
        slopes[1, axis] += slope_factor * gradient[axis]
        for other_axis in range(3):
            value = factor * step_curvature[axis, other_axis]
            for end in range(2):
                curvature[end, axis, end, other_axis] += value
                curvature[end, axis, 1 - end, other_axis] -= value
