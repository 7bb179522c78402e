"""Read the motion of an aircraft from a telemetry log (`.tlog`) of ArduPlane, for an identification.

`logs.importers.motion_log` reads the same from ArduPilot's dataflash logs.
"""

from pathlib import Path

import numpy as np

from logs.importers.motion import OUTPUTS, MotionLog, Samples, find_first_ground_position, sort_samples
from logs.importers.raw_log import LogSeries
from logs.importers.telemetry_log import read_vehicle_messages
from logs.importers.wind_triangle import estimate_wind
from world.arrays import Floats
from world.errors import LogError

# ArduPilot's RAW_IMU states accelerations in thousandths of this, m/s^2, and angular rates in thousandths of a rad/s.
_STANDARD_GRAVITY_MPS2 = 9.80665
# Time after which a 32-bit number of microseconds starts at 0 again, s.
_WRAP_S = 2.0**32 * 1e-6
# The time stated in a message is used if it differs by less than this from its time of reception, s.
_MAX_CLOCK_DIFFERENCE_S = 2.0
NO_SAMPLES = Samples(np.zeros(0), np.zeros((0, 1)))


def read_telemetry_motion(path: Path, digest: str) -> MotionLog:
    """Read the motion of an aircraft from a telemetry log of ArduPlane.

    Raises LogError for a log without a vehicle or positions, and for a log of PX4, whose telemetry does not state which
    surface each output moves.

    digest: SHA-256 of the file's bytes.
    """
    messages, damage = read_vehicle_messages(path)
    if messages.is_px4:
        advice = "use the .ulg of the same flight"
        raise LogError(f"{path}: telemetry of PX4 does not state what its outputs move; {advice}", file=path)
    raw = messages.to_raw_log(damage)
    velocity = _select_columns(raw.series.get("velocity"), [1, 0, 2], [1.0, 1.0, -1.0])
    attitude = _select_columns(raw.series.get("attitude"), [0, 1, 2])
    position = raw.series["position"]
    true_airspeed = raw.series.get("airspeed")
    wind = _select_columns(raw.series.get("wind"), [1, 0])
    if not len(wind.time):
        wind = estimate_wind(velocity, attitude, _select_columns(true_airspeed, [0]))
    table = messages.table("RAW_IMU", ("time_usec", "xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro"))
    inertial = NO_SAMPLES
    if table is not None:
        units = np.repeat([_STANDARD_GRAVITY_MPS2 * 1e-3, 1e-3], 3)
        inertial = sort_samples(_correct_message_times(table.time, table.values[:, 0]), table.values[:, 1:] * units)
    names = tuple(f"servo{k}_raw" for k in range(1, OUTPUTS + 1))
    table = messages.table("SERVO_OUTPUT_RAW", ("time_usec", "port", *names))
    if table is None:
        outputs = Samples(np.zeros(0), np.zeros((0, OUTPUTS)))
    else:
        is_first_port = table.values[:, 1] == 0.0
        times = _correct_message_times(table.time[is_first_port], table.values[is_first_port, 0])
        outputs = sort_samples(times, table.values[is_first_port, 2:])
    return MotionLog(
        source=str(path),
        sha256=digest,
        program=raw.program,
        vehicle=raw.vehicle,
        inertial=inertial,
        outputs=outputs,
        attitude=attitude,
        velocity=velocity,
        wind=wind,
        airspeed=NO_SAMPLES
        if true_airspeed is None
        else _select_columns(messages.table("VFR_HUD", ("airspeed",)), [0]),
        ratio=NO_SAMPLES,
        height=_select_columns(position, [2]),
        battery=_select_columns(messages.battery(), [0, 1]),
        modes=tuple(messages.mode_numbers()),
        parameters=raw.parameters,
        home=find_first_ground_position(_select_columns(position, [0, 1, 2]), velocity),
        program_kind="telemetry",
    )


def _select_columns(series: LogSeries | None, columns: list[int], factors: list[float] | None = None) -> Samples:
    """Return some columns of a series, sorted by time; no rows if `series` is None.

    columns: indices of the columns.
    factors: factor for each of these columns; None for 1.
    """
    if series is None:
        return NO_SAMPLES
    return sort_samples(series.time, series.values[:, columns] * np.array([1.0] if factors is None else factors))


def _correct_message_times(time: Floats, microseconds: Floats) -> Floats:
    """Return the times that messages state for their data, s, (n,).

    If the stated time of a message and its time of reception differ by `_MAX_CLOCK_DIFFERENCE_S` or more, its time of
    reception is returned.

    time: times of reception on the vehicle's clock, s, (n,).
    microseconds: times stated in the messages since the vehicle was switched on, us, (n,); they may wrap after 32 bits.

    >>> _correct_message_times(np.array([4300.0, 4300.3]), np.array([5.1e6, 5.2e6])).round(3).tolist()
    [4300.067, 4300.167]
    """
    message_time = microseconds * 1e-6
    message_time = message_time + _WRAP_S * np.round((time - message_time) / _WRAP_S)
    return np.asarray(np.where(np.abs(message_time - time) < _MAX_CLOCK_DIFFERENCE_S, message_time, time))
