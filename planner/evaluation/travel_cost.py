"""Cost of a leg: its length, its time in the mean wind, or the energy of its flight.

A leg d that is flown at true airspeed V in the wind w takes the time T with |d - w T| = V T. This is the wind triangle
in three dimensions, whose larger part is horizontal (Zermelo's problem in a steady wind, "Über das Navigationsproblem
bei ruhender oder veränderlicher Windverteilung", Zeitschrift für Angewandte Mathematik und Mechanik 11, 1931). There is
no such time if the wind is faster than the aircraft and does not blow along the leg. Wind and airspeed change with
height, so a leg is integrated by Simpson's rule over its two ends and its middle.

In a uniform wind a straight line takes the least time, and T is a norm of d plus a term that is the same for all paths
to a destination. Then only the direction of a detour matters, by at most V / sqrt(V^2 - w^2).
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

# The third coordinate.
UP_AXIS = 2
# Half-step of the finite difference in height, m.
HEIGHT_STEP_M = 2.0
# Ground speed assumed on a leg that is not flyable, as a fraction of the airspeed, so that a search avoids it.
UNFLYABLE_SPEED_RATIO = 0.01
# Fractions of a leg for Simpson's rule.
_SIMPSON_FRACTIONS = (0.0, 0.5, 1.0)
# Weights of Simpson's rule.
_SIMPSON_WEIGHTS = (1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0)


@by_reference
class TravelCost(NamedTuple):
    """Weights of length, time and energy in a path's cost, and the power at each height.

    length: cost per metre of path.
    time: cost per second.
    energy: cost per joule.
    level, linear, square: (h,) coefficients of the power (W) at the heights of the performance table and at its
        airspeed: level + linear x + square x^2, where x is the sine of the climb angle to the air.
    min_sine, max_sine: (h,) bounds of x, beyond which power is constant: idle and full throttle.
    """

    length: float
    time: float
    energy: float
    level: Floats
    linear: Floats
    square: Floats
    min_sine: Floats
    max_sine: Floats


Objective = Literal["length", "time", "energy"]
_EMPTY_TABLE = np.zeros(0)
_EMPTY_TABLE.setflags(write=False)
# Cost of a search for the shortest path.
LENGTH_COST = TravelCost(1.0, 0.0, 0.0, _EMPTY_TABLE, _EMPTY_TABLE, _EMPTY_TABLE, _EMPTY_TABLE, _EMPTY_TABLE)


def make_travel_cost(objective: Objective, envelope: Envelope, table: PerformanceTable) -> TravelCost | None:
    """Make the cost function of an objective, in equivalent metres.

    The cost is the path's length, or its time or energy divided by the time or energy of a metre of level flight.
    Returns None for energy if the aircraft's power is unknown.

    >>> from planfly.workflow.airframe import load_airframe
    >>> from world.scenario import load_scenario
    >>> limits = load_airframe(load_scenario("tight")).limits
    >>> make_travel_cost("time", limits.envelope, limits.performance()).time
    25.0
    """
    if objective == "length":
        return LENGTH_COST
    return make_time_cost(table) if objective == "time" else make_energy_cost(envelope, table)


def make_time_cost(table: PerformanceTable) -> TravelCost:
    """Return the cost of a path's time, in m of level flight in still air."""
    return LENGTH_COST._replace(length=0.0, time=float(table.airspeed))


def make_energy_cost(envelope: Envelope, table: PerformanceTable) -> TravelCost | None:
    """Return the cost of a path's energy, in m of level flight in still air; None if power is unknown.

    Power is as in `Envelope.power`: the parabola through idle at the steepest descent, level flight and full throttle.
    At heights without level flight, it is the power at the nearest height with level flight.
    """
    rows = np.array([_power_parabola(envelope, true_airspeed(table, float(amsl)), float(amsl)) for amsl in table.amsl])
    is_known = np.isfinite(rows).all(axis=1)
    if not is_known.any():
        return None
    columns = [np.interp(table.amsl, table.amsl[is_known], rows[is_known, k]) for k in range(5)]
    for column in columns:
        column.setflags(write=False)
    return TravelCost(0.0, 0.0, float(table.airspeed / columns[0][0]), *columns)


def _power_parabola(envelope: Envelope, airspeed: float, amsl: float) -> tuple[float, float, float, float, float]:
    """Return the parabola of power over the sine of the climb angle, and the bounds of this sine.

    The result is level, linear, square, min_sine and max_sine of `TravelCost`. All are NaN if power is unknown.
    """
    climb, descent = envelope.air_angles(airspeed, amsl)
    min_sine, max_sine = -math.sin(descent), math.sin(climb)
    level = envelope.power(airspeed, amsl, 0.0)
    if not (min_sine < 0.0 < max_sine and math.isfinite(level)):
        return (math.nan,) * 5
    idle, full_throttle = envelope.power(airspeed, amsl, -0.5 * math.pi), envelope.power(airspeed, amsl, 0.5 * math.pi)
    idle_slope, full_throttle_slope = (idle - level) / min_sine, (full_throttle - level) / max_sine
    square = (full_throttle_slope - idle_slope) / (max_sine - min_sine)
    return level, full_throttle_slope - square * max_sine, square, min_sine, max_sine


class LegTime(NamedTuple):
    """Time of a leg (s), its derivatives with respect to the leg (s/m), and D of `leg_time`.

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
    """Return the time of a leg in wind: the smaller positive T with |d - w T| = V T.

    dx, dy, dz: the leg d, m.
    wind_east, wind_north, airspeed: wind w and airspeed V, m/s.

    T solves |d|^2 - 2 T w.d - (V^2 - w^2) T^2 = 0: T = |d|^2 / (w.d + D), D^2 = (w.d)^2 + (V^2 - w^2) |d|^2. Its
    derivative with respect to d is (d - w T) / D.
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
    """Airspeed (m/s) and power coefficients at a height; see `TravelCost`."""

    airspeed: float
    wind: float
    level: float
    linear: float
    square: float
    min_sine: float
    max_sine: float


@inner
def _conditions_at_altitude(travel: TravelCost, table: PerformanceTable, amsl: float) -> _FlightConditions:
    """Return the airspeed, the wind speed and the power coefficients at an altitude, m AMSL."""
    airspeed, wind = true_airspeed(table, amsl), wind_speed_at(table, amsl)
    if travel.energy == 0.0:
        return _FlightConditions(airspeed, wind, 0.0, 0.0, 0.0, -1.0, 1.0)
    count, row = table.amsl.size, 0
    while row + 2 < count and table.amsl[row + 1] <= amsl:
        row += 1
    fraction = 0.0
    if count > 1:
        fraction = min(1.0, max(0.0, (amsl - table.amsl[row]) / (table.amsl[row + 1] - table.amsl[row])))
    next_row = min(row + 1, count - 1)
    return _FlightConditions(
        airspeed,
        wind,
        travel.level[row] + fraction * (travel.level[next_row] - travel.level[row]),
        travel.linear[row] + fraction * (travel.linear[next_row] - travel.linear[row]),
        travel.square[row] + fraction * (travel.square[next_row] - travel.square[row]),
        travel.min_sine[row] + fraction * (travel.min_sine[next_row] - travel.min_sine[row]),
        travel.max_sine[row] + fraction * (travel.max_sine[next_row] - travel.max_sine[row]),
    )


@inner
def _time_energy_cost(
    travel: TravelCost, table: PerformanceTable, dx: float, dy: float, dz: float, amsl: float
) -> tuple[float, bool]:
    """Return the cost of time and energy of a leg at one altitude, and True if the leg is flyable."""
    conditions, (wx, wy) = _conditions_at_altitude(travel, table, amsl), downwind_vector(table)
    time = leg_time(dx, dy, dz, conditions.wind * wx, conditions.wind * wy, conditions.airspeed)
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
    """Return the cost of a leg; inf if it is not flyable."""
    dx, dy, dz = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    total = travel.length * math.sqrt(dx * dx + dy * dy + dz * dz)
    if travel.time == 0.0 and travel.energy == 0.0:
        return total
    for point in range(3):
        timed_cost, is_flyable = _time_energy_cost(travel, table, dx, dy, dz, start[2] + _SIMPSON_FRACTIONS[point] * dz)
        if not is_flyable:
            return math.inf
        total += _SIMPSON_WEIGHTS[point] * timed_cost
    return total


@compiled
def path_cost(travel: TravelCost, table: PerformanceTable, path: Floats) -> float:
    """Return the cost of a path (w, 3) world m, the sum over its legs; inf if a leg is not flyable.

    >>> from planfly.workflow.airframe import load_airframe
    >>> from world.scenario import load_scenario
    >>> table = load_airframe(load_scenario("tight")).limits.performance()
    >>> path_cost(LENGTH_COST, table, np.array([[0.0, 0.0, 9.0], [30.0, 0.0, 9.0], [30.0, 40.0, 9.0]]))
    70.0
    """
    total = 0.0
    for i in range(path.shape[0] - 1):
        total += leg_cost(travel, table, path[i], path[i + 1])
    return total


class LegModel(NamedTuple):
    """Scratch of `model_leg`: derivatives (2, 3) and curvature (2, 3, 2, 3) of a leg's cost by its ends."""

    slopes: Floats
    curvature: Floats


@inner
def model_leg(travel: TravelCost, table: PerformanceTable, start: Floats, finish: Floats, model: LegModel) -> float:
    """Return the cost of a leg, finite for any leg; fill its derivatives and curvature by the leg's ends.

    The curvature is the sum of the curvatures of the length, of the time at each height, and of the power, all convex;
    the coupling of height and course is omitted, so that the matrix has no negative eigenvalue.
    """
    slopes, curvature = model.slopes, model.curvature
    slopes[:], curvature[:] = 0.0, 0.0
    dx, dy, dz = finish[0] - start[0], finish[1] - start[1], finish[2] - start[2]
    length = max(1e-3, math.sqrt(dx * dx + dy * dy + dz * dz))
    (wx, wy), step = downwind_vector(table), (dx, dy, dz)
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
        amsl = start[2] + fraction * dz
        conditions = _conditions_at_altitude(travel, table, amsl)
        time = leg_time(dx, dy, dz, conditions.wind * wx, conditions.wind * wy, conditions.airspeed)
        # The cost is time x rate, plus a cost per metre of climb.
        rate, climb_cost, power_curvature, timed_cost = travel.time, 0.0, 0.0, travel.time * time.seconds
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
        _fill_time_curvature(step_curvature, time, conditions, wx, wy)
        step_curvature[UP_AXIS, UP_AXIS] += power_curvature / max(1e-9, rate)
        _add_step_model(curvature, slopes, step_curvature, weight * rate, gradient, weight * rate)
        slopes[0, UP_AXIS] -= weight * climb_cost
        slopes[1, UP_AXIS] += weight * climb_cost
        cost_above, _ = _time_energy_cost(travel, table, dx, dy, dz, amsl + HEIGHT_STEP_M)
        cost_below, _ = _time_energy_cost(travel, table, dx, dy, dz, amsl - HEIGHT_STEP_M)
        height_slope = weight * (cost_above - cost_below) / (2.0 * HEIGHT_STEP_M)
        height_curvature = weight * max(0.0, cost_above - 2.0 * timed_cost + cost_below) / HEIGHT_STEP_M**2
        end_weights = (1.0 - fraction, fraction)
        for end in range(2):
            slopes[end, UP_AXIS] += end_weights[end] * height_slope
            for other_end in range(2):
                curvature[end, UP_AXIS, other_end, UP_AXIS] += (
                    height_curvature * end_weights[end] * end_weights[other_end]
                )
    return total


@inner
def _fill_length_hessian(hessian: Floats, displacement: tuple[float, float, float], length: float) -> Floats:
    """Fill in the Hessian (3, 3) of a leg's length with respect to its displacement (east, north, up)."""
    for axis in range(3):
        for other_axis in range(3):
            identity = 1.0 if axis == other_axis else 0.0
            outer = displacement[axis] * displacement[other_axis]
            hessian[axis, other_axis] = (identity - outer / (length * length)) / length
    return hessian


@inner
def _fill_time_curvature(curvature: Floats, time: LegTime, conditions: _FlightConditions, wx: float, wy: float) -> None:
    """Fill the curvature (3, 3) of a leg's time: (1 - w g' - g w' - (V^2 - w^2) g g') / D.

    Here g is the gradient of the time, w the wind, V the airspeed and D as in `leg_time`.
    """
    wind = (conditions.wind * wx, conditions.wind * wy, 0.0)
    gradient = (time.by_east, time.by_north, time.by_up)
    speed2_difference = conditions.airspeed**2 - conditions.wind**2
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
    """Add a leg's curvature and gradient, given with respect to its step, to the arrays for its two ends.

    The step is the end minus the start, so the gradient with respect to the start has the opposite sign.
    """
    for axis in range(3):
        slopes[0, axis] -= slope_factor * gradient[axis]
        slopes[1, axis] += slope_factor * gradient[axis]
        for other_axis in range(3):
            value = factor * step_curvature[axis, other_axis]
            for end in range(2):
                curvature[end, axis, end, other_axis] += value
                curvature[end, axis, 1 - end, other_axis] -= value
