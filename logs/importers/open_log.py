"""Whatever log a person brings: told by its first bytes and its suffix, and read."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from logs.importers.raw_log import RawLog
from world.errors import LogError

# A day of a vehicle that logs all it can takes less.
MAX_BYTES = 2 * 2**30
SUFFIXES = (".bin", ".tlog", ".ulg", ".gpx", ".igc", ".kml", ".kmz")
# Refused by name.
_NAMED = (".log",)
_HEAD = 512
_PX4_MAGIC, _ZIP_MAGIC = b"ULog\x01\x12\x35", b"PK\x03\x04"


def is_imported_log(path: Path) -> bool:
    """Whether a file is a log that others write, by its suffix.

    >>> is_imported_log(Path("00000042.BIN")), is_imported_log(Path("flight.mcap"))
    (True, False)
    """
    return path.suffix.lower() in (*SUFFIXES, *_NAMED)


def open_log(path: Path) -> RawLog:
    """Read a log.  Raises LogError, in one line, for a file that is none or that holds no place and time.

    >>> open_log(Path("nothing.BIN"))
    Traceback (most recent call last):
    world.errors.LogError: nothing.BIN: no such file: a log (.bin, .tlog, .ulg, .gpx, .igc, .kml, .kmz) is expected
    """
    try:
        if not path.is_file():
            raise LogError(f"{path}: no such file: a log ({', '.join(SUFFIXES)}) is expected", file=path)
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise LogError(f"{path}: {size:,} bytes: at most {MAX_BYTES:,} are read", file=path)
        with path.open("rb") as file:
            head = file.read(_HEAD)
        if not head:
            raise LogError(f"{path}: empty: a log is expected", file=path)
        # What is no number in a damaged log is left out later, and told.
        with np.errstate(all="ignore"):
            return _reader(path, head)(path)
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}", file=path) from error
    except MemoryError:
        raise LogError(f"{path}: claims more than fits into memory", file=path) from None


def _reader(path: Path, head: bytes) -> Callable[[Path], RawLog]:
    """What reads such a file; each brings its own library along."""
    if head.startswith(_PX4_MAGIC):
        from logs.importers.px4_log import read_px4

        return read_px4
    if b"\xa3\x95" in head[:_HEAD] and path.suffix.lower() not in (".tlog", ".ulg"):
        from logs.importers.dataflash_log import read_dataflash

        return read_dataflash
    if head.startswith(_ZIP_MAGIC):
        from logs.importers.track_files import read_kml

        return read_kml
    text = head.decode("utf-8", errors="replace").lstrip("\ufeff \r\n\t").lower()
    if text.startswith("<") or "<gpx" in text or "<kml" in text:
        if "<kml" in text or path.suffix.lower() == ".kml":
            from logs.importers.track_files import read_kml

            return read_kml
        from logs.importers.track_files import read_gpx

        return read_gpx
    if text.startswith("fmt, 128,") or text.startswith("fmt,128,"):
        raise LogError(f"{path}: a dataflash log as text: the .BIN that it was made of is read", file=path)
    if path.suffix.lower() == ".igc":
        from logs.importers.track_files import read_igc

        return read_igc
    from logs.importers.telemetry_log import looks_like_telemetry

    if path.suffix.lower() == ".tlog" or looks_like_telemetry(head):
        from logs.importers.telemetry_log import read_telemetry

        return read_telemetry
    raise LogError(
        f"{path}: not a log that is known (it starts with {head[:8]!r}): ArduPilot .BIN, MAVLink .tlog, PX4 .ulg,"
        " .gpx, .igc, .kml or .kmz is expected",
        file=path,
    )
