"""Define the performance envelope of an aircraft.

It gives steady climb, descent, speed and power by airspeed and altitude.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from world.arrays import Floats
from world.kernels import compiled

# Standard gravity, m/s^2.
GRAVITY = 9.80665
# Distance from an uncertain limit within which a slope is undecided, in standard deviations: 95 % one-sided.
UNDECIDED_SIGMAS = 1.645
# Names of the tables of an `Envelope`.
TABLES = ("airspeed", "amsl", "climb", "descent", "level_speed_min", "level_speed_max")
# Names of the power tables of an `Envelope`.
POWERS = ("power_idle", "power_level", "power_full")


@dataclass(frozen=True, slots=True, eq=False)
class Envelope:
    """Limits of steady flight relative to the air mass, computed from trims.

    aircraft, model_hash: name and hash of the aircraft's model.
    motor_braking: True if the propeller may drive the motor in a descent.
    airspeed: increasing airspeeds of the tables, m/s, (v,).
    amsl: increasing altitudes of the tables, m AMSL, (h,).
    climb, descent: steepest flight-path angles, rad, (v, h), positive in the direction of their name (a negative climb
        means that the aircraft cannot hold its altitude); NaN if there is no trim.
    level_speed_min, level_speed_max: minimum and maximum airspeed of level flight, m/s, (h,).
    max_bank: the aircraft's own bank limit, rad.
    power_idle, power_level, power_full: electric power, or heat of the fuel per second, at the steepest descent, in
        level flight and at the steepest climb, W, (v, h); shape (0, 0) if unknown.
    volts: battery voltage, V; 0 without a battery.
    source: where a model with uncertain slopes comes from, e.g. "a data sheet"; "" if the slopes are certain.
    climb_sd, descent_sd: standard deviations of the steepest climb and descent, rad.
    fastest_sd: standard deviation of the fastest level flight, m/s.
    power_sd: standard deviation of the logarithm of power.
    battery_guessed, climb_guessed, bank_guessed: True if the battery's energy, the steepest climb or the bank limit was
        not stated.
    climb_shortfall: climb stated at the throttle limit minus the model's climb, rad; 0 if the model reaches it.
    """

    aircraft: str
    model_hash: str
    motor_braking: bool
    airspeed: Floats
    amsl: Floats
    climb: Floats
    descent: Floats
    level_speed_min: Floats
    level_speed_max: Floats
    max_bank: float
    power_idle: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    power_level: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    power_full: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    volts: float = 0.0
    source: str = ""
    climb_sd: float = 0.0
    descent_sd: float = 0.0
    fastest_sd: float = 0.0
    power_sd: float = 0.0
    battery_guessed: bool = False
    climb_guessed: bool = False
    bank_guessed: bool = False
    climb_shortfall: float = 0.0

    def __post_init__(self) -> None:
        """Make the tables read-only."""
        for name in (*TABLES, *POWERS):
            table = np.array(getattr(self, name), dtype=np.float64)
            table.setflags(write=False)
            object.__setattr__(self, name, table)

    def air_angles(self, airspeed: float, amsl: float) -> tuple[float, float]:
        """Return the steepest climb and descent angles relative to the air, rad.

        Both are positive in the direction of their name, and interpolated bilinearly. They are NaN at an airspeed
        outside the table or below the minimum airspeed of level flight. Between this minimum and the slowest trim of
        the table, the values of the slowest trim apply. For an altitude outside the table, the nearest altitude of the
        table is used.
        """
        if not airspeed >= float(np.interp(amsl, self.amsl, self.level_speed_min)):
            return math.nan, math.nan
        return (
            _interpolate_bilinearly(self.airspeed, self.amsl, self.climb, airspeed, amsl),
            _interpolate_bilinearly(self.airspeed, self.amsl, self.descent, airspeed, amsl),
        )

    def with_margin(self) -> "Envelope":
        """Return the envelope reduced by `UNDECIDED_SIGMAS` standard deviations of its uncertainty.

        A positive climb or descent is not reduced below 0, and a negative climb is unchanged. The maximum level speed
        is not reduced below the minimum level speed.

        >>> tables = {name: np.full((1, 1), 0.2) for name in ("climb", "descent")}
        >>> edges = dict.fromkeys(("airspeed", "amsl", "level_speed_min", "level_speed_max"), np.ones(1))
        >>> envelope = Envelope("mine", "", False, max_bank=0.5, climb_sd=0.1, descent_sd=0.2, **edges, **tables)
        >>> envelope = envelope.with_margin()
        >>> round(float(envelope.climb[0, 0]), 4), float(envelope.descent[0, 0]), envelope.climb_sd
        (0.0355, 0.0, 0.0)
        """
        if not (self.climb_sd or self.descent_sd or self.fastest_sd):
            return self
        margins = {name: UNDECIDED_SIGMAS * getattr(self, f"{name}_sd") for name in ("climb", "descent")}
        # A negative climb, which is a loss of altitude, remains unchanged.
        climb, descent = (
            np.where(table > 0.0, np.maximum(0.0, table - margins[name]), table)
            for name, table in (("climb", self.climb), ("descent", self.descent))
        )
        max_level_speed = np.fmax(self.level_speed_min, self.level_speed_max - UNDECIDED_SIGMAS * self.fastest_sd)
        return replace(
            self,
            climb=climb,
            descent=descent,
            level_speed_max=max_level_speed,
            climb_sd=0.0,
            descent_sd=0.0,
            fastest_sd=0.0,
        )

    def slope_limits(
        self, airspeed: float, amsl: float, tailwind: float = 0.0, crosswind: float = 0.0
    ) -> tuple[float, float]:
        """Return the steepest climb and dive over the ground on a leg in a steady wind, rad.

        tailwind, crosswind: m/s along and across the leg's course.

        Both slopes are positive in the direction of their name. A tailwind makes the slope over the ground flatter, a
        headwind makes it steeper. Both are NaN if the aircraft cannot make progress along the leg, or if `air_angles`
        is NaN.
        """
        climb, descent = self.air_angles(airspeed, amsl)
        return (
            ground_slope(climb, airspeed, tailwind, crosswind),
            ground_slope(descent, airspeed, tailwind, crosswind),
        )

    def power(self, airspeed: float, amsl: float, air_angle: float) -> float:
        """Return the power (W) of steady flight at a path angle.

        air_angle: angle relative to the air, rad, positive in a climb.

        The power lies on a parabola through idle, level flight and full throttle. Beyond idle and full throttle it is
        constant. It is NaN if the power is unknown, if the airspeed is outside the table, or in between if the aircraft
        cannot both climb and descend there.
        """
        if not self.power_level.size:
            return math.nan
        climb, descent = self.air_angles(airspeed, amsl)
        idle, level, full_throttle = (
            _interpolate_bilinearly(self.airspeed, self.amsl, getattr(self, name), airspeed, amsl) for name in POWERS
        )
        sine = math.sin(air_angle)
        min_sine, max_sine = -math.sin(descent), math.sin(climb)
        if sine >= max_sine:
            return full_throttle
        if sine <= min_sine:
            return idle
        if not min_sine < 0.0 < max_sine:
            return math.nan
        return (
            idle * sine * (sine - max_sine) / (min_sine * (min_sine - max_sine))
            + level * (sine - min_sine) * (sine - max_sine) / (min_sine * max_sine)
            + full_throttle * sine * (sine - min_sine) / (max_sine * (max_sine - min_sine))
        )

    def level_speeds(self, amsl: float) -> tuple[float, float]:
        """Return the minimum and the maximum airspeed of level flight (m/s) at an altitude (m AMSL)."""
        return (
            float(np.interp(amsl, self.amsl, self.level_speed_min)),
            float(np.interp(amsl, self.amsl, self.level_speed_max)),
        )


@compiled
def ground_slope(air_angle: float, airspeed: float, tailwind: float, crosswind: float) -> float:
    """Convert a climb angle relative to the air to the path angle over the ground, rad.

    The result is NaN if the aircraft cannot make progress over the ground.

    air_angle: rad.
    airspeed, tailwind, crosswind: m/s.
    """
    speed_over_ground = ground_speed(airspeed * math.cos(air_angle), tailwind, crosswind)
    return math.atan2(airspeed * math.sin(air_angle), speed_over_ground)


@compiled
def ground_speed(airspeed: float, tailwind: float, crosswind: float) -> float:
    """Return the ground speed along a course in wind, m/s; NaN if the course cannot be held.

    airspeed, tailwind, crosswind: m/s.
    """
    speed_along_2 = airspeed**2 - crosswind**2
    speed_over_ground = math.sqrt(speed_along_2) + tailwind if speed_along_2 > 0.0 else -1.0
    return speed_over_ground if speed_over_ground > 0.0 else math.nan


@compiled
def turn_radius(speed: float, bank: float) -> float:
    """Return the radius (m) of a coordinated level turn at a speed (m/s) and a bank (rad)."""
    return speed**2 / (GRAVITY * math.tan(bank))


def _interpolate_bilinearly(xs: Floats, ys: Floats, table: Floats, x: float, y: float) -> float:
    """Interpolate a table over `xs` (rows) and `ys` (columns) at x and y.

    y is clipped to `ys`. The result is NaN for x outside `xs`. Rows before the first row with a value get the values of
    that row.
    """
    rows = _interpolate_rows(ys, table, y)
    first_finite_row = int(np.argmax(~np.isnan(rows)))
    rows[:first_finite_row] = rows[first_finite_row]
    return float(np.interp(x, xs, rows, left=np.nan, right=np.nan))


def _interpolate_rows(ys: Floats, table: Floats, y: float) -> Floats:
    """Interpolate each row of a table at y.

    The result is bit-identical to the result of ``np.interp``, but takes a tenth of the time.

    ys: increasing positions of the columns.
    """
    k = min(max(0, int(np.searchsorted(ys, y, side="right")) - 1), ys.size - 1)
    if y <= ys[k] or k == ys.size - 1:
        return np.array(table[:, k])
    left_column, right_column = table[:, k], table[:, k + 1]
    slope = (right_column - left_column) / (ys[k + 1] - ys[k])
    rows = slope * (y - ys[k]) + left_column
    # As in np.interp: interpolate from the other side if NaN, and keep equal neighbors unchanged.
    rows = np.where(np.isnan(rows), slope * (y - ys[k + 1]) + right_column, rows)
    return np.where(np.isnan(rows) & (left_column == right_column), left_column, rows)
