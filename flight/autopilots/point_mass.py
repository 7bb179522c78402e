"""Model an aircraft as a point mass for compiled code, with drag, thrust and power from its trims.

Bank and pitch are inputs; the path angle is the pitch minus the angle of attack, which grows with the load factor.
Specific excess power is the climb rate at constant airspeed. It is interpolated from trims (states of steady flight)
by throttle, airspeed and altitude, and reduced by the additional induced drag of a bank.
"""

import functools
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from platformdirs import user_cache_dir

from aircraft.catalog import Aircraft, model_hash
from aircraft.envelope import GRAVITY, Envelope
from flight.dynamics.envelope_tables import read_tables, write_tables
from flight.dynamics.fdm import JSBSIM_VERSION, Fdm
from flight.dynamics.trim import trim
from world.arrays import Floats
from world.forecast.wind_field import interpolate_field, without_levels_above
from world.frames import POLYMAP, PolyMap, polymap
from world.kernels import Record, inner, record_dtype
from world.least_squares import least_squares
from world.wind import Wind, mean_wind_speed

# Number of throttles in the grid of trims, from 0 to 1.
_THROTTLE_COUNT = 21
# Number of airspeeds in the grid, from the aircraft's minimum to its maximum.
_AIRSPEED_COUNT = 7
# Altitudes of the grid, m AMSL.
_ALTITUDES_M = (0.0, 2000.0, 4000.0)
# Height above the start of a mission up to which the strongest wind of a forecast is used, m.
_MAX_WIND_HEIGHT_M = 2000.0

# Bank beyond which the induced drag of a point mass does not increase further, rad.
_MAX_DRAG_BANK_RAD = 1.2
# Lowest airspeed of a point mass, m/s.
_MIN_AIRSPEED_MPS = 3.0

# The aircraft as a point mass, for compiled code. Its tables have a row for each airspeed and a column for each
# altitude of the grid.
POINT_MASS = record_dtype(
    "airspeed",  # m/s, commanded, equivalent
    "first_airspeed",  # m/s, true airspeed of the first row
    "airspeed_step",  # m/s between rows
    "altitude_step",  # m between columns
    "alpha",  # rad, angle of attack without lift
    "alpha_lift",  # rad m^2/s^2, angle of attack from lift in straight flight, times the square of airspeed
    "induced",  # m^2/s^2, induced drag per weight in straight flight, times the square of airspeed
    "wind_speed",  # m/s at the reference height
    "wind_east",  # unit vector of the direction to which the wind blows
    "wind_north",
    "wind_gradient",
    "wind_reference",
    "max_wind",  # m/s, strongest wind that a flight may meet
    ("has_power", np.bool_),
    ("geo_map", POLYMAP),  # from east and north to longitude and latitude, deg; used with a wind field
)


class PointMass(NamedTuple):
    """Aircraft model for a simulated RTL, with tables by airspeed (v) and altitude (h).

    record: a record of `POINT_MASS`.
    excess: specific excess power, m/s, (t, v, h), with t throttles from 0 to 1.
    power: electric power at idle, in level flight and at full throttle, W, (3, v, h).
    glides: True if the excess power with closed throttle is known from trims.
    field: packed deviation of a forecast's wind from the mean wind of the record; empty for none.
    """

    record: Record
    excess: Floats
    power: Floats
    glides: bool = True
    field: Floats = np.zeros(0)

    @property
    def tables(self) -> tuple[Record, Floats, Floats, Floats]:
        """Arguments of compiled functions: `POINT_MASS` record, excess power, electric power, and wind field."""
        return self.record, self.excess, self.power, self.field


def make_point_mass(
    aircraft: Aircraft, envelope: Envelope, airspeed: float, wind: Wind, geo_map: PolyMap | None = None
) -> PointMass:
    """Return a point-mass model of an aircraft, from its table of trimmed states, in a wind.

    airspeed: commanded equivalent airspeed, m/s.
    geo_map: map from east and north to longitude and latitude, deg; without it, only the mean wind is used.

    Outside the table's airspeeds and altitudes, the values at its edge apply.
    """
    speeds, excess, alpha, lift, glides = _load_trim_tables(aircraft)
    has_power = bool(envelope.power_level.size)
    power = np.full((3, len(speeds), len(_ALTITUDES_M)), np.nan)
    if has_power:
        # Interpolate the envelope's tables to the grid of airspeeds and altitudes; beyond an edge of a table, the value
        # at the edge applies.
        for grid, table in zip(power, (envelope.power_idle, envelope.power_level, envelope.power_full), strict=True):
            filled = np.array(table)
            for column in filled.T:
                _fill_gaps(column)
            by_speed = np.stack([np.interp(speeds, envelope.airspeed, column) for column in filled.T], axis=1)
            grid[:] = [np.interp(_ALTITUDES_M, envelope.amsl, row) for row in by_speed]
    record: Record = np.zeros(1, POINT_MASS)[0]
    record.airspeed, record.first_airspeed, record.has_power = airspeed, speeds[0], has_power
    record.airspeed_step, record.altitude_step = speeds[1] - speeds[0], _ALTITUDES_M[1] - _ALTITUDES_M[0]
    record.alpha, record.alpha_lift = alpha, lift
    # Fit the induced drag factor b (m^2/s^2) to glides: in straight flight at the airspeed V the drag per weight is a
    # V^2 + b / V^2. In a bank, b grows as the square of the load factor.
    terms = np.stack([speeds**2, speeds**-2.0], axis=1)
    record.induced = max(0.0, float(least_squares(terms, -excess[0, :, 0] / speeds)[1]))
    record.wind_speed, record.wind_gradient, record.wind_reference = wind.speed, wind.gradient, wind.reference_amsl
    record.wind_east, record.wind_north = -math.sin(wind.from_course), -math.cos(wind.from_course)
    record.max_wind = wind.speed
    point_mass = PointMass(record, excess.copy(), power, glides)
    if wind.field is None or geo_map is None:
        return point_mass
    record.geo_map = geo_map.record
    low_field = without_levels_above(wind.field, wind.reference_amsl + _MAX_WIND_HEIGHT_M)
    winds = wind.velocities_at(low_field.altitudes.ravel()) + low_field.velocities.reshape(-1, 2)
    record.max_wind = np.hypot(winds[:, 0], winds[:, 1]).max()
    return point_mass._replace(field=wind.field.packed())


# Version of the cached tables: increase it with any change of `_compute_trim_tables`.
_CACHE_VERSION = 2


@functools.lru_cache(maxsize=8)
def _load_trim_tables(aircraft: Aircraft) -> tuple[Floats, Floats, float, float, bool]:
    """Return a point mass's tables from the aircraft's trims, which are cached in the user's cache folder.

    The five results are: airspeeds of the grid, m/s, (v,); specific excess power, m/s, (t, v, h) for t throttles and h
    altitudes; angle of attack without lift, rad; angle of attack from lift, times the square of airspeed, rad m^2/s^2;
    and True if any trim exists with closed throttle, so that the aircraft can glide.
    """
    speeds = np.linspace(aircraft.airspeed_min, aircraft.airspeed_max, _AIRSPEED_COUNT)
    version = model_hash(aircraft)
    file = Path(user_cache_dir("planfly")) / f"trims-{aircraft.name}-{version[:16]}-v{_CACHE_VERSION}.json"
    key = {"schema": _CACHE_VERSION, "model_hash": version, "jsbsim": JSBSIM_VERSION, "airspeeds": speeds.tolist()}
    shapes = {"excess": (_THROTTLE_COUNT, _AIRSPEED_COUNT, len(_ALTITUDES_M)), "alpha": (_AIRSPEED_COUNT,)}
    tables = read_tables(file, key, shapes)
    if tables is None:
        tables = _compute_trim_tables(aircraft, speeds)
        write_tables(file, key, tables)
    alphas = tables["alpha"]
    _fill_gaps(alphas)
    terms = np.stack([np.ones(_AIRSPEED_COUNT), speeds**-2.0], axis=1)
    alpha, lift = least_squares(terms, np.nan_to_num(alphas))
    trims = tables["excess"]
    return speeds, fill_excess_power(trims), float(alpha), float(lift), bool(np.isfinite(trims[0]).any())


def _compute_trim_tables(aircraft: Aircraft, speeds: Floats) -> dict[str, Floats]:
    """Trim the aircraft at each point of a grid of throttle, airspeed and altitude.

    The result is the specific excess power "excess", m/s, (t, v, h), and the angle of attack at the lowest altitude
    "alpha", rad, (v,). Values are NaN where no trim exists.

    speeds: airspeeds of the grid, m/s, (v,).
    """
    simulator = Fdm(aircraft)
    excess = np.full((_THROTTLE_COUNT, _AIRSPEED_COUNT, len(_ALTITUDES_M)), np.nan)
    alphas = np.full(_AIRSPEED_COUNT, np.nan)
    for h, amsl in enumerate(_ALTITUDES_M):
        for v, speed in enumerate(speeds):
            previous_trim = None
            for t in reversed(range(_THROTTLE_COUNT)):
                solution = trim(
                    simulator, amsl, {"airspeed": float(speed), "throttle": t / (_THROTTLE_COUNT - 1.0)}, previous_trim
                )
                if solution is None:
                    continue
                previous_trim = solution
                excess[t, v, h] = speed * math.sin(solution.climb)
                if h == 0:
                    alphas[v] = solution.alpha
    return {"excess": excess, "alpha": alphas}


def fill_excess_power(trims: Floats) -> Floats:
    """Return a table of specific excess power with its gaps (NaN) filled, m/s, (t, v, h).

    A gap is a grid point without a trim. It is filled from other throttles, or else from other airspeeds, or else from
    other altitudes. A gap at closed throttle is filled only from other trims at closed throttle, if there are any,
    because an aircraft with more throttle does not glide.

    >>> trims = np.array([[[-2.0], [np.nan]], [[1.0], [0.5]]])
    >>> fill_excess_power(trims)[0].tolist(), fill_excess_power(trims)[1].tolist()
    ([[-2.0], [-2.0]], [[1.0], [0.5]])
    """
    excess, closed = trims.copy(), trims[:1].copy()
    _fill_gaps_along(excess, 0)
    for table in (excess, closed):
        _fill_gaps_along(table, 1)
        _fill_gaps_along(table, 2)
    if np.isfinite(closed).any():
        excess[:1] = closed
    return excess


def _fill_gaps_along(table: Floats, axis: int) -> None:
    """Fill the gaps (NaN) of a table along one axis, in place; see `_fill_gaps`."""
    lines = np.moveaxis(table, axis, -1)
    for index in np.ndindex(lines.shape[:-1]):
        _fill_gaps(lines[index])


def _fill_gaps(values: Floats) -> None:
    """Fill gaps (NaN) in place by interpolation; beyond the known values, repeat the nearest of them.

    If all values are gaps, they are left unchanged.
    """
    is_known = ~np.isnan(values)
    if is_known.any():
        values[:] = np.interp(np.arange(len(values)), np.flatnonzero(is_known), values[is_known])


@inner
def angle_of_attack(state: Record, aircraft: Record) -> float:
    """Return the angle of attack at the state's airspeed and bank, rad.

    state: attitude, airspeed and rates of the aircraft, a `STATE` record.
    aircraft: the point mass, a `POINT_MASS` record.
    """
    # The cosine is limited, to keep the load factor finite at extreme banks.
    load_factor = 1.0 / max(0.3, math.cos(state.roll))
    return aircraft.alpha + aircraft.alpha_lift * load_factor / (state.airspeed * state.airspeed)


@inner
def wind_at(position: Record, seconds: float, aircraft: Record, field: Floats) -> tuple[float, float]:
    """Return the wind at a position and a time, m/s, east and north.

    position: a record with `east`, `north` and `up`, m.
    seconds: time after take-off, s.
    aircraft: a record of `POINT_MASS`.
    field: packed wind field, as in `PointMass`; empty for none.
    """
    if not field.size:
        speed = mean_wind_speed(aircraft.wind_speed, aircraft.wind_gradient, aircraft.wind_reference, position.up)
        return speed * aircraft.wind_east, speed * aircraft.wind_north
    longitude, latitude = polymap(aircraft.geo_map, position.east, position.north)
    east, north, altitude = interpolate_field(field, seconds, latitude, longitude, position.up)
    speed = mean_wind_speed(aircraft.wind_speed, aircraft.wind_gradient, aircraft.wind_reference, altitude)
    return speed * aircraft.wind_east + east, speed * aircraft.wind_north + north


@inner
def advance_point_mass(
    motion: Record,
    state: Record,
    path_angle: float,
    throttle: float,
    aircraft: Record,
    excess_table: Floats,
    power_table: Floats,
    wind_field: Floats,
    dt: float,
) -> float:
    """Move a point mass by ``dt`` s, and return the electric power that it uses, W.

    motion: position and velocity over the ground, a record of `flight.guidance.navigation_error.MOTION`; updated.
    state: airspeed, attitude, time and wind, a record of `flight.dynamics.state.STATE`. Airspeed, yaw and time are
        updated, and the wind is set for the new time and position.
    path_angle: climb angle relative to the air, rad.
    throttle: 0 to 1.
    aircraft: a record of `POINT_MASS`.
    excess_table: specific excess power, m/s, `PointMass.excess`.
    power_table: electric power, W, `PointMass.power`.
    wind_field: packed wind field, as in `PointMass`; empty for none.
    dt: duration of a tick, s.
    """
    thrust_power = excess_power(excess_table, throttle, state.airspeed, motion.up, aircraft)
    tan_bank = math.tan(min(_MAX_DRAG_BANK_RAD, abs(state.roll)))
    net_power = thrust_power - aircraft.induced / state.airspeed * tan_bank * tan_bank
    electric_power = _electric_power(thrust_power, excess_table, power_table, state.airspeed, motion.up, aircraft)
    state.yaw += GRAVITY * math.tan(state.roll) / state.airspeed * dt
    state.airspeed = max(
        _MIN_AIRSPEED_MPS, state.airspeed + (GRAVITY * net_power / state.airspeed - GRAVITY * math.sin(path_angle)) * dt
    )
    horizontal_airspeed = state.airspeed * math.cos(path_angle)
    motion.velocity_east = horizontal_airspeed * math.sin(state.yaw) + state.wind_east
    motion.velocity_north = horizontal_airspeed * math.cos(state.yaw) + state.wind_north
    motion.velocity_up = state.airspeed * math.sin(path_angle)
    motion.east += motion.velocity_east * dt
    motion.north += motion.velocity_north * dt
    motion.up += motion.velocity_up * dt
    state.time += dt
    state.wind_east, state.wind_north = wind_at(motion, state.time, aircraft, wind_field)
    return electric_power


@inner
def _electric_power(
    thrust_power: float, excess_table: Floats, power: Floats, airspeed: float, amsl: float, aircraft: Record
) -> float:
    """Return the electric power (W) for a specific excess power (m/s).

    The power is a parabola through the points at idle, in level flight and at full throttle, as in `Envelope.power`. It
    is constant below the excess power at idle, and above the excess power at full throttle. If the aircraft cannot
    climb at full throttle, or does not sink at idle, it is the power at full throttle. It is 0 for an aircraft without
    known power.

    thrust_power: specific excess power in straight flight, m/s.
    excess_table: specific excess power, m/s, `PointMass.excess`.
    power: electric power, W, `PointMass.power`.
    airspeed: m/s.
    amsl: altitude, m.
    aircraft: a record of `POINT_MASS`.
    """
    if not aircraft.has_power:
        return 0.0
    idle_power = _interpolate(power[0], airspeed, amsl, aircraft)
    level_power = _interpolate(power[1], airspeed, amsl, aircraft)
    full_power = _interpolate(power[2], airspeed, amsl, aircraft)
    full_excess = _interpolate(excess_table[excess_table.shape[0] - 1], airspeed, amsl, aircraft)
    idle_excess = _interpolate(excess_table[0], airspeed, amsl, aircraft)
    if thrust_power >= full_excess or not idle_excess < 0.0 < full_excess:
        return full_power
    if thrust_power <= idle_excess:
        return idle_power
    return (
        idle_power * thrust_power * (thrust_power - full_excess) / (idle_excess * (idle_excess - full_excess))
        + level_power * (thrust_power - idle_excess) * (thrust_power - full_excess) / (-idle_excess * -full_excess)
        + full_power * thrust_power * (thrust_power - idle_excess) / (full_excess * (full_excess - idle_excess))
    )


@inner
def excess_power(excess_table: Floats, throttle: float, airspeed: float, amsl: float, aircraft: Record) -> float:
    """Return the specific excess power in straight flight at a throttle, airspeed and altitude, m/s.

    excess_table: specific excess power, m/s, `PointMass.excess`.
    throttle: 0..1.
    airspeed: m/s.
    amsl: altitude, m.
    aircraft: a record of `POINT_MASS`.
    """
    grid_position = min(1.0, max(0.0, throttle)) * (excess_table.shape[0] - 1)
    row = min(excess_table.shape[0] - 2, int(grid_position))
    lower_power = _interpolate(excess_table[row], airspeed, amsl, aircraft)
    upper_power = _interpolate(excess_table[row + 1], airspeed, amsl, aircraft)
    return lower_power + (grid_position - row) * (upper_power - lower_power)


@inner
def _interpolate(table: Floats, airspeed: float, amsl: float, aircraft: Record) -> float:
    """Interpolate a table (v, h) bilinearly at an airspeed and an altitude.

    Outside the table the value at its nearest edge applies.

    aircraft: the point mass, a `POINT_MASS` record.
    """
    row = min(table.shape[0] - 1.0, max(0.0, (airspeed - aircraft.first_airspeed) / aircraft.airspeed_step))
    column = min(table.shape[1] - 1.0, max(0.0, amsl / aircraft.altitude_step))
    i, j = min(table.shape[0] - 2, int(row)), min(table.shape[1] - 2, int(column))
    row_fraction, column_fraction = row - i, column - j
    lower_value = (1.0 - column_fraction) * table[i, j] + column_fraction * table[i, j + 1]
    upper_value = (1.0 - column_fraction) * table[i + 1, j] + column_fraction * table[i + 1, j + 1]
    return (1.0 - row_fraction) * lower_value + row_fraction * upper_value
