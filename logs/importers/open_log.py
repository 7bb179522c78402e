"""Detect the format of another program's flight log, and read it with the format's reader."""

import re
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from logs.importers.columns.file_names import DATA_SUFFIXES, TABLE_SUFFIX, is_column_table_name
from world.address_space import AddressSpaceError
from world.errors import LogError
from world.extras import require_extra
from world.files import missing_text

if TYPE_CHECKING:
    from logs.importers.raw_log import RawLog

    Reader = Callable[[Path], RawLog]


class LogFormat(NamedTuple):
    """A format of logs.

    name: name in messages.
    suffixes: suffixes of the format's files, in lower case.
    content: regular expression that matches in the first bytes of the format's files.
    reader: module and function of the reader, which takes a path, returns a `RawLog` and raises LogError.  It is
        imported only when needed, because each reader needs another library.
    extra: planfly extra with the reader's library; "" if no extra is needed.
    """

    name: str
    suffixes: tuple[str, ...]
    content: bytes
    reader: str
    extra: str = ""


# All formats.  If the first bytes of a file fit several formats, the suffix decides, and then this order.
FORMATS = (
    LogFormat("PX4 .ulg", (".ulg",), rb"\AULog\x01\x12\x35", "px4_log.read_px4", "px4-logs"),
    LogFormat("ArduPilot .BIN", (".bin",), rb"\xa3\x95", "dataflash_log.read_dataflash"),
    # Eight bytes of time, big-endian us since 1970 (2000 to 2111), and the first byte of a MAVLink packet.
    LogFormat("MAVLink .tlog", (".tlog",), rb"\x00[\x03-\x0f].{6}[\xfd\xfe]", "telemetry_log.read_telemetry", "live"),
    LogFormat(".gpx", (".gpx",), rb"<gpx", "track_files.read_gpx"),
    LogFormat(".igc", (".igc",), rb"(\A|[\r\n])HFDTE", "track_files.read_igc"),
    LogFormat(
        "columns as .csv, .mat, .parquet or .h5",
        (TABLE_SUFFIX, *DATA_SUFFIXES),
        rb"\APAR1|\A\x89HDF|\AMATLAB [57]\.",
        "columns.column_raw.read_columns",
        "data-logs",
    ),
    LogFormat(".kml or .kmz", (".kml", ".kmz"), rb"<kml|\APK\x03\x04", "track_files.read_kml"),
)
SUFFIXES = tuple(suffix for known in FORMATS for suffix in known.suffixes)
# First bytes of a dataflash log that was converted to text, which is refused.
_AS_TEXT = rb"\A\s*FMT, ?128,"
# Suffix of a dataflash log as text.
_TEXT_SUFFIX = ".log"
# Largest size of a log, bytes; a day of a vehicle that logs everything takes less.
MAX_BYTES = 2 * 2**30
_HEAD = 512


def is_imported_log(path: Path) -> bool:
    """Return True if a path has the suffix of another program's log.

    >>> is_imported_log(Path("00000042.BIN")), is_imported_log(Path("flight.mcap"))
    (True, False)
    """
    return _find_suffix(path) in (*SUFFIXES, _TEXT_SUFFIX)


def _find_suffix(path: Path) -> str:
    """Return the suffix of a file in lower case, or `TABLE_SUFFIX` for a table of columns."""
    return TABLE_SUFFIX if is_column_table_name(path) else path.suffix.lower()


def open_log(path: Path) -> "RawLog":
    """Read a log of another program in any supported format.

    Raises LogError for a file that cannot be read, a file that is not a log, and a log without positions or times.
    Raises MissingExtraError if the extra for its format is not installed.

    >>> open_log(Path("nothing.BIN"))  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    world.errors.LogError: nothing.BIN: no such file; expected a log (.ulg, .bin, .tlog, .gpx, .igc, ...)
    """
    import numpy as np

    try:
        if not path.is_file():
            raise LogError(f"{path}: {missing_text(path)}; expected a log ({', '.join(SUFFIXES)})", file=path)
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise LogError(f"{path}: too large: {size:,} bytes; the limit is {MAX_BYTES:,} bytes", file=path)
        with path.open("rb") as file:
            head = file.read(_HEAD)
        if not head:
            raise LogError(f"{path}: empty; expected a log", file=path)
        log_type = detect_log_format(path, head)
        if log_type.extra:
            require_extra(log_type.extra, f"{path}: reading {_find_suffix(path)} needs")
        module, function = log_type.reader.rsplit(".", 1)
        read: Reader = getattr(import_module(f"logs.importers.{module}"), function)
        # Invalid numbers of a damaged log are left out later, and reported.
        with np.errstate(all="ignore"):
            return read(path)
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}", file=path) from error
    except AddressSpaceError:
        raise
    except MemoryError:
        raise LogError(f"{path}: the size stated in the file does not fit into memory", file=path) from None


def detect_log_format(path: Path, head: bytes) -> LogFormat:
    """Return the format of a log, detected by the first bytes and the suffix of its file.

    If they contradict each other, the first bytes decide.  Raises LogError if neither is known, and for a dataflash log
    that was converted to text.

    head: first bytes of the file.

    >>> detect_log_format(Path("flight.igc"), b"<gpx>").name, detect_log_format(Path("a.BIN"), bytes(9)).name
    ('.gpx', 'ArduPilot .BIN')
    """
    if re.search(_AS_TEXT, head, re.IGNORECASE):
        raise LogError(f"{path}: a dataflash log converted to text; open the original .BIN", file=path)
    by_content = [log_type for log_type in FORMATS if re.search(log_type.content, head, re.DOTALL | re.IGNORECASE)]
    by_suffix = [log_type for log_type in FORMATS if _find_suffix(path) in log_type.suffixes]
    if not by_content and not by_suffix:
        names = ", ".join(log_type.name for log_type in FORMATS)
        message = f"not a known log format (it starts with {head[:8]!r}); expected {names}"
        raise LogError(f"{path}: {message}", file=path)
    return next((log_type for log_type in by_suffix if log_type in by_content), (by_content or by_suffix)[0])
