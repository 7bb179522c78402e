"""What a log holds of an aircraft's motion, unthinned: inertial sensors, servo outputs, attitude, air data, battery.

`logs.importers.raw_log` has what a verdict needs, where a vehicle was; this is what identifies its model.  ArduPilot's
logs are read here, PX4's by `logs.importers.px4_motion`.
"""

import hashlib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from logs.importers.dataflash_frames import Dataflash, MappedFile, Messages, index_dataflash
from logs.importers.dataflash_log import logged_home, program_and_vehicle
from logs.importers.raw_log import VehicleKind
from world.errors import LogError
from world.extras import need_extra

Floats = NDArray[np.float64]

# Slower than this it stands on the ground, m/s.
_STANDING = 2.0


@dataclass(frozen=True, slots=True)
class Samples:
    """Rows of one kind: time (n,) s of the log's clock, rising; values (n, k)."""

    time: Floats
    values: Floats

    @property
    def rate(self) -> float:
        """Rows a second, by the median step; 0 of fewer than two."""
        return float(1.0 / max(1e-6, np.median(np.diff(self.time)))) if len(self.time) > 1 else 0.0


@dataclass(frozen=True, slots=True)
class MotionLog:
    """A log's motion.  SI and radians; none of a kind has no rows.

    source: the file.  sha256: of its bytes.  program: what flew.  vehicle: what it is.
    inertial: (n, 6) specific force forward, right, down, and p, q, r, of the first inertial sensor.
    outputs: (n, 14) servo outputs, microseconds, the first in column 0.
    attitude: (n, 3) roll, pitch, yaw.  velocity: (n, 3) north, east, down.  wind: (n, 2) north, east, as it moves.
    airspeed: (n, 1) equivalent, m/s, of a sensor that was in use.  ratio: (n, 1) true by equivalent airspeed.
    height: (n, 1) m above sea level.  battery: (n, 2) V and A.
    modes: time and number of the flight mode.  parameters: by name; those that changed in flight keep the last.
    program_kind: whose log it is.
    controls: (n, 4) pitch up, roll and yaw to the right as shares of full travel, and throttle (0..1), of a log that
        has those in place of pulses.
    elevons: whether the controls are made by elevons.
    hovering: stretches (s) on lifting motors that the log names itself.
    home: latitude and longitude, degrees, and m above sea level: as the vehicle had it last (ORGN), or its first
        position on the ground; None where neither is logged.
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
    program_kind: Literal["ardupilot", "px4"] = "ardupilot"
    controls: Samples = field(default_factory=lambda: Samples(np.zeros(0), np.zeros((0, 4))))
    elevons: bool = False
    hovering: tuple[tuple[float, float], ...] = ()

    @property
    def moved(self) -> Samples:
        """What was told to the surfaces: controls where the log has them, or else pulses."""
        return self.controls if len(self.controls.time) else self.outputs


_DEGREE = math.pi / 180.0
_NAMES = (
    "IMU", "RCOU", "ATT", "XKF1", "NKF1", "XKF2", "NKF2", "ARSP", "CTUN", "POS", "BAT", "CURR", "MODE", "PARM", "MSG",
    "VER", "ORGN",
)  # fmt: skip
_INSTANCES = ("I", "C", "Inst", "Instance")
OUTPUTS = 14


def read_motion(path: Path) -> MotionLog:
    """Read a log's motion.  Raises LogError, in one line, for a file that cannot be read or that is no such log."""
    try:
        if not path.is_file():
            raise LogError(f"{path}: no such file: a log (.BIN or .ulg) is expected", file=path)
        with path.open("rb") as file:
            head = file.read(7)
            file.seek(0)
            digest = hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}", file=path) from error
    if head == b"ULog\x01\x12\x35":
        need_extra("px4-logs", f"{path}: reading .ulg needs")
        from logs.importers.px4_motion import read_px4_motion

        return read_px4_motion(path, digest)
    if head[:2] != b"\xa3\x95":
        allowed = "an ArduPilot .BIN or a PX4 .ulg is expected"
        raise LogError(
            f"{path}: not a log of inertial sensors and servo outputs: {allowed}", file=path, allowed=allowed
        )
    mapped = MappedFile(path)
    with np.errstate(all="ignore"):
        return _Dataflash(index_dataflash(mapped.data, _NAMES, mapped.let_go), str(path), digest).read()


class _Dataflash:
    """One dataflash log."""

    def __init__(self, index: Dataflash, source: str, digest: str) -> None:
        self._index, self._source, self._digest = index, source, digest

    def read(self) -> MotionLog:
        events = self._index.messages("MSG")
        texts = events.texts("Message") if events.has("Message") else []
        program, vehicle = program_and_vehicle(texts, self._index.messages("VER"))
        velocity = self._first((name, ("VN", "VE", "VD")) for name in ("XKF1", "NKF1"))
        inertial = self._first((("IMU", ("AccX", "AccY", "AccZ", "GyrX", "GyrY", "GyrZ")),))
        return MotionLog(
            source=self._source,
            sha256=self._digest,
            program=program,
            vehicle=vehicle,
            inertial=inertial,
            outputs=self._first((("RCOU", tuple(f"C{k}" for k in range(1, OUTPUTS + 1))),)),
            attitude=self._first((("ATT", ("Roll", "Pitch", "Yaw")),), _DEGREE),
            velocity=velocity,
            wind=self._first((name, ("VWN", "VWE")) for name in ("XKF2", "NKF2")),
            airspeed=self._airspeed(),
            ratio=self._first((("CTUN", ("E2T",)),)),
            height=self._first((("POS", ("Alt",)),)),
            battery=self._first((("BAT", ("Volt", "Curr")), ("CURR", ("Volt", "Curr")))),
            modes=tuple(self._modes()),
            parameters=self._parameters(),
            home=self._home(velocity),
        )

    def _messages(self, name: str) -> Messages:
        """Of the first instance where there are several."""
        found = self._index.messages(name)
        for column in _INSTANCES:
            if name in ("IMU", "XKF1", "XKF2", "NKF1", "NKF2", "ARSP", "BAT") and found.has(column):
                number = found.rows[column]
                found = found.only(number == number.min()) if number.dtype.kind in "ui" else found
        return found

    def _first(self, choices: Iterable[tuple[str, tuple[str, ...]]], scale: float = 1.0) -> Samples:
        for name, columns in choices:
            found = self._messages(name)
            # Logs of older releases have fewer outputs.
            held = [column for column in columns if found.has("TimeUS", column)]
            if not held or (name != "RCOU" and len(held) < len(columns)):
                continue
            values = np.zeros((len(found), len(columns)))
            for k, column in enumerate(columns):
                if column in held:
                    values[:, k] = found.column(column)
            return rising(found.column("TimeUS") * 1e-6, values * scale)
        return Samples(np.zeros(0), np.zeros((0, 1)))

    def _airspeed(self) -> Samples:
        found = self._messages("ARSP")
        if not found.has("TimeUS", "Airspeed"):
            return Samples(np.zeros(0), np.zeros((0, 1)))
        used = found.column("U") > 0 if found.has("U") else np.ones(len(found), np.bool_)
        return rising(found.column("TimeUS")[used] * 1e-6, found.column("Airspeed")[used, np.newaxis])

    def _modes(self) -> list[tuple[float, int]]:
        found = self._messages("MODE")
        column = "ModeNum" if found.has("ModeNum") else "Mode"
        if not found.has("TimeUS", column) or found.rows.dtype[column].kind == "S":
            return []
        return list(
            zip((found.column("TimeUS") * 1e-6).tolist(), found.column(column).astype(int).tolist(), strict=True)
        )

    def _parameters(self) -> dict[str, float]:
        found = self._messages("PARM")
        if not found.has("Name", "Value"):
            return {}
        values = zip(found.texts("Name"), found.column("Value").tolist(), strict=True)
        return {name: value for name, value in values if math.isfinite(value)}

    def _home(self, velocity: Samples) -> tuple[float, float, float] | None:
        home = logged_home(self._index.messages("ORGN"))
        if home is not None:
            return home.lat_deg, home.lon_deg, home.alt
        return first_on_ground(self._first((("POS", ("Lat", "Lng", "Alt")),)), velocity)


def first_on_ground(position: Samples, velocity: Samples) -> tuple[float, float, float] | None:
    """The first position at which a vehicle stood still; None of a log that begins in flight.

    position: (n, 3) latitude, longitude (degrees) and height (m).  velocity: (n, 3) m/s.

    >>> place = Samples(np.array([1.0, 2.0]), np.array([[48.0, 11.0, 520.0], [48.0, 11.001, 540.0]]))
    >>> first_on_ground(place, Samples(np.array([0.0, 3.0]), np.zeros((2, 3))))
    (48.0, 11.0, 520.0)
    """
    if not len(position.time) or not len(velocity.time):
        return None
    time, place = position.time, position.values
    speed = np.interp(time, velocity.time, np.linalg.norm(velocity.values, axis=1), left=np.inf, right=np.inf)
    known = (np.abs(place[:, :2]) <= [90.0, 180.0]).all(axis=1) & (place[:, :2] != 0.0).any(axis=1)
    standing = np.flatnonzero(known & (speed < _STANDING))
    if not len(standing):
        return None
    lat, lon, height = place[standing[0]].tolist()
    return lat, lon, height


def rising(time: Floats, values: Floats) -> Samples:
    """Rows in the order of their times; those that are no numbers and those of the same time left out."""
    good = np.isfinite(time) & np.isfinite(values).all(axis=1)
    time, values = time[good], values[good]
    order = np.argsort(time, kind="stable")
    time, values = time[order], values[order]
    keep = np.concatenate([[True], np.diff(time) > 0.0]) if len(time) else np.zeros(0, np.bool_)
    return Samples(time[keep], values[keep])
