import zipfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import pytest

from logs.importers.open_log import FORMATS, MAX_BYTES, detect_log_format, is_imported_log, open_log
from tests.logs.importers.written_logs import columns, dataflash, gpx, igc, kml, px4, telemetry
from world.errors import LogError

WRITERS: dict[str, tuple[str, Callable[[Path], Path]]] = {
    "ArduPilot dataflash log": (".BIN", dataflash),
    "MAVLink telemetry log": (".tlog", telemetry),
    "PX4 log": (".ulg", px4),
    "GPX track": (".gpx", gpx),
    "IGC flight recorder file": (".igc", igc),
    "KML track": (".kml", kml),
    "table of columns": (".columns.toml", columns),
}


@pytest.mark.parametrize("name", WRITERS)
def test_each_format_is_told_from_the_others(tmp_path: Path, name: str) -> None:
    suffix, write = WRITERS[name]
    path = write(tmp_path / f"a{suffix}")
    assert is_imported_log(path)
    assert open_log(path).format == name


@pytest.mark.parametrize("name", ["PX4 log", "ArduPilot dataflash log", "GPX track"])
def test_by_what_is_in_it_whatever_it_is_called(tmp_path: Path, name: str) -> None:
    path = WRITERS[name][1](tmp_path / "a.igc")
    assert open_log(path).format == name


@pytest.mark.parametrize(
    ("name", "head", "format_name"),
    [
        ("a.BIN", bytes(512), "ArduPilot .BIN"),
        ("a.tlog", bytes(100) + b"\xa3\x95" + bytes(9) + b"\x00\x05" + bytes(6) + b"\xfd", "MAVLink .tlog"),
        ("a.bin", b"\xa3\x95" + b"\x00\x05" + bytes(6) + b"\xfd", "ArduPilot .BIN"),
        ("a.igc", b"AXXX001\r\n", ".igc"),
        ("a.txt", b"AXXX001\rHFDTE160726\r", ".igc"),
        ("a.xml", b"\xef\xbb\xbf<?xml version='1.0'?>\n<GPX>", ".gpx"),
        ("a.gpx", b"<?xml version='1.0'?><kml>", ".kml or .kmz"),
        ("a.ulg", b"ULog\x01\x12\x36", "PX4 .ulg"),
    ],
)
def test_the_suffix_decides_where_the_first_bytes_do_not(name: str, head: bytes, format_name: str) -> None:
    assert detect_log_format(Path(name), head).name == format_name


def test_a_log_whose_first_page_is_lost_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.tlog"
    path.write_bytes(bytes(600) + telemetry(tmp_path / "whole.tlog").read_bytes())
    assert open_log(path).damage.size == 600


def test_every_reader_is_there() -> None:
    for known in FORMATS:
        module, function = known.reader.rsplit(".", 1)
        assert callable(getattr(import_module(f"logs.importers.{module}"), function))


def test_a_log_that_claims_ten_gigabytes_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.BIN"
    with path.open("wb") as file:
        file.truncate(10 * 2**30)
    with pytest.raises(LogError, match=f"too large: 10,737,418,240 bytes; the limit is {MAX_BYTES:,} bytes"):
        open_log(path)


@pytest.mark.parametrize("data", [b"", b"\x00" * 600, b"hello, this is no log at all"])
def test_what_is_no_log_is_refused_in_a_line(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "a.BIN"
    path.write_bytes(data)
    with pytest.raises(LogError) as caught:
        open_log(path)
    assert "\n" not in str(caught.value)


def test_what_neither_its_bytes_nor_its_name_tell_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    path.write_bytes(b"hello, this is no log at all")
    with pytest.raises(LogError, match=r"not a known log format \(it starts with b'hello, t'\); expected PX4 \.ulg"):
        open_log(path)


def test_a_folder_is_no_log(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="is a folder; expected a log"):
        open_log(tmp_path)


def test_a_zipped_track_is_read_as_the_track_in_it(tmp_path: Path) -> None:
    track, path = kml(tmp_path / "doc.kml"), tmp_path / "a.kmz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.write(track, "doc.kml")
    one, other = open_log(track), open_log(path)
    assert one.series["position"].values.tolist() == other.series["position"].values.tolist()
    assert is_imported_log(path)


def test_a_log_as_text_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    path.write_text("FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\nPARM, 1, RLL_P, 0.3\n")
    with pytest.raises(LogError, match=r"a dataflash log converted to text; open the original \.BIN"):
        open_log(path)
    assert is_imported_log(path)
