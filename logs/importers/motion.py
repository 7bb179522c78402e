"""Define the data of a log from which an aircraft model is identified: motion at full rate.

The data for a verdict are defined in `logs.importers.raw_log`.  `logs.importers.motion_log` reads the motion from logs.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from logs.importers.raw_log import VehicleKind
from world.arrays import Floats

# Number of servo outputs in `MotionLog.outputs`.
OUTPUTS = 14
# Ground speed below which a vehicle stands on the ground, m/s.
_STANDING_SPEED_MPS = 2.0


@dataclass(frozen=True, slots=True)
class Samples:
    """Rows of one quantity, or of several quantities that are measured together.

    time: increasing times on the log's clock, s, (n,).
    values: one column for each quantity, (n, k).
    """

    time: Floats
    values: Floats

    @property
    def rate(self) -> float:
        """Usual number of rows per second, from the median interval; 0 for fewer than two rows."""
        return float(1.0 / max(1e-6, np.median(np.diff(self.time)))) if len(self.time) > 1 else 0.0


@dataclass(frozen=True, slots=True)
class MotionLog:
    """The motion of an aircraft in a log, in SI units and radians; data that are not logged have no rows.

    source: path of the file.
    sha256: SHA-256 of the file's bytes.
    program: name of the program that flew.
    vehicle: kind of vehicle.
    inertial: specific force forward, right and down, and angular rates p, q and r, from the first inertial sensor,
        (n, 6).
    outputs: pulses of the servo outputs, us, (n, 14); the first output is in column 0.
    attitude: roll, pitch and yaw, (n, 3).
    velocity: ground velocity to north, east and down, (n, 3).
    wind: wind velocity to north and east, (n, 2).
    airspeed: equivalent airspeed of a sensor that was in use, (n, 1).
    ratio: ratio of true to equivalent airspeed, (n, 1).
    height: altitude, m AMSL, (n, 1).
    battery: voltage, V, and current, A, (n, 2).
    modes: time and number of each flight mode.
    parameters: last value of each parameter, by name.
    home: latitude and longitude (degrees) and altitude (m AMSL) of the vehicle's last logged home, or else of its first
        position on the ground; None if neither is known.
    program_kind: kind of program or format from which the log comes.
    controls: commands pitch up, roll right and yaw right, as fractions of full travel, and throttle (0..1), (n, 4), in
        a log that has them instead of `outputs`.
    angles: True for each of the first three controls that is a deflection, rad, instead of a fraction.
    elevons: True if the aircraft has elevons.
    hovering: start and end of each period on lifting motors that the log states, s.
    span: first and last time of the part of the log that was read, on the log's clock, s.
    missing: names of the quantities in `inertial` and `outputs` that a table of columns lacks, keyed by the field's
        name.
    """

    source: str
    sha256: str
    program: str
    vehicle: VehicleKind
    inertial: Samples
    outputs: Samples
    attitude: Samples
    velocity: Samples
    wind: Samples
    airspeed: Samples
    ratio: Samples
    height: Samples
    battery: Samples
    modes: tuple[tuple[float, int], ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    home: tuple[float, float, float] | None = None
    program_kind: Literal["ardupilot", "px4", "telemetry", "columns"] = "ardupilot"
    controls: Samples = field(default_factory=lambda: Samples(np.zeros(0), np.zeros((0, 4))))
    angles: tuple[bool, bool, bool] = (False, False, False)
    elevons: bool = False
    hovering: tuple[tuple[float, float], ...] = ()
    span: tuple[float, float] = (-math.inf, math.inf)
    missing: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def surface_commands(self) -> Samples:
        """`controls` if they are logged, or else `outputs`."""
        return self.controls if len(self.controls.time) else self.outputs


def find_first_ground_position(position: Samples, velocity: Samples) -> tuple[float, float, float] | None:
    """Return latitude, longitude (degrees) and altitude (m) where a vehicle first stood still.

    Return None if it never stood still.  Rows outside the times of the velocities, and rows without a valid position,
    are ignored.

    position: latitude and longitude (degrees) and altitude (m), (n, 3).
    velocity: ground velocity, m/s, (n, 3).

    >>> place = Samples(np.array([1.0, 2.0]), np.array([[48.0, 11.0, 520.0], [48.0, 11.001, 540.0]]))
    >>> find_first_ground_position(place, Samples(np.array([0.0, 3.0]), np.zeros((2, 3))))
    (48.0, 11.0, 520.0)
    """
    if not len(position.time) or not len(velocity.time):
        return None
    time, coordinates = position.time, position.values
    speed = np.interp(time, velocity.time, np.linalg.norm(velocity.values, axis=1), left=np.inf, right=np.inf)
    is_valid = (np.abs(coordinates[:, :2]) <= [90.0, 180.0]).all(axis=1) & (coordinates[:, :2] != 0.0).any(axis=1)
    standing_rows = np.flatnonzero(is_valid & (speed < _STANDING_SPEED_MPS))
    if not len(standing_rows):
        return None
    lat, lon, height = coordinates[standing_rows[0]].tolist()
    return lat, lon, height


def sort_samples(time: Floats, values: Floats) -> Samples:
    """Sort rows by time, and discard rows with a repeated time or with a value that is not finite.

    time: times, s, (n,).
    values: values of the rows, (n, k).
    """
    is_finite = np.isfinite(time) & np.isfinite(values).all(axis=1)
    time, values = time[is_finite], values[is_finite]
    order = np.argsort(time, kind="stable")
    time, values = time[order], values[order]
    is_new = np.concatenate([[True], np.diff(time) > 0.0]) if len(time) else np.zeros(0, np.bool_)
    return Samples(time[is_new], values[is_new])
