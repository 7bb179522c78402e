import io
import struct
from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from logs.field_logs.example_raw_log import example_raw_log
from logs.field_logs.readers.px4_log import find_damage, read_px4
from tests.logs.field_logs.written_logs import px4
from world.errors import LogError


def test_rows_are_what_pyulog_reads(tmp_path: Path) -> None:
    path = px4(tmp_path / "a.ulg")
    raw, log = read_px4(path), ULog(str(path))
    place = log.get_dataset("vehicle_global_position").data
    position = raw.series["position"]
    assert len(position.time) == len(place["timestamp"]) == 460
    for k in np.linspace(0, 459, 10).astype(int):
        assert position.time[k] == pytest.approx(place["timestamp"][k] * 1e-6)
        assert position.values[k].tolist() == [place["lat"][k], place["lon"][k], place["alt"][k]]


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
