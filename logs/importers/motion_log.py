"""Read the motion of an aircraft from a log of any format.

ArduPilot's dataflash logs are read in this module.
"""

import hashlib
import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from logs.importers.columns.file_names import DATA_SUFFIXES, is_column_table_name
from logs.importers.dataflash_frames import Dataflash, MappedFile, Messages, index_dataflash
from logs.importers.dataflash_log import find_firmware_and_vehicle, find_logged_home
from logs.importers.motion import OUTPUTS, MotionLog, Samples, find_first_ground_position, sort_samples
from world.errors import LogError
from world.extras import require_extra
from world.files import missing_text

_DEGREE = math.pi / 180.0
# Messages that are read.
_NAMES = (
    "IMU",
    "RCOU",
    "ATT",
    "XKF1",
    "NKF1",
    "XKF2",
    "NKF2",
    "ARSP",
    "CTUN",
    "POS",
    "BAT",
    "CURR",
    "MODE",
    "PARM",
    "MSG",
    "VER",
    "ORGN",
)
# Fields with the number of the sensor or estimator, in logs of different releases.
_INSTANCES = ("I", "C", "Inst", "Instance")


def read_motion(path: Path) -> MotionLog:
    """Read the motion of an aircraft from a log of any supported format.

    The content of the file or its suffix shows the format.  Raises LogError for a file that cannot be read, or that is
    not a log of inertial sensors and servo outputs, and MissingExtraError if the extra for its format is not installed.
    """
    try:
        if not path.is_file():
            expected = "expected a log (.BIN, .tlog, .ulg or a table of columns)"
            raise LogError(f"{path}: {missing_text(path)}; {expected}", file=path)
        if is_column_table_name(path) or path.suffix.lower() in DATA_SUFFIXES:
            require_extra("data-logs", f"{path}: reading {path.suffix.lower()} needs")
            from logs.importers.columns.column_motion import read_column_motion

            return read_column_motion(path)
        with path.open("rb") as file:
            head = file.read(7)
            file.seek(0)
            digest = hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}", file=path) from error
    if head == b"ULog\x01\x12\x35":
        require_extra("px4-logs", f"{path}: reading .ulg needs")
        from logs.importers.px4_motion import read_px4_motion

        return read_px4_motion(path, digest)
    if path.suffix.lower() == ".tlog":
        require_extra("live", f"{path}: reading .tlog needs")
        from logs.importers.telemetry_motion import read_telemetry_motion

        return read_telemetry_motion(path, digest)
    if head[:2] != b"\xa3\x95":
        allowed = "expected an ArduPilot .BIN, a .tlog, a PX4 .ulg or a table of columns"
        raise LogError(
            f"{path}: not a log of inertial sensors and servo outputs: {allowed}", file=path, allowed=allowed
        )
    mapped = MappedFile(path)
    with np.errstate(all="ignore"):
        return _DataflashMotionReader(
            index_dataflash(mapped.data, _NAMES, mapped.release_memory), str(path), digest
        ).read()


class _DataflashMotionReader:
    """The reader of the motion in one ArduPilot dataflash log."""

    def __init__(self, index: Dataflash, source: str, digest: str) -> None:
        """Prepare to read a log; source: path of the log, digest: SHA-256 of its bytes."""
        self._index, self._source, self._digest = index, source, digest

    def read(self) -> MotionLog:
        """Read the motion of the aircraft."""
        events = self._index.messages("MSG")
        texts = events.texts("Message") if events.has("Message") else []
        program, vehicle = find_firmware_and_vehicle(texts, self._index.messages("VER"))
        velocity = self._read_first_samples((name, ("VN", "VE", "VD")) for name in ("XKF1", "NKF1"))
        inertial = self._read_first_samples((("IMU", ("AccX", "AccY", "AccZ", "GyrX", "GyrY", "GyrZ")),))
        # Rows of a sensor that was not in use are left out.
        messages = self._select_messages("ARSP")
        if not messages.has("TimeUS", "Airspeed"):
            measured_airspeed = Samples(np.zeros(0), np.zeros((0, 1)))
        else:
            is_used = messages.column("U") > 0 if messages.has("U") else np.ones(len(messages), np.bool_)
            measured_airspeed = sort_samples(
                messages.column("TimeUS")[is_used] * 1e-6, messages.column("Airspeed")[is_used, np.newaxis]
            )
        messages = self._select_messages("MODE")
        column = "ModeNum" if messages.has("ModeNum") else "Mode"
        modes = []
        if messages.has("TimeUS", column) and messages.rows.dtype[column].kind != "S":
            modes = list(
                zip(
                    (messages.column("TimeUS") * 1e-6).tolist(),
                    messages.column(column).astype(int).tolist(),
                    strict=True,
                )
            )
        messages = self._select_messages("PARM")
        parameters: dict[str, float] = {}
        if messages.has("Name", "Value"):
            values = zip(messages.texts("Name"), messages.column("Value").tolist(), strict=True)
            parameters = {name: value for name, value in values if math.isfinite(value)}
        home = find_logged_home(self._index.messages("ORGN"))
        home_position = (
            (home.lat_deg, home.lon_deg, home.alt)
            if home is not None
            else find_first_ground_position(self._read_first_samples((("POS", ("Lat", "Lng", "Alt")),)), velocity)
        )
        return MotionLog(
            source=self._source,
            sha256=self._digest,
            program=program,
            vehicle=vehicle,
            inertial=inertial,
            outputs=self._read_first_samples((("RCOU", tuple(f"C{k}" for k in range(1, OUTPUTS + 1))),)),
            attitude=self._read_first_samples((("ATT", ("Roll", "Pitch", "Yaw")),), _DEGREE),
            velocity=velocity,
            wind=self._read_first_samples((name, ("VWN", "VWE")) for name in ("XKF2", "NKF2")),
            airspeed=measured_airspeed,
            ratio=self._read_first_samples((("CTUN", ("E2T",)),)),
            height=self._read_first_samples((("POS", ("Alt",)),)),
            battery=self._read_first_samples((("BAT", ("Volt", "Curr")), ("CURR", ("Volt", "Curr")))),
            modes=tuple(modes),
            parameters=parameters,
            home=home_position,
        )

    def _select_messages(self, name: str) -> Messages:
        """Return the messages with a name.

        If several sensors or estimators log them, only those of the first one are returned.
        """
        messages = self._index.messages(name)
        for column in _INSTANCES:
            if name in ("IMU", "XKF1", "XKF2", "NKF1", "NKF2", "ARSP", "BAT") and messages.has(column):
                number = messages.rows[column]
                messages = messages.select(number == number.min()) if number.dtype.kind in "ui" else messages
        return messages

    def _read_first_samples(self, choices: Iterable[tuple[str, tuple[str, ...]]], scale: float = 1.0) -> Samples:
        """Read a quantity that several messages can state from the first of them that the log contains.

        The result has no rows if the log contains none of them.  Servo outputs that RCOU lacks are 0.

        choices: name and fields of each message, in the order of preference.
        scale: factor by which the values are multiplied.
        """
        for name, columns in choices:
            messages = self._select_messages(name)
            # Logs of older releases have fewer outputs.
            present_columns = [column for column in columns if messages.has("TimeUS", column)]
            if not present_columns or (name != "RCOU" and len(present_columns) < len(columns)):
                continue
            values = np.zeros((len(messages), len(columns)))
            for k, column in enumerate(columns):
                if column in present_columns:
                    values[:, k] = messages.column(column)
            return sort_samples(messages.column("TimeUS") * 1e-6, values * scale)
        return Samples(np.zeros(0), np.zeros((0, 1)))
