"""Bad tables and bad files: one line that names file, field, value and what is expected."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from logs.importers.columns.column_checks import check_signs_and_units
from logs.importers.columns.column_log import ColumnLog
from logs.importers.motion_log import read_motion
from logs.importers.open_log import open_log
from tests.logs.importers.columns.column_files import TABLE, circle, write_log
from world.errors import LogError

TIME = circle()["t"]


def said(path: Path, read: Callable[[Path], object] = read_motion) -> str:
    with pytest.raises(LogError) as refused:
        read(path)
    message = str(refused.value)
    assert "\n" not in message
    assert refused.value.file
    return message


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        ('column = "vn"', 'column = "vnorth"', "columns.velocity_north.column: vnorth: no such column in flight.csv"),
        (
            '"roll", unit = "deg"',
            '"roll", unit = "rad"',
            r"has 20.16 rad: expected -3.2 to 3.2 rad; is it in deg\?",
        ),
        ('"thr", unit = "%"', '"thr", unit = "fraction"', r"thr has 90 fraction: .*; is it in %\?"),
        ('"vn", unit = "m/s"', '"vn", unit = "metres"', "columns.velocity_north.unit: metres: expected m/s, km/h, kt"),
        ('"vn", unit = "m/s"', '"vn"', "columns.velocity_north.unit: missing: expected m/s"),
        ('frame = "NED"', 'frame = "NUE"', "columns.velocity_down.frame: NUE: expected NED, ENU"),
        ("\nyaw =", "\nyawn =", "columns.yawn: unknown quantity: did you mean 'yaw'"),
        ('column = "vn",', 'column = "vn", sign = 0,', "columns.velocity_north.sign: 0: "),
        ('column = "vn",', 'column = "vn", clock = "gps",', "columns.velocity_north.clock: gps: expected main"),
        ('column = "vn",', 'column = "vn", value = 3.0,', "expected either `column`, .* or `value`"),
        ('column = "vn",', 'colum = "vn",', "columns.velocity_north.colum: unknown key: did you mean 'column'"),
        ('file = "flight.csv"', 'file = "other.csv"', "other.csv: no such file"),
        ('file = "flight.csv"', 'file = "flight.xlsx"', "suffix: .xlsx: expected .csv, .mat"),
        ('file = "flight.csv"', "", "file: missing; expected the path of the data file"),
        ("\n[columns]", "rate = 50.0\n[columns]", "clocks.main.rate: 50 Hz: the times in t have 20 rows a second"),
        ('unit = "s"', 'unit = "fortnights"', "clocks.main.unit: fortnights: expected s, ms"),
        ('column = "t"', 'column = "tt"', "clocks.main.column: tt: no such column in flight.csv"),
        ("file =", "span_s = [9.0, 3.0]\nfile =", r"span_s: \[9.0, 3.0\]: expected a start before an end"),
        (
            "file =",
            "span_s = [9e3, 9e4]\nfile =",
            "span_s: 9000 to 90000 s: velocity_north has no rows in this span, .* 239.95 s",
        ),
        ('"volt", unit = "V"', '"volt", unit = "V", rate = 1.0', "columns.voltage.rate: 1 Hz: the value changes"),
        # The motion contradicts itself.
        (
            '"r", unit = "deg/s"',
            '"r", unit = "deg/s", sign = -1',
            "yaw_rate: r varies opposite to .* check sign and frame",
        ),
        ('"r", unit = "deg/s"', '"r", unit = "deg/s", scale = 0.0174533', "yaw_rate: r is .* times .* check unit"),
        ('"az", unit = "m/s2"', '"az", unit = "m/s2", sign = -1', "acceleration_down: az is .* check sign and frame"),
        ('"az", unit = "m/s2"', '"az", unit = "ft/s2"', "acceleration_down: az is -3.1.* check unit"),
        ('"yaw", unit = "deg"', '"yaw", unit = "deg", frame = "ENU"', "yaw.* check sign, frame|varies opposite to"),
        (
            '"yaw", unit = "deg"',
            '"yaw", unit = "deg", offset = 90.0',
            "yaw: yaw differs by -90 deg from the ground",
        ),
        (
            '"ve", unit = "m/s"',
            '"ve", unit = "m/s", sign = -1',
            "velocity_east: ve varies opposite to the change of",
        ),
        ('"r", unit = "deg/s"', '"ail", unit = "deg/s"', "yaw_rate: ail does not follow the change of .* check column"),
        (
            '"tas", unit = "m/s"',
            '"tas", unit = "m/s", scale = 0',
            "airspeed: tas is stuck at one value from 0 to 239.5 s",
        ),
        ('"tas", unit = "m/s"', '"tas", unit = "km"', "airspeed.unit: km: expected m/s, km/h"),
        (
            '"tas", unit = "m/s"',
            '"tas", unit = "cm/s"',
            "airspeed: tas is 0.18 m/s in flight: expected more",
        ),
        (
            '"tas", unit = "m/s"',
            '"tas", unit = "m/s", scale = 1.944',
            r"airspeed: tas is 1\.9. times the airspeed",
        ),
        # Units that are wrong by a factor below 2.
        ('"vn", unit = "m/s"', '"vn", unit = "m/s", scale = 1.944', "velocity_north: vn is 1.9. times the change of"),
        ('"ve", unit = "m/s"', '"ve", unit = "kt", scale = 3.6', "velocity_east: ve is 1.8. times the change of"),
        # A wind to the north-west instead of from there; it blows at 4 m/s to the east.
        (
            "airspeed =",
            'wind_north = { value = 0.0, unit = "m/s" }\nwind_east = { value = -4.0, unit = "m/s" }\nairspeed =',
            "wind_north: wind_north states -1 times the wind that follows from airspeed, .* check unit and frame",
        ),
        (
            "airspeed =",
            'wind_speed = { value = 4, unit = "kt", scale = 1.944 }\nwind_direction = { value = 90, unit = "deg" }\n'
            "airspeed =",
            "wind_direction: wind_direction states -1 times the wind that follows from airspeed",
        ),
        (
            '"thr", unit = "%"',
            '"thr", unit = "%", sign = -1, offset = -100',
            "throttle: thr varies opposite to the current",
        ),
        ('"thr", unit = "%"', '"thr", unit = "%", scale = 0', "throttle: thr stays at 0 .* current goes from 4"),
    ],
)
def test_a_table_that_is_wrong_is_refused_in_one_line(tmp_path: Path, before: str, after: str, expected: str) -> None:
    assert before in TABLE
    waves = np.sin(0.5 * TIME)
    columns = {"volt": 11.1 + 0.1 * waves, "q": circle()["q"] + 0.0, "r": circle()["r"] + 2.0 * waves}
    columns["yaw"] = circle()["yaw"] - 4.0 * np.cos(0.5 * TIME)
    columns["amp"] = 1.0 + 0.1 * circle()["thr"]
    assert re.search(expected, said(write_log(tmp_path, TABLE.replace(before, after, 1), **columns)))


def with_cell(name: str, row: int, value: object) -> dict[str, np.ndarray]:
    values = circle()[name].astype(object)
    values[row] = value
    return {name: values}


def frozen(name: str, begin: float, end: float) -> np.ndarray:
    """Return a column that keeps one value between two times, s."""
    values = circle()[name]
    values[(begin <= TIME) & (end > TIME)] = values[np.searchsorted(TIME, begin)]
    return values


def late(name: str, delay: float) -> np.ndarray:
    """Return a column that comes later, s."""
    return np.interp(TIME - delay, TIME, circle()[name])


@pytest.mark.parametrize(
    ("columns", "expected"),
    [
        (with_cell("t", -1, 604_801.0), "flight.csv: t: 604801 s: expected at most 604800 s from the first row"),
        (with_cell("t", 40, 1.5), r"flight.csv: t\[40\]: 1.5 s: after 1.95 s:expected increasing times"),
        (with_cell("t", 40, np.nan), r"flight.csv: t\[40\]: nan: expected a time in every row"),
        (with_cell("roll", 7, "n/a?"), r"flight.csv: roll\[7\]: 'n/a\?': expected a number"),
        ({"t": 0.0 * TIME}, "flight.csv: t: 4800: expected at least two rows at different times"),
        ({"vn": np.full(len(TIME), np.nan)}, "columns.velocity_north: vn: holds no numbers"),
        ({"alt": np.full(len(TIME), np.inf)}, "columns.altitude: alt: holds no numbers"),
        # Sensors that freeze, and signals that come late.
        (
            {"tas": frozen("tas", 100.0, 130.0)},
            "airspeed: tas is stuck at one value from 100 to 130 s, in flight: .*span_s",
        ),
        ({"tas": 0.0 * TIME + 18.0}, r"airspeed: tas is stuck at one value from 0 to 239.5 s, in flight"),
        ({"r": frozen("r", 50.0, 80.0)}, "yaw_rate: r is stuck at one value from 50 to 80 s, in flight"),
        ({"vn": late("vn", 1.0)}, "velocity_north: vn lags the change of latitude by 1 s: check its clock"),
        ({"lat": late("lat", 2.0)}, "velocity_north: vn leads the change of latitude by 2 s: check its clock"),
    ],
)
def test_a_file_that_is_wrong_is_refused_in_one_line(
    tmp_path: Path, columns: dict[str, np.ndarray], expected: str
) -> None:
    assert re.search(expected, said(write_log(tmp_path, **columns)))


def test_a_gap_is_not_a_sensor_that_stays(tmp_path: Path) -> None:
    """The recorder stopped for 60 s; each sensor has one value before and another after."""
    later = TIME + np.where(TIME >= 100.0, 60.0, 0.0)
    check_signs_and_units(ColumnLog(write_log(tmp_path, t=later)))


def test_places_of_four_decimals_are_read(tmp_path: Path) -> None:
    """Steps of 11 m, of which the latitude of a leg to the east has none."""
    places = {name: circle()[name].round(4) for name in ("lat", "lon")}
    assert len(read_motion(write_log(tmp_path, **places)).velocity.time) == len(TIME)


def test_rows_without_a_value_are_left_out(tmp_path: Path) -> None:
    motion = read_motion(write_log(tmp_path, **with_cell("vn", 7, np.nan)))
    assert len(motion.velocity.time) == len(TIME) - 1
    assert len(motion.inertial.time) == len(TIME)


MOTOR = """
[clocks.motor]
file = "motor.csv"
column = "time"
unit = "ms"
align = { column = "servo", with = "throttle", within_s = 60.0 }
"""


def write_motor(folder: Path, shift: float, servo: np.ndarray | None = None) -> Path:
    """Write the motor's log at 2 Hz on a clock that is ``shift`` seconds behind; return the table."""
    time = np.arange(0.0, 200.0, 0.5)
    throttle = np.interp(time, TIME, circle()["thr"])
    frame = {"time": 1000.0 * (time - shift), "servo": 1000.0 + 10.0 * throttle if servo is None else servo}
    pd.DataFrame(frame | {"amp": 0.3 * throttle}).to_csv(folder / "motor.csv", index=False)
    table = TABLE.replace('"amp", unit = "A"', '"amp", unit = "A", clock = "motor"')
    return write_log(folder, table.replace("\n[columns]", f"{MOTOR}\n[columns]"))


def test_a_second_file_is_aligned_by_signals_that_move_together(tmp_path: Path) -> None:
    battery = read_motion(write_motor(tmp_path, shift=12.3)).battery
    throttle = np.interp(battery.time, TIME, circle()["thr"])
    # The throttle jumps by 60 % at once: rows beside a jump may lie on its other side.
    assert np.mean(np.abs(battery.values[:, 1] - 0.3 * throttle) < 1.0) > 0.97


def test_clocks_that_do_not_correlate_are_refused(tmp_path: Path) -> None:
    noise = np.random.default_rng(3).normal(size=400)
    message = said(write_motor(tmp_path, shift=0.0, servo=noise))
    assert re.search(
        r"clocks.motor.align: servo and throttle have a correlation of at most 0.\d\d; expected at least 0.6", message
    )


def test_a_clock_is_not_aligned_with_its_own_quantity(tmp_path: Path) -> None:
    table = write_motor(tmp_path, shift=0.0)
    table.write_text(table.read_text().replace('with = "throttle"', 'with = "current"'))
    assert "clocks.motor.align.with: expected a quantity whose clock has no `align`" in said(table)


def test_clocks_without_a_common_time_are_refused(tmp_path: Path) -> None:
    table = write_motor(tmp_path, shift=-5000.0)
    table.write_text(table.read_text().replace("align = ", "# align = "))
    assert "clocks.motor: time: runs from 5000 to 5199.5 s, main from 0 to 239.95 s, without overlap" in said(table)


def test_a_column_of_another_length_is_refused(tmp_path: Path) -> None:
    from scipy.io import savemat

    columns = circle()
    columns["roll"] = columns["roll"][:-5]
    savemat(tmp_path / "flight.mat", columns)
    table = write_log(tmp_path, TABLE.replace("flight.csv", "flight.mat"))
    assert "columns.roll.column: roll: 4795 rows, but the clock main has 4800: expected equal numbers" in said(table)


def test_a_data_file_without_a_table_names_the_command_that_writes_one(tmp_path: Path) -> None:
    write_log(tmp_path).unlink()
    for read in (read_motion, open_log):
        message = said(tmp_path / "flight.csv", read)
        assert "no table of columns (flight.columns.toml or columns.toml)" in message
        assert "--columns-from" in message


def test_a_folder_has_one_table_for_all_its_files(tmp_path: Path) -> None:
    table = write_log(tmp_path)
    (tmp_path / "flight.csv").rename(tmp_path / "second.csv")
    table.rename(tmp_path / "columns.toml")
    assert len(read_motion(tmp_path / "second.csv").inertial.time) == len(TIME)


def test_dates_are_counted_from_the_first_row(tmp_path: Path) -> None:
    stamps = pd.Timestamp("2026-11-27T10:15:02.5Z") + pd.to_timedelta(TIME, unit="s")
    dates = np.array([stamp.isoformat() for stamp in stamps])
    raw = open_log(write_log(tmp_path, TABLE.replace('unit = "s"', 'unit = "iso"'), t=dates))
    assert raw.series["position"].time == pytest.approx(TIME, abs=1e-6)
    assert raw.utc_start == pytest.approx(1795774502.5)


def test_a_held_value_counts_once(tmp_path: Path) -> None:
    volt = np.repeat(11.0 + 0.01 * np.arange(480), 10)
    table = TABLE.replace('"volt", unit = "V"', '"volt", unit = "V", rate = 2.0')
    table = table.replace('current = { column = "amp", unit = "A" }', 'current = { value = 5.0, unit = "A" }')
    raw = open_log(write_log(tmp_path, table, volt=volt))
    # 2 Hz, from 11 V to 15.79 V in 239.5 s: the mean of 13.395 V times 5 A.
    assert raw.series["battery"].values[-1, 1] == pytest.approx(13.395 * 5.0 * 239.5 / 3600.0, rel=0.01)
