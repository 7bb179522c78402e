"""Motion of an aircraft in a log, unthinned: inertial sensors, servos, attitude, air data, battery.

`logs.importers.raw_log` holds the vehicle's positions, for a verdict; this module holds the data that identify a model
of the aircraft.  `logs.importers.motion_log` reads it from logs.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from logs.importers.raw_log import VehicleKind
from world.arrays import Floats

# Number of servo outputs of `MotionLog.outputs`.
OUTPUTS = 14
# A vehicle that is slower than this stands on the ground, m/s.
_STANDING_SPEED_MPS = 2.0


@dataclass(frozen=True, slots=True)
class Samples:
    """Rows of one kind: time (n,) s of the log's clock, rising; values (n, k)."""

    time: Floats
    values: Floats

    @property
    def rate(self) -> float:
        """Median rate of rows, Hz; 0 for fewer than two rows."""
        return float(1.0 / max(1e-6, np.median(np.diff(self.time)))) if len(self.time) > 1 else 0.0


@dataclass(frozen=True, slots=True)
class MotionLog:
    """Motion in a log, in SI units and radians; data that are not logged have no rows.

    source: the file.  sha256: SHA-256 of its bytes.  program: name of the program.  vehicle: kind of vehicle.
    inertial: (n, 6) specific force forward, right, down, and p, q, r, of the first inertial sensor.
    outputs: (n, 14) servo outputs, microseconds, the first in column 0.
    attitude: (n, 3) roll, pitch, yaw.  velocity: (n, 3) north, east, down.  wind: (n, 2) north, east, as the air moves.
    airspeed: (n, 1) equivalent, m/s, of a sensor that was in use.  ratio: (n, 1) of true to equivalent airspeed.
    height: (n, 1) m AMSL.  battery: (n, 2) V and A.
    modes: time and number of the flight mode.  parameters: by name, the last value of each.
    program_kind: kind of program that wrote the log.
    controls: (n, 4) pitch up, roll and yaw to the right as fractions of full travel, and throttle (0..1), of a log that
        has them instead of pulses.
    angles: True for each of the first three controls that is a deflection, rad, instead of a fraction.
    elevons: true if the controls are made by elevons.
    hovering: periods on lifting motors (s) that the log itself names.
    home: latitude and longitude, degrees, and m AMSL: the last home of the vehicle (ORGN), or its first position on the
        ground; None if neither is logged.
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

    @property
    def surface_commands(self) -> Samples:
        """Commands to the surfaces: the controls if they are logged, or else the servo outputs."""
        return self.controls if len(self.controls.time) else self.outputs


def first_ground_position(position: Samples, velocity: Samples) -> tuple[float, float, float] | None:
    """Return the first position at which a vehicle stood still; None for a log that begins in flight.

    position: (n, 3) latitude, longitude (degrees) and height (m).  velocity: (n, 3) m/s.

    >>> place = Samples(np.array([1.0, 2.0]), np.array([[48.0, 11.0, 520.0], [48.0, 11.001, 540.0]]))
    >>> first_ground_position(place, Samples(np.array([0.0, 3.0]), np.zeros((2, 3))))
    (48.0, 11.0, 520.0)
    """
    if not len(position.time) or not len(velocity.time):
        return None
    time, place = position.time, position.values
    speed = np.interp(time, velocity.time, np.linalg.norm(velocity.values, axis=1), left=np.inf, right=np.inf)
    is_valid = (np.abs(place[:, :2]) <= [90.0, 180.0]).all(axis=1) & (place[:, :2] != 0.0).any(axis=1)
    standing = np.flatnonzero(is_valid & (speed < _STANDING_SPEED_MPS))
    if not len(standing):
        return None
    lat, lon, height = place[standing[0]].tolist()
    return lat, lon, height


def sort_samples(time: Floats, values: Floats) -> Samples:
    """Sort rows by time; leave out repeated times and rows with values that are not finite."""
    is_finite = np.isfinite(time) & np.isfinite(values).all(axis=1)
    time, values = time[is_finite], values[is_finite]
    order = np.argsort(time, kind="stable")
    time, values = time[order], values[order]
    keep = np.concatenate([[True], np.diff(time) > 0.0]) if len(time) else np.zeros(0, np.bool_)
    return Samples(time[keep], values[keep])
