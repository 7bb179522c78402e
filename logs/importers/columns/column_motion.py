"""Read the motion of an aircraft from a log with a table of columns, for an identification.

`logs.importers.motion_log` reads the same from ArduPilot's logs.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from logs.importers.columns.column_checks import check_signs_and_units
from logs.importers.columns.column_log import ColumnLog, Series
from logs.importers.columns.quantities import FRACTION_UNITS
from logs.importers.motion import MotionLog, Samples, find_first_ground_position, sort_samples
from logs.importers.wind_triangle import estimate_wind
from world.arrays import Floats
from world.errors import LogError

# Density of air at sea level, standard atmosphere, kg/m^3.
_SEA_LEVEL_DENSITY = 1.225
# Gas constant of dry air, J/(kg K).
_GAS_CONSTANT = 287.05
# Temperature of 0 degrees Celsius, K.
_ZERO_CELSIUS_K = 273.15
NO_SAMPLES = Samples(np.zeros(0), np.zeros((0, 1)))
_SURFACES = ("elevator", "aileron", "rudder")
_INERTIAL = (
    *("acceleration_forward", "acceleration_right", "acceleration_down"),
    *("roll_rate", "pitch_rate", "yaw_rate"),
)
# Commands that an identification needs, each with the pairs of left and right halves from which it can be computed.
_COMMANDS = {
    "elevator": (("elevon_left", "elevon_right"), ("elevator_left", "elevator_right")),
    "aileron": (("elevon_left", "elevon_right"), ("aileron_left", "aileron_right")),
    "throttle": (),
}


def read_column_motion(path: Path) -> MotionLog:
    """Read the motion of an aircraft from a log with a table of columns.

    Raises LogError for a file that cannot be read, and for quantities that contradict each other.

    path: path of the table, or of a data file with a table next to it.
    """
    log = ColumnLog(path)
    check_signs_and_units(log)
    air, velocity = read_air(log), read_velocity(log)
    controls, angles, elevons = _read_controls(log)
    place = _read_joined_series(log, "latitude", "longitude", "altitude")
    if len(place.time):
        place = Samples(place.time, place.values * np.array([math.degrees(1.0), math.degrees(1.0), 1.0]))
    return MotionLog(
        source=str(path),
        sha256=log.data_sha256,
        span=log.table.span_s or (-math.inf, math.inf),
        program=log.table.program,
        vehicle="plane",
        inertial=_read_joined_series(log, *_INERTIAL),
        outputs=NO_SAMPLES,
        attitude=_read_attitude(log),
        velocity=velocity,
        wind=air.wind,
        airspeed=air.airspeed,
        ratio=air.ratio,
        height=_read_joined_series(log, "altitude"),
        battery=_read_joined_series(log, "voltage", "current"),
        parameters=log.parameters(),
        home=find_first_ground_position(place, velocity),
        program_kind="columns",
        controls=controls,
        angles=angles,
        elevons=elevons,
        missing={
            "inertial": tuple(quantity for quantity in _INERTIAL if not log.has(quantity)),
            "outputs": tuple(
                quantity
                for quantity, halves in _COMMANDS.items()
                if not log.has(quantity) and not any(log.has(*pair) for pair in halves)
            ),
        },
    )


def _read_joined_series(log: ColumnLog, *quantities: str) -> Samples:
    """Read k quantities as the columns of one series, (n, k); no rows if the table lacks one of them."""
    if not log.has(*quantities):
        return NO_SAMPLES
    return join_series([log.series(quantity) for quantity in quantities])


def join_series(parts: list[Series]) -> Samples:
    """Join k series as the columns of one series at the times of the longest, (n, k).

    Shorter series are interpolated linearly.  Rows with a missing value are left out.  There are no rows if a series to
    be interpolated has fewer than two values.
    """
    longest = max(parts, key=lambda part: len(part.time))
    columns = []
    for part in parts:
        if part.time.shape == longest.time.shape and np.array_equal(part.time, longest.time):
            columns.append(part.values)
            continue
        known = np.isfinite(part.values)
        if known.sum() < 2:
            return NO_SAMPLES
        columns.append(np.interp(longest.time, part.time[known], part.values[known], left=math.nan, right=math.nan))
    return sort_samples(longest.time, np.column_stack(columns))


def _read_attitude(log: ColumnLog) -> Samples:
    """Read roll, pitch and yaw, without jumps at full turns, rad, (n, 3).

    There are no rows if the table lacks one of them.
    """
    attitude = _read_joined_series(log, "roll", "pitch", "yaw")
    return Samples(attitude.time, np.unwrap(attitude.values, axis=0)) if len(attitude.time) else attitude


def read_velocity(log: ColumnLog) -> Samples:
    """Read the ground velocity to north, east and down, m/s, (n, 3).

    The horizontal velocity comes from its components, or else from ground speed and course.  The vertical velocity
    comes from its own column, or else from the change of altitude.  There are no rows if the table lacks the columns
    for either.
    """
    if log.has("velocity_north", "velocity_east"):
        parts = [log.series("velocity_north"), log.series("velocity_east")]
    elif log.has("ground_speed", "ground_course"):
        speed, course = log.series("ground_speed"), log.series("ground_course")
        heading = _interpolate_at(course, speed.time, wraps=True)
        parts = [Series(speed.time, speed.values * function(heading)) for function in (np.cos, np.sin)]
    else:
        return NO_SAMPLES
    if log.has("velocity_down"):
        return join_series([*parts, log.series("velocity_down")])
    if not log.has("altitude"):
        return NO_SAMPLES
    altitude = join_series([log.series("altitude")])
    return join_series([*parts, Series(altitude.time, -np.gradient(altitude.values[:, 0], altitude.time))])


def _interpolate_at(series: Series, time: Floats, *, wraps: bool = False) -> Floats:
    """Interpolate a series linearly at times (s), (n,).

    wraps: True for an angle that jumps at full turns; the jumps are removed.
    """
    known = np.isfinite(series.values)
    values = np.unwrap(series.values[known]) if wraps else series.values[known]
    return np.asarray(np.interp(time, series.time[known], values))


@dataclass(frozen=True, slots=True)
class AirData:
    """Airspeed and wind in a log; a series that is unknown has no rows.

    airspeed: indicated airspeed, m/s, (n, 1).
    true_airspeed: true airspeed, m/s, (n, 1).
    ratio: ratio of true to indicated airspeed from logged pressure and temperature, (n, 1).
    wind: wind velocity to north and east, m/s, (n, 2).
    wind_source: description of the source of the wind.
    """

    airspeed: Samples
    true_airspeed: Samples
    ratio: Samples
    wind: Samples
    wind_source: str


def read_air(log: ColumnLog) -> AirData:
    """Read the airspeed and the wind of a log.

    The ratio of true to indicated airspeed comes from static pressure and temperature if the table has both, otherwise
    from the standard atmosphere at the logged altitude.  A wind that is not logged is estimated from ground velocity,
    heading and airspeed.
    """
    ratio = NO_SAMPLES
    if log.has("static_pressure", "temperature"):
        pressure = _read_joined_series(log, "static_pressure", "temperature")
        density = pressure.values[:, 0] / (_GAS_CONSTANT * (pressure.values[:, 1] + _ZERO_CELSIUS_K))
        ratio = Samples(pressure.time, np.sqrt(_SEA_LEVEL_DENSITY / density)[:, np.newaxis])
    airspeed = true_airspeed = _read_joined_series(log, "airspeed")
    if len(airspeed.time):
        time, height = airspeed.time, _read_joined_series(log, "altitude")
        if len(ratio.time):
            factor = np.interp(time, ratio.time, ratio.values[:, 0])[:, np.newaxis]
        else:
            altitude = np.interp(time, height.time, height.values[:, 0]) if len(height.time) else np.zeros(len(time))
            # The air density of the standard atmosphere decreases with (1 - 2.25577e-5 h)^4.25588, and the ratio is the
            # inverse square root of the density relative to sea level.
            factor = (1.0 - 2.25577e-5 * np.clip(altitude, -500.0, 9000.0))[:, np.newaxis] ** -2.12794
        if log.frame("airspeed") == "true":
            airspeed = Samples(airspeed.time, airspeed.values / factor)
        else:
            true_airspeed = Samples(airspeed.time, airspeed.values * factor)
    if log.has("wind_north", "wind_east"):
        logged_wind = join_series([log.series("wind_north"), log.series("wind_east")])
    elif log.has("wind_speed", "wind_direction"):
        speed, direction = log.series("wind_speed"), log.series("wind_direction")
        origin = _interpolate_at(direction, speed.time, wraps=True)
        logged_wind = join_series(
            [Series(speed.time, -speed.values * function(origin)) for function in (np.cos, np.sin)]
        )
    else:
        logged_wind = NO_SAMPLES
    wind, source = logged_wind, "wind of the table"
    if not len(wind.time):
        wind, source = (
            estimate_wind(read_velocity(log), _read_attitude(log), true_airspeed),
            "the triangle of velocities",
        )
    return AirData(airspeed, true_airspeed, ratio, wind, source)


def _read_controls(log: ColumnLog) -> tuple[Samples, tuple[bool, bool, bool], bool]:
    """Read the fields `controls`, `angles` and `elevons` of `MotionLog`, where they are defined.

    Left and right halves are combined to one surface.  There are no rows if elevator, aileron or throttle is missing.
    A missing rudder is 0.
    """
    has_elevons = log.has("elevon_left", "elevon_right")
    elevator = _read_surface(
        log, "elevator", ("elevon_left", "elevon_right") if has_elevons else ("elevator_left", "elevator_right")
    )
    aileron = _read_surface(
        log, "aileron", ("elevon_left", "elevon_right") if has_elevons else ("aileron_left", "aileron_right")
    )
    rudder = _read_surface(log, "rudder", ())
    if elevator is None or aileron is None or not log.has("throttle"):
        return NO_SAMPLES, (False, False, False), has_elevons
    (elevator_series, elevator_unit), (aileron_series, aileron_unit) = elevator, aileron
    rudder_series, rudder_unit = rudder or (Series(elevator_series.time, 0.0 * elevator_series.values), "rad")
    # The elevator is positive with its trailing edge down, the rudder with its trailing edge to the left.
    pitch_up = Series(elevator_series.time, -elevator_series.values)
    yaw_right = Series(rudder_series.time, -rudder_series.values)
    samples = join_series([pitch_up, aileron_series, yaw_right, log.series("throttle")])
    angles = tuple(unit not in FRACTION_UNITS for unit in (elevator_unit, aileron_unit, rudder_unit))
    return samples, (angles[0], angles[1], angles[2]), has_elevons


def _read_surface(log: ColumnLog, name: str, halves: tuple[str, ...]) -> tuple[Series, str] | None:
    """Read the deflections of a surface and their unit; None if the table lacks them.

    They come from the surface's own column, or else from its left and right half.  Then they are the mean of both, or
    for ailerons half of left minus right.  Raises LogError if one half is an angle and the other a fraction.

    name: name of the surface.
    halves: names of its left and right half; () if it has none.
    """
    if log.has(name):
        return log.series(name), log.unit(name)
    if not halves or not log.has(*halves):
        return None
    units = {log.unit(half) in FRACTION_UNITS for half in halves}
    if len(units) > 1:
        raise LogError.at(
            log.table_path, f"columns.{halves[1]}.unit", log.unit(halves[1]), f"expected the unit of {halves[0]}"
        )
    left, right = (log.series(half) for half in halves)
    sign = -1.0 if name == "aileron" else 1.0
    return Series(left.time, 0.5 * (left.values + sign * _interpolate_at(right, left.time))), log.unit(halves[0])
