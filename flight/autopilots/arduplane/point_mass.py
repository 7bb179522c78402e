"""An aircraft as a point mass, for compiled code: what its trims say of drag, thrust and power, and how it moves.

Bank and pitch are given; the flight path is below the pitch by the angle of attack, which grows with the load, and
specific excess power is that of trims at this throttle, airspeed and height, less the induced drag of the bank.
"""

import functools
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from platformdirs import user_cache_dir

from aircraft.catalog import Aircraft, model_hash
from aircraft.envelope import GRAVITY, Envelope
from flight.dynamics.envelope_tables import read_tables, write_tables
from flight.dynamics.fdm import JSBSIM_VERSION, Fdm
from flight.dynamics.trim import trim
from world.kernels import Record, inner, record_dtype
from world.least_squares import least_squares
from world.wind import Wind, mean_wind_speed

Floats = NDArray[np.float64]

# Grid of the trims: throttles from 0 to 1, airspeeds from the aircraft's slowest to its fastest, heights AMSL (m).
_THROTTLES, _SPEEDS, _HEIGHTS = 21, 7, (0.0, 2000.0, 4000.0)

# The aircraft as a point mass, for compiled code.  Its tables have a row for each airspeed and a column for each height
# of the grid.
POINT_MASS = record_dtype(
    "airspeed",  # m/s, commanded, equivalent
    "slowest",  # m/s, true, of the first row
    "speed_step",
    "height_step",
    "alpha",  # rad, angle of attack without lift
    "alpha_lift",  # rad m^2/s^2, the rest of it in straight flight, times the airspeed's square
    "induced",  # m^2/s^2, induced drag by weight in straight flight, times the airspeed's square
    "wind_speed",  # m/s at the reference height
    "wind_east",  # unit vector that it blows to
    "wind_north",
    "wind_gradient",
    "wind_reference",
    ("has_power", np.bool_),
)


class PointMass(NamedTuple):
    """What a return is flown with.

    record: of `POINT_MASS`.
    excess: (t, v, h) specific excess power, by throttle, m/s.
    power: (3, v, h) electric power at idle, in level flight and at full throttle, W.
    glides: whether its excess power with the throttle closed is that of trims.
    """

    record: Record
    excess: Floats
    power: Floats
    glides: bool = True


def point_mass(aircraft: Aircraft, envelope: Envelope, airspeed: float, wind: Wind) -> PointMass:
    """An aircraft by its trims, in a wind.

    airspeed: commanded, m/s, equivalent.  Beyond the grid of the trims its edge counts.
    """
    speeds, trims, alpha, lift = _trimmed(aircraft)
    excess = filled_excess(trims)
    has_power = bool(envelope.power_level.size)
    power = np.full((3, len(speeds), len(_HEIGHTS)), np.nan)
    if has_power:
        named = (envelope.power_idle, envelope.power_level, envelope.power_full)
        power = np.stack([_resampled(envelope, table, speeds) for table in named])
    record: Record = np.zeros(1, POINT_MASS)[0]
    record.airspeed, record.slowest, record.has_power = airspeed, speeds[0], has_power
    record.speed_step, record.height_step = speeds[1] - speeds[0], _HEIGHTS[1] - _HEIGHTS[0]
    record.alpha, record.alpha_lift = alpha, lift
    record.induced = _induced_drag(speeds, excess[0, :, 0])
    record.wind_speed, record.wind_gradient, record.wind_reference = wind.speed, wind.gradient, wind.reference_amsl
    record.wind_east, record.wind_north = -math.sin(wind.from_course), -math.cos(wind.from_course)
    return PointMass(record, excess, power, bool(np.isfinite(trims[0]).any()))


# Any change of what `_trims` computes counts this up.
_SCHEMA = 2


@functools.lru_cache(maxsize=8)
def _trimmed(aircraft: Aircraft) -> tuple[Floats, Floats, float, float]:
    """Airspeeds (v,), specific excess power (t, v, h) and the angle of attack, without lift and times V^2 with it.

    Excess power is NaN where there is no trim.  Trims are kept in the user's cache folder, as the envelope is.
    """
    speeds = np.linspace(aircraft.airspeed_min, aircraft.airspeed_max, _SPEEDS)
    version = model_hash(aircraft)
    file = Path(user_cache_dir("planfly")) / f"trims-{aircraft.name}-{version[:16]}-v{_SCHEMA}.json"
    key = {"schema": _SCHEMA, "model_hash": version, "jsbsim": JSBSIM_VERSION, "airspeeds": speeds.tolist()}
    shapes = {"excess": (_THROTTLES, _SPEEDS, len(_HEIGHTS)), "alpha": (_SPEEDS,)}
    tables = read_tables(file, key, shapes)
    if tables is None:
        tables = _trims(aircraft, speeds)
        write_tables(file, key, tables)
    alphas = tables["alpha"]
    _fill(alphas)
    terms = np.stack([np.ones(_SPEEDS), speeds**-2.0], axis=1)
    alpha, lift = least_squares(terms, np.nan_to_num(alphas))
    return speeds, tables["excess"], float(alpha), float(lift)


def _trims(aircraft: Aircraft, speeds: Floats) -> dict[str, Floats]:
    """Specific excess power (t, v, h), and the angle of attack (v,) at the lowest height; NaN where there is no trim.

    speeds: (v,) m/s.
    """
    simulator = Fdm(aircraft)
    excess = np.full((_THROTTLES, _SPEEDS, len(_HEIGHTS)), np.nan)
    alphas = np.full(_SPEEDS, np.nan)
    for h, amsl in enumerate(_HEIGHTS):
        for v, speed in enumerate(speeds):
            near = None
            for t in reversed(range(_THROTTLES)):
                found = trim(simulator, amsl, {"airspeed": float(speed), "throttle": t / (_THROTTLES - 1.0)}, near)
                if found is None:
                    continue
                near = found
                excess[t, v, h] = speed * math.sin(found.climb)
                if h == 0:
                    alphas[v] = found.alpha
    return {"excess": excess, "alpha": alphas}


def filled_excess(trims: Floats) -> Floats:
    """Specific excess power (t, v, h) by throttle, airspeed and height, m/s, of trims that are NaN where there is none.

    There the nearest throttle's counts, then the nearest airspeed's, then the nearest height's.  But a closed throttle
    is filled from closed ones alone, as far as there are any: a more open one has thrust, and would be no glide.

    >>> trims = np.array([[[-2.0], [np.nan]], [[1.0], [0.5]]])
    >>> filled_excess(trims)[0].tolist(), filled_excess(trims)[1].tolist()
    ([[-2.0], [-2.0]], [[1.0], [0.5]])
    """
    excess, closed = trims.copy(), trims[:1].copy()
    _fill_along(excess, 0)
    for table in (excess, closed):
        _fill_along(table, 1)
        _fill_along(table, 2)
    if np.isfinite(closed).any():
        excess[:1] = closed
    return excess


def _fill_along(table: Floats, axis: int) -> None:
    """Fill each line along an axis."""
    lines = np.moveaxis(table, axis, -1)
    for at in np.ndindex(lines.shape[:-1]):
        _fill(lines[at])


def _fill(values: Floats) -> None:
    """Put between and beyond known values what is nearest to them."""
    good = ~np.isnan(values)
    if good.any():
        values[:] = np.interp(np.arange(len(values)), np.flatnonzero(good), values[good])


def _resampled(envelope: Envelope, table: Floats, speeds: Floats) -> Floats:
    """A table of the envelope at airspeeds (v,) and the grid's heights, its edges extended."""
    filled = np.array(table)
    for column in filled.T:
        _fill(column)
    by_speed = np.stack([np.interp(speeds, envelope.airspeed, column) for column in filled.T], axis=1)
    return np.stack([np.interp(_HEIGHTS, envelope.amsl, row) for row in by_speed])


def _induced_drag(speeds: Floats, excess: Floats) -> float:
    """Induced drag by weight times the square of airspeed, of the drag polar through the glides with closed throttle.

    Drag by weight is a V^2 + b / V^2 in straight flight; b is what bank adds to, as the square of the load.
    """
    terms = np.stack([speeds**2, speeds**-2.0], axis=1)
    return max(0.0, float(least_squares(terms, -excess / speeds)[1]))


@inner
def angle_of_attack(state: Record, aircraft: Record) -> float:  # pragma: no cover - compiled
    """Angle of attack at an airspeed in a bank, rad."""
    load = 1.0 / max(0.3, math.cos(state.roll))
    attack: float = aircraft.alpha + aircraft.alpha_lift * load / (state.airspeed * state.airspeed)
    return attack


@inner
def move_on(
    motion: Record,
    state: Record,
    angle: float,
    throttle: float,
    aircraft: Record,
    excess: Floats,
    power: Floats,
    dt: float,
) -> float:  # pragma: no cover - compiled
    """Move a point mass on by ``dt`` s on a path angle (rad, to the air); returns the power that it takes, W."""
    thrust = excess_power(excess, throttle, state.airspeed, motion.up, aircraft)
    tilt = math.tan(min(1.2, abs(state.roll)))
    gain = thrust - aircraft.induced / state.airspeed * tilt * tilt
    taken = _power(thrust, excess, power, state.airspeed, motion.up, aircraft)
    state.yaw += GRAVITY * math.tan(state.roll) / state.airspeed * dt
    state.airspeed = max(3.0, state.airspeed + (GRAVITY * gain / state.airspeed - GRAVITY * math.sin(angle)) * dt)
    wind = mean_wind_speed(aircraft.wind_speed, aircraft.wind_gradient, aircraft.wind_reference, motion.up)
    level = state.airspeed * math.cos(angle)
    motion.velocity_east = level * math.sin(state.yaw) + wind * aircraft.wind_east
    motion.velocity_north = level * math.cos(state.yaw) + wind * aircraft.wind_north
    motion.velocity_up = state.airspeed * math.sin(angle)
    motion.east += motion.velocity_east * dt
    motion.north += motion.velocity_north * dt
    motion.up += motion.velocity_up * dt
    return taken


@inner
def _power(
    thrust: float, excess: Floats, power: Floats, airspeed: float, amsl: float, aircraft: Record
) -> float:  # pragma: no cover - compiled
    """Electric power at a specific excess power, by the parabola of `aircraft.envelope.Envelope.power`, W."""
    if not aircraft.has_power:
        return 0.0
    low = _at(power[0], airspeed, amsl, aircraft)
    middle = _at(power[1], airspeed, amsl, aircraft)
    high = _at(power[2], airspeed, amsl, aircraft)
    full, idle = _at(excess[excess.shape[0] - 1], airspeed, amsl, aircraft), _at(excess[0], airspeed, amsl, aircraft)
    if thrust >= full or not idle < 0.0 < full:
        return high
    if thrust <= idle:
        return low
    return (
        low * thrust * (thrust - full) / (idle * (idle - full))
        + middle * (thrust - idle) * (thrust - full) / (-idle * -full)
        + high * thrust * (thrust - idle) / (full * (full - idle))
    )


@inner
def excess_power(
    excess: Floats, throttle: float, airspeed: float, amsl: float, aircraft: Record
) -> float:  # pragma: no cover - compiled
    """Specific excess power in straight flight at a throttle, an airspeed and a height, m/s."""
    x = min(1.0, max(0.0, throttle)) * (excess.shape[0] - 1)
    i = min(excess.shape[0] - 2, int(x))
    low, high = _at(excess[i], airspeed, amsl, aircraft), _at(excess[i + 1], airspeed, amsl, aircraft)
    value: float = low + (x - i) * (high - low)
    return value


@inner
def _at(table: Floats, airspeed: float, amsl: float, aircraft: Record) -> float:  # pragma: no cover - compiled
    """A table (v, h) at an airspeed and a height, bilinear, its edges extended."""
    x = min(table.shape[0] - 1.0, max(0.0, (airspeed - aircraft.slowest) / aircraft.speed_step))
    y = min(table.shape[1] - 1.0, max(0.0, amsl / aircraft.height_step))
    i, j = min(table.shape[0] - 2, int(x)), min(table.shape[1] - 2, int(y))
    p, q = x - i, y - j
    low = (1.0 - q) * table[i, j] + q * table[i, j + 1]
    high = (1.0 - q) * table[i + 1, j] + q * table[i + 1, j + 1]
    value: float = (1.0 - p) * low + p * high
    return value
