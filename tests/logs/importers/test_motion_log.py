from pathlib import Path

import numpy as np
import pytest

from logs.importers.motion import Samples, find_first_ground_position
from logs.importers.motion_log import read_motion
from tests.instrumented_flights import short_motion, write_motion
from world.errors import LogError


def test_what_was_written_is_read(tmp_path: Path) -> None:
    written = short_motion()
    read = read_motion(write_motion(tmp_path / "a.BIN", written))
    assert (read.vehicle, read.program, read.modes) == ("plane", written.program, written.modes)
    assert read.parameters == pytest.approx(dict(written.parameters))
    for name in ("inertial", "outputs", "attitude", "velocity", "wind", "airspeed", "ratio", "height", "battery"):
        mine, theirs = getattr(read, name), getattr(written, name)
        assert mine.time == pytest.approx(theirs.time, abs=1e-6), name
        assert mine.values == pytest.approx(theirs.values, rel=1e-5, abs=1e-5), name
    assert read.inertial.rate == pytest.approx(50.0, rel=0.01)
    assert len(read.sha256) == 64


def test_other_files_are_refused_in_one_line(tmp_path: Path) -> None:
    file = tmp_path / "a.gpx"
    file.write_text("<gpx/>", encoding="utf-8")
    for path, said in (
        (file, "expected an ArduPilot .BIN, a .tlog, a PX4 .ulg or"),
        (tmp_path / "no.BIN", "no such file"),
    ):
        with pytest.raises(LogError, match=said) as refused:
            read_motion(path)
        assert "\n" not in str(refused.value)


def test_rows_out_of_order_doubled_or_no_numbers_are_left_out(tmp_path: Path) -> None:
    written = short_motion()
    values = written.height.values.copy()
    values[3] = np.nan
    time = written.height.time.copy()
    time[6] = time[5]
    from dataclasses import replace

    read = read_motion(
        write_motion(tmp_path / "a.BIN", replace(written, height=replace(written.height, time=time, values=values)))
    )
    assert len(read.height.time) == len(time) - 2
    assert (np.diff(read.height.time) > 0.0).all()


def test_home_is_what_the_vehicle_had_and_nowhere_without(tmp_path: Path) -> None:
    from dataclasses import replace

    placed = replace(short_motion(), home=(47.25, -8.5, 430.0))
    assert read_motion(write_motion(tmp_path / "a.BIN", placed)).home == pytest.approx((47.25, -8.5, 430.0))
    assert read_motion(write_motion(tmp_path / "b.BIN", short_motion())).home is None


def test_the_first_position_on_the_ground_is_where_it_stood_still() -> None:
    position = Samples(np.arange(4.0), np.array([[0, 0, 0], [48, 11, 520], [48, 11.1, 521], [48, 12, 700]], np.float64))
    taking_off = Samples(np.array([0.0, 1.0, 2.0, 3.0]), np.array([[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0], [20, 0, 0.0]]))
    assert find_first_ground_position(position, taking_off) == (48.0, 11.0, 520.0)
    in_flight = Samples(taking_off.time, taking_off.values + np.array([15.0, 0.0, 0.0]))
    assert find_first_ground_position(position, in_flight) is None
