import io
import math
import re
import struct
import subprocess
import sys
import threading
import warnings
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from flight.mission.items import Home
from logs.importers import px4_log
from logs.importers.clean_positions import clean_positions
from logs.importers.logged_missions import describe_plane_mode, describe_px4_mode, describe_px4_state
from logs.importers.open_log import open_log
from logs.importers.px4_log import find_damage, read_px4
from logs.importers.raw_log import example_raw_log
from tests.logs.importers.written_logs import px4
from world.errors import LogError
from world.silent_output import silence


def test_auto_alone_follows_the_mission() -> None:
    assert [number for number in range(30) if describe_plane_mode(number)[1]] == [10]
    assert describe_plane_mode(99) == ("mode 99", False)


def test_of_px4_the_mission_state_alone_follows_it() -> None:
    assert [number for number in range(30) if describe_px4_state(number)[1]] == [3]
    assert describe_px4_mode(4 << 24 | 4 << 16) == ("MISSION", True)
    assert describe_px4_mode(5 << 24 | 4 << 16) == ("RTL", False)


def test_rows_are_what_pyulog_reads(tmp_path: Path) -> None:
    path = px4(tmp_path / "a.ulg")
    raw, log = read_px4(path), ULog(str(path))
    place = log.get_dataset("vehicle_global_position").data
    position = raw.series["position"]
    assert len(position.time) == len(place["timestamp"]) == 460
    for k in np.linspace(0, 459, 10).astype(int):
        assert position.time[k] == pytest.approx(place["timestamp"][k] * 1e-6)
        assert position.values[k].tolist() == [place["lat"][k], place["lon"][k], place["alt"][k]]


def test_standard_output_is_given_back_after_two_threads_suppressed_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A log is opened while another thread, which loads JSBSim, suppresses the output, and is closed after it."""
    path, stdout, has_opened, may_close = px4(tmp_path / "a.ulg"), sys.stdout, threading.Event(), threading.Event()

    def read(*_: object, **__: object) -> None:
        has_opened.set()
        may_close.wait(60.0)
        raise ValueError("read no further")

    def open_log_in_thread() -> None:
        with suppress(LogError):
            read_px4(path)

    monkeypatch.setattr(px4_log, "ULog", read)
    with silence():
        thread = threading.Thread(target=open_log_in_thread)
        thread.start()
        # With a lock the log is not opened yet.
        has_opened.wait(0.3)
    may_close.set()
    thread.join()
    assert sys.stdout is stdout


def test_attitudes_are_the_angles_of_the_quaternion(tmp_path: Path) -> None:
    raw, wanted = read_px4(px4(tmp_path / "a.ulg")), example_raw_log().series["attitude"]
    assert np.abs(raw.series["attitude"].values - wanted.values).max() < 1e-6


def test_as_pyulog_writes_it_again(tmp_path: Path) -> None:
    """Another writer: pyulog's own."""
    first = px4(tmp_path / "a.ulg")
    again = tmp_path / "b.ulg"
    ULog(str(first)).write_ulog(str(again))
    one, other = read_px4(first), read_px4(again)
    for name in one.series:
        assert np.array_equal(one.series[name].values, other.series[name].values)
    assert not other.damage.lossy


def test_the_mission_is_of_the_items_that_became_current(tmp_path: Path) -> None:
    (logged,) = read_px4(px4(tmp_path / "a.ulg")).missions
    wanted = example_raw_log().missions[0].mission.items
    places = [(item.seq, item.lat_deg, item.lon_deg, item.alt) for item in logged.mission.items]
    assert places == [(item.seq, item.lat_deg, item.lon_deg, item.alt) for item in wanted]


def test_vehicle_and_mode(tmp_path: Path) -> None:
    raw = read_px4(px4(tmp_path / "a.ulg"))
    assert (raw.vehicle, raw.modes[0].name, raw.modes[0].automatic) == ("plane", "MISSION", True)
    assert read_px4(px4(tmp_path / "b.ulg", vehicle_type=1)).vehicle == "copter"
    assert not read_px4(px4(tmp_path / "c.ulg", nav_state=4)).modes[0].automatic


def test_a_cut_and_a_hole_are_told(tmp_path: Path) -> None:
    data = np.fromfile(px4(tmp_path / "a.ulg"), np.uint8)
    whole = find_damage(data)
    assert not whole.lossy
    assert not whole.cut
    assert find_damage(data[:-3]).cut
    half = len(data) // 2
    assert find_damage(np.concatenate([data[:half], data[half + 7 :]])).places == 1


def test_what_is_none_is_refused_in_a_line(tmp_path: Path) -> None:
    path = tmp_path / "a.ulg"
    path.write_bytes(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + b"\x00" * 40)
    with pytest.raises(LogError) as caught:
        read_px4(path)
    assert "\n" not in str(caught.value)


def test_nothing_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = px4(tmp_path / "a.ulg")
    path.write_bytes(path.read_bytes()[:3000] + bytes(50) + path.read_bytes()[3000:])
    with io.StringIO():
        read_px4(path)
    assert capsys.readouterr() == ("", "")


def test_a_record_that_claims_more_than_the_file_has_is_not_read_for_ever(tmp_path: Path) -> None:
    """In its definitions pyulog steps back by what a record claims, and comes by the same place again."""
    path = px4(tmp_path / "a.ulg")
    data = path.read_bytes()
    first = data.index(b"vehicle_global_position", data.index(b"sys_namePX4")) - 6
    path.write_bytes(data[:first] + struct.pack("<HB", 200, 0) + b"\xff\xff\x01" * 20)
    code = f"from pathlib import Path\nfrom logs.importers.px4_log import read_px4\nread_px4(Path({str(path)!r}))"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert "the flown position is unknown" in ran.stderr


def test_numbers_that_no_place_or_time_has_are_passed_over(tmp_path: Path) -> None:
    """An item at 1e300 degrees, a time of 2^64 us, a place at a signalling NaN."""
    path = px4(tmp_path / "a.ulg")
    data = bytearray(path.read_bytes())
    item = example_raw_log().missions[0].mission.items[1]
    at = data.index(struct.pack("<dd", item.lat_deg, item.lon_deg))
    data[at : at + 8] = struct.pack("<d", 1e300)
    rows = [found.start() for found in re.finditer(re.escape(struct.pack("<HcH", 28 + 2, b"D", 0)), data)]
    data[rows[10] + 5 : rows[10] + 13] = b"\xff" * 8
    data[rows[20] + 29 : rows[20] + 33] = struct.pack("<I", 0x7F80_0001)
    path.write_bytes(bytes(data))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        raw = open_log(path)
    missing = raw.missions[0].missing
    assert missing is not None
    assert (missing.numbers, missing.total) == ((2,), 3)
    places = clean_positions(raw.series["position"])
    assert (len(places.time), places.faults.unusable) == (458, 2)


@pytest.mark.parametrize("off", [math.nan, math.inf, 4e6, -1e6])
def test_a_length_that_no_mission_has_says_nothing(tmp_path: Path, off: float) -> None:
    (logged,) = open_log(px4(tmp_path / "a.ulg", numbers_off=(off, 0.0))).missions
    assert (len(logged.mission.items), logged.missing) == (3, None)


@pytest.mark.parametrize("off", [math.nan, -math.inf, 4e6, -1e6])
def test_an_item_with_a_number_that_none_has_is_lost(tmp_path: Path, off: float) -> None:
    (logged,) = open_log(px4(tmp_path / "a.ulg", numbers_off=(0.0, off))).missions
    assert logged.missing is not None
    assert (logged.missing.numbers, logged.missing.total) == ((1,), 3)


def test_home_is_the_vehicles(tmp_path: Path) -> None:
    """Items that count their heights from home need it."""
    path = px4(tmp_path / "a.ulg")
    data = path.read_bytes()
    form = b"home_position:uint64_t timestamp;double lat;double lon;float alt;"
    used = struct.pack("<HcBH", 3 + 13, b"A", 0, 77) + b"home_position"
    row = struct.pack("<HcHQddf", 30, b"D", 77, 20_000_000, 46.25, 8.25, 431.5)
    first = data.index(b"A\x00\x00\x00vehicle") - 2
    path.write_bytes(data[:first] + struct.pack("<Hc", len(form), b"F") + form + used + data[first:] + row)
    (logged,) = read_px4(path).missions
    assert logged.mission.home == Home(46.25, 8.25, 431.5)
    assert read_px4(px4(tmp_path / "b.ulg")).missions[0].mission.home is None
