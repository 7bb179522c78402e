"""Compute the limits of a path: the tighter of the scenario's limits and the aircraft's envelope.

The limits are turn radii, turn lengths and slopes over the ground in wind. The planner's candidates, certificates and
missions all use these compiled functions.
"""

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from aircraft.envelope import GRAVITY, Envelope, ground_slope, ground_speed
from aircraft.tracking import TrackingError, air_density_factor, density_factor
from world.arrays import Floats
from world.by_reference import by_reference
from world.geometry import leg_courses, leg_slopes, wrap
from world.kernels import compiled, compiled_inline, inlined
from world.wind import W20, Wind, mean_wind_speed

# Time to roll from a turn into an opposite turn, s per rad by which the bank change exceeds the bank limit. The roll
# from level flight to the bank limit takes no extra time, because every turn includes it. Measured on the shortest
# S-turn legs that are flown within tolerance (`benchmarks.limits`).
ROLL_TIME = 0.8
# Vertical acceleration in the blend between two slopes, m/s^2.
BLEND_ACCELERATION = 1.0


@by_reference
class PerformanceTable(NamedTuple):
    """Performance of an aircraft at one airspeed, bank limit and wind, for compiled functions.

    airspeed: m/s.
    tan_max_bank: tangent of the bank limit.
    wind_speed: mean wind speed (m/s) at the altitude `wind_reference_amsl` (m).
    wind_to: direction towards which the wind blows, rad clockwise from north.
    wind_gradient: increase of the mean wind speed per meter of altitude, 1/s.
    gust_sigma: standard deviation of the gusts, m/s.
    amsl: increasing altitudes of the two tables, m, (h,).
    climb, descent: steepest angles relative to the air, rad, (h,), positive in the direction of their name.
    equivalent: 1 if `airspeed` is an equivalent airspeed, so that slopes apply to the true airspeed at each altitude; 0
        if it is a true airspeed.
    """

    airspeed: float
    tan_max_bank: float
    wind_speed: float
    wind_to: float
    wind_gradient: float
    wind_reference_amsl: float
    gust_sigma: float
    amsl: Floats
    climb: Floats
    descent: Floats
    equivalent: float = 0.0


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits on turns, slopes and clearance.

    max_turn, max_climb, max_dive: limits of the scenario, rad; None if only the aircraft's limits apply.
    min_clearance: required height above ground, m.
    envelope: performance of the aircraft in still air.
    airspeed: cruise airspeed, m/s.
    max_bank: bank limit, rad: the smaller of the scenario's and the aircraft's limit.
    wind: wind over the whole area.
    tracking: tracking error of the autopilot; None if it follows its path exactly.
    reserve_height: height above ground reserved for downdrafts in addition to the clearance, m.
    reserve_threats: distance reserved around missiles' spheres, in all directions, and above and below zones, m.
    reserve_climb: climb rate that legs leave unused for downdrafts, m/s.
    reserve_above: height kept free for updrafts below the scenario's maximum height above ground, m.
    reserve_sink: sink rate that legs leave unused for updrafts, m/s.
    """

    max_turn: float | None
    max_climb: float | None
    max_dive: float | None
    min_clearance: float
    envelope: Envelope
    airspeed: float
    max_bank: float
    wind: Wind
    tracking: TrackingError | None = None
    reserve_height: float = 0.0
    reserve_threats: float = 0.0
    reserve_climb: float = 0.0
    reserve_above: float = 0.0
    reserve_sink: float = 0.0
    # Each table is made once, because a route uses the same few speeds many times.
    _tables: dict[float | None, PerformanceTable] = field(init=False, repr=False, compare=False, default_factory=dict)

    def slopes(self, course: float, amsl: float, airspeed: float | None = None) -> tuple[float, float]:
        """Return the steepest climb and dive over the ground (rad) on a course (rad) at an altitude (m AMSL).

        airspeed: m/s; None for the airspeed of the limits.

        Both slopes are positive, and 0 if the aircraft cannot make progress along the course.
        """
        climb, dive = aircraft_slopes(self.performance(airspeed), course, amsl)
        return float(climb), float(dive)

    def with_margin(self) -> "Limits":
        """Return the limits with the envelope reduced by a margin for its uncertainty.

        The envelope is reduced by `Envelope.with_margin`.
        """
        return replace(self, envelope=self.envelope.with_margin())

    def turn_radius(self, course_in: float, course_out: float, amsl: float, airspeed: float | None = None) -> float:
        """Return the radius (m) of the arc at `max_bank` between two courses.

        course_in, course_out: rad.
        amsl: altitude, m.
        airspeed: m/s; None for the airspeed of the limits.

        The radius is computed for the highest ground speed on the arc.
        """
        return float(turn_radius_between(self.performance(airspeed), course_in, course_out, amsl))

    def max_climb_and_sink_rates(self, amsl: float) -> tuple[float, float]:
        """Return the maximum climb and sink rates (m/s) in still air at an altitude (m AMSL) and `airspeed`."""
        table = self.performance()
        speed = float(true_airspeed(table, amsl))
        climb, sink = (speed * math.sin(np.interp(amsl, table.amsl, angles)) for angles in (table.climb, table.descent))
        return climb, sink

    def leg_climb_rates(self, waypoints: Floats) -> Floats:
        """Return the climb rate of each leg at its start and at its end, m/s, (legs, 2).

        waypoints: m, (w, 3).

        The rate is negative in a descent, and NaN if the aircraft cannot hold the leg in the wind.
        """
        legs, table = zip(leg_courses(waypoints), leg_slopes(waypoints), strict=True), self.performance()
        return np.array(
            [
                [
                    ground_speed_on(table, float(course), float(amsl)) * math.tan(slope)
                    for amsl in waypoints[k : k + 2, 2]
                ]
                for k, (course, slope) in enumerate(legs)
            ]
        )

    def performance(self, airspeed: float | None = None) -> PerformanceTable:
        """Return the performance at a true airspeed (m/s), for compiled functions.

        airspeed: true airspeed; None for the airspeed of the limits. An autopilot with a tracking error holds the
            airspeed of the limits as an equivalent airspeed. Its true airspeed then increases with altitude, where the
            aircraft climbs less.

        Climb and descent are NaN where `Envelope.air_angles` is NaN.
        """
        if airspeed not in self._tables:
            self._tables[airspeed] = self._make_table(airspeed)
        return self._tables[airspeed]

    def _make_table(self, airspeed: float | None) -> PerformanceTable:
        """Make the performance table for a true airspeed, or for the airspeed of the limits if it is None."""
        cruise_airspeed = self.airspeed if airspeed is None else airspeed
        altitudes = self.envelope.amsl
        wind = self.wind
        is_equivalent = airspeed is None and self.tracking is not None
        speed_factors = [air_density_factor(float(amsl)) if is_equivalent else 1.0 for amsl in altitudes]
        angles = np.array(
            [
                self.envelope.air_angles(cruise_airspeed * factor, float(amsl))
                for factor, amsl in zip(speed_factors, altitudes, strict=True)
            ]
        )
        return PerformanceTable(
            airspeed=float(cruise_airspeed),
            tan_max_bank=math.tan(self.max_bank),
            wind_speed=float(wind.speed),
            wind_to=wind.to_course,
            wind_gradient=float(wind.gradient),
            wind_reference_amsl=float(wind.reference_amsl),
            # sigma_w of MIL-F-8785C, which sigma_u equals at 300 m.
            gust_sigma=0.1 * W20[wind.turbulence],
            amsl=altitudes,
            climb=_read_only(angles[:, 0]),
            descent=_read_only(angles[:, 1]),
            equivalent=float(is_equivalent),
        )


def derate(
    table: PerformanceTable,
    climb_fraction: float,
    sink_fraction: float,
    unused_climb: float = 0.0,
    unused_sink: float = 0.0,
) -> PerformanceTable:
    """Return the performance with reduced climb and descent angles.

    climb_fraction, sink_fraction: fractions (0..1) of the climb and descent angles that may be used.
    unused_climb, unused_sink: climb and sink rates to be left unused, m/s.

    The fraction and the unused rate give two reduced angles, of which the smaller applies. A negative climb, which is a
    loss of altitude, is unchanged. An angle does not become negative if the unused rate exceeds the aircraft's rate.

    >>> nothing = np.zeros(2)
    >>> table = PerformanceTable(25.0, 0.58, 0.0, 0.0, 0.0, 0.0, 0.0, nothing, np.array([0.2, -0.1]), nothing)
    >>> derate(table, 0.5, 1.0).climb.tolist(), derate(table, 0.9, 0.9, unused_climb=3.0).climb.round(3).tolist()
    ([0.1, -0.1], [0.079, -0.1])
    """
    airspeeds = np.array([true_airspeed(table, float(amsl)) for amsl in table.amsl])

    def reduce_angles(angles: Floats, fraction: float, unused_rate: float) -> Floats:
        """Reduce the steepest climb or descent angles, rad, (h,); negative angles are unchanged.

        fraction: fraction (0 to 1) of the angle that may be used.
        unused_rate: vertical speed that stays in reserve, m/s; 0 for none.
        """
        reduced = np.where(angles > 0.0, fraction * angles, angles)
        if unused_rate <= 0.0:
            return _read_only(reduced)
        max_angles = np.arcsin(np.maximum(0.0, np.sin(angles) - unused_rate / airspeeds))
        return _read_only(np.where(reduced > 0.0, np.minimum(reduced, max_angles), reduced))

    climb = reduce_angles(table.climb, climb_fraction, unused_climb)
    descent = reduce_angles(table.descent, sink_fraction, unused_sink)
    return table._replace(climb=climb, descent=descent)


def limit_rates(table: PerformanceTable, climb_rate: float, sink_rate: float) -> PerformanceTable:
    """Reduce path angles so that maximum climb and sink rates (m/s) are kept.

    A rate of inf is no limit.

    >>> table = PerformanceTable(25.0, 0.58, 0.0, 0.0, 0.0, 0.0, 0.0, *(np.full(2, 0.3) for _ in range(3)))
    >>> slower = limit_rates(table, 5.0, math.inf)
    >>> slower.climb.round(3).tolist(), slower.descent.tolist()
    ([0.201, 0.201], [0.3, 0.3])
    """
    airspeeds = np.array([true_airspeed(table, float(amsl)) for amsl in table.amsl])
    climb_limit, descent_limit = [np.arcsin(np.minimum(1.0, rate / airspeeds)) for rate in (climb_rate, sink_rate)]
    climb = _read_only(np.minimum(table.climb, climb_limit))
    descent = _read_only(np.minimum(table.descent, descent_limit))
    return table._replace(climb=climb, descent=descent)


def _read_only(values: Floats) -> Floats:
    """Return a contiguous read-only copy, because numba would compile kernels again for another layout."""
    copy = np.array(values, dtype=np.float64)
    copy.setflags(write=False)
    return copy


@inlined
def wind_speed_at(table: PerformanceTable, amsl: float) -> float:
    """Return the mean wind speed at an altitude, m/s.

    amsl: altitude, m.
    """
    return mean_wind_speed(table.wind_speed, table.wind_gradient, table.wind_reference_amsl, amsl)


@compiled_inline
def true_airspeed(table: PerformanceTable, amsl: float) -> float:
    """Return the true airspeed at an altitude, m/s."""
    return table.airspeed * (1.0 + table.equivalent * (density_factor(amsl) - 1.0))


@compiled_inline
def ground_speed_on(table: PerformanceTable, course: float, amsl: float) -> float:
    """Return the ground speed on a course in the mean wind, m/s; NaN if the course cannot be held."""
    wind = wind_speed_at(table, amsl)
    angle = table.wind_to - course
    return ground_speed(true_airspeed(table, amsl), wind * math.cos(angle), wind * math.sin(angle))


@compiled_inline
def downwind_vector(table: PerformanceTable) -> tuple[float, float]:
    """Return the east and north components of the downwind unit vector."""
    return math.sin(table.wind_to), math.cos(table.wind_to)


@inlined
def slopes_along(
    table: PerformanceTable, tail_fraction: float, cross_fraction: float, amsl: float
) -> tuple[float, float]:
    """Return the steepest climb and dive over the ground on a course, rad.

    tail_fraction, cross_fraction: components of the unit wind vector along and across the course.

    The result is (0, 0) if the course cannot be held. The dive is 0 at an altitude at which the aircraft cannot hold an
    equivalent airspeed in level flight.
    """
    count = table.amsl.size
    wind = wind_speed_at(table, amsl)
    k = 0
    while k + 2 < count and table.amsl[k + 1] <= amsl:
        k += 1
    # Interpolate without np.interp, which takes a microsecond for one number in numba.
    fraction = min(1.0, max(0.0, (amsl - table.amsl[k]) / (table.amsl[k + 1] - table.amsl[k])))
    climb = table.climb[k] + fraction * (table.climb[k + 1] - table.climb[k])
    dive = table.descent[k] + fraction * (table.descent[k + 1] - table.descent[k])
    airspeed = true_airspeed(table, amsl)
    climb_slope = ground_slope(climb, airspeed, wind * tail_fraction, wind * cross_fraction)
    dive_slope = ground_slope(dive, airspeed, wind * tail_fraction, wind * cross_fraction)
    if math.isnan(climb_slope) or math.isnan(dive_slope):
        return 0.0, 0.0
    # No leg may descend from an altitude at which the true airspeed exceeds the maximum airspeed of level flight.
    if table.equivalent > 0.0 and climb < 0.0:
        dive_slope = 0.0
    return climb_slope, dive_slope


@compiled_inline
def aircraft_slopes(table: PerformanceTable, course: float, amsl: float) -> tuple[float, float]:
    """Return the steepest climb and dive over the ground on a course (rad), rad.

    The result is (0, 0) if the course cannot be held.
    """
    angle = table.wind_to - course
    return slopes_along(table, math.cos(angle), math.sin(angle), amsl)


@inlined
def _turn_radius_of_courses(
    table: PerformanceTable,
    ux: float,
    uy: float,
    vx: float,
    vy: float,
    amsl: float,
    turn_sign: float,
    wx: float,
    wy: float,
) -> float:
    """Return the radius (m) of the arc at the bank limit from the unit course u to the unit course v.

    ux, uy, vx, vy: east and north components of u and v.
    turn_sign: positive for a turn to the left, negative to the right, 0 for either direction.
    wx, wy: components of `downwind_vector`.

    The radius is inf if one of the courses cannot be held.
    """
    wind, airspeed = wind_speed_at(table, amsl), true_airspeed(table, amsl)
    if wind == 0.0:
        # Without wind the speed is the same on every course.
        max_speed = airspeed
    else:
        speed_in = ground_speed(airspeed, wind * (ux * wx + uy * wy), wind * (ux * wy - uy * wx))
        speed_out = ground_speed(airspeed, wind * (vx * wx + vy * wy), wind * (vx * wy - vy * wx))
        if math.isnan(speed_in) or math.isnan(speed_out):
            return math.inf
        max_speed = max(speed_in, speed_out)
        # The highest ground speed is downwind, if the turn passes through that course.
        if turn_sign == 0.0 or (turn_sign * (ux * wy - uy * wx) > 0.0 and turn_sign * (wx * vy - wy * vx) > 0.0):
            max_speed = max(max_speed, airspeed + wind)
    max_speed += table.gust_sigma
    return max_speed * max_speed / (GRAVITY * table.tan_max_bank)


@compiled_inline
def turn_radius_between(table: PerformanceTable, course_in: float, course_out: float, amsl: float) -> float:
    """Return the radius (m) of the arc at the bank limit between two courses (rad).

    The radius is for the highest ground speed in the turn, and inf if a course cannot be held. In turbulence one
    standard deviation of the gusts is added to the ground speed. The airspeed varies by this amount, and with it the
    bank that an arc over the ground requires.
    """
    turn = wrap(course_out - course_in)
    ux = math.sin(course_in)
    uy = math.cos(course_in)
    vx = math.sin(course_out)
    vy = math.cos(course_out)
    wx, wy = downwind_vector(table)
    # A U-turn may be flown in either direction.
    turn_sign = 0.0 if abs(turn) > math.pi - 1e-6 else (-1.0 if turn > 0.0 else 1.0)
    return _turn_radius_of_courses(table, ux, uy, vx, vy, amsl, turn_sign, wx, wy)


@inlined
def corner_tangent(
    table: PerformanceTable, ux: float, uy: float, vx: float, vy: float, amsl: float, wx: float, wy: float
) -> tuple[float, float]:
    """Return the tangent length and the radius of the fly-by arc between the unit courses u and v, m.

    ux, uy, vx, vy: east and north components of u and v.
    wx, wy: components of `downwind_vector`.

    The tangent length R tan(theta/2) = R |sin theta| / (1 + cos theta) is 0 without a turn and inf for a U-turn; the
    radius is 0 in both cases.
    """
    cross, dot = ux * vy - uy * vx, ux * vx + uy * vy
    if abs(cross) < 1e-9 and dot > 0.0:
        return 0.0, 0.0
    if abs(cross) < 1e-6 and dot < 0.0:
        return math.inf, 0.0
    radius = _turn_radius_of_courses(table, ux, uy, vx, vy, amsl, cross, wx, wy)
    return radius * abs(cross) / (1.0 + dot), radius


@compiled_inline
def arc_slope(tan_in: float, tan_out: float, tangent: float, radius: float) -> float:
    """Return the tangent of the slope along a fly-by arc with the turn angle theta.

    It is the difference in altitude between the arc's tangent points, divided by the length of the arc.

    tan_in, tan_out: tangents of the slopes of the legs before and after the arc.
    tangent: tangent length, radius x tan(theta/2), m.
    The arc, radius x theta, is shorter than its two tangents. Therefore it is steeper than the legs, by a factor of
    1.27 at 90 degrees.
    """
    if tangent <= 0.0 or radius <= 0.0 or math.isinf(tangent):
        return 0.0
    half_turn = math.atan(tangent / radius)
    return 0.5 * (tan_in + tan_out) * tangent / (radius * half_turn)


@compiled_inline
def fly_over_run(turn: float) -> float:
    """Return the distance after a fly-over turn at which the track joins the next leg, in turn radii.

    turn: rad.

    The distance along the leg is sin turn + 2 sin phi, where cos phi = (1 + cos turn)/2 defines the overshoot angle
    phi. The result never decreases with the turn: beyond the turn with the largest distance, it stays at the largest
    distance.
    """
    # The maximum of sin turn + 2 sin phi is 2 sqrt 2, at this angle.
    angle = min(turn, math.acos(-1.0 / 3.0))
    cos_overshoot = 0.5 * (1.0 + math.cos(angle))
    return math.sin(angle) + 2.0 * math.sqrt(max(0.0, 1.0 - cos_overshoot * cos_overshoot))


@compiled
def turn_tangents(table: PerformanceTable, waypoints: Floats) -> Floats:
    """Return the tangent length of the fly-by arc at each waypoint, m, (w,); 0 at the ends of the path.

    waypoints: m, (w, 3).

    The length is R tan(theta/2). It is inf for a U-turn, which has no tangent point.
    """
    count = waypoints.shape[0]
    tangents = np.zeros(count)
    wx, wy = downwind_vector(table)
    for i in range(1, count - 1):
        ux, uy = waypoints[i, 0] - waypoints[i - 1, 0], waypoints[i, 1] - waypoints[i - 1, 1]
        vx, vy = waypoints[i + 1, 0] - waypoints[i, 0], waypoints[i + 1, 1] - waypoints[i, 1]
        length_in, length_out = math.sqrt(ux * ux + uy * uy), math.sqrt(vx * vx + vy * vy)
        if length_in > 1e-6 and length_out > 1e-6:
            tangents[i], _ = corner_tangent(
                table, ux / length_in, uy / length_in, vx / length_out, vy / length_out, waypoints[i, 2], wx, wy
            )
    return tangents


@compiled
def roll_reversal_length(
    table: PerformanceTable,
    ux: float,
    uy: float,
    amsl: float,
    radius_in: float,
    radius_out: float,
    wx: float,
    wy: float,
) -> float:
    """Return the length of a leg (m) that the aircraft needs to roll from one turn into an opposite turn.

    ux, uy: unit vector of the leg's course.
    radius_in, radius_out: radii of the two arcs, m.
    wx, wy: components of `downwind_vector`.

    The length is 0 if the aircraft cannot make progress along the leg.
    """
    wind = wind_speed_at(table, amsl)
    airspeed = true_airspeed(table, amsl)
    speed = ground_speed(airspeed, wind * (ux * wx + uy * wy), wind * (ux * wy - uy * wx)) + table.gust_sigma
    if math.isnan(speed):
        return 0.0
    bank_length = speed * speed / GRAVITY
    bank_change = (
        math.atan(bank_length / radius_in) + math.atan(bank_length / radius_out) - math.atan(table.tan_max_bank)
    )
    return speed * ROLL_TIME * max(0.0, bank_change)
