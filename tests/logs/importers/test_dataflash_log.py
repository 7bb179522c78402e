"""Missions of dataflash logs, and home where they hold none."""

import math
from pathlib import Path

import numpy as np
import pytest

from flight.mission.items import Home
from logs.importers.dataflash_log import read_dataflash
from logs.importers.raw_log import LoggedMission, example_raw_log
from tests.logs.importers.pymavlink_rows import FLIGHTS, mission_lines, read_rows
from tests.logs.importers.written_logs import DataflashWriter, dataflash
from world.errors import LogError


def test_home_is_the_vehicles_where_the_mission_holds_none(tmp_path: Path) -> None:
    item = ("CMD", "QHHHffffLLfB", "TimeUS,CTot,CNum,CId,Prm1,Prm2,Prm3,Prm4,Lat,Lng,Alt,Frame")
    origin = ("ORGN", "QBLLf", "TimeUS,Type,Lat,Lng,Alt")
    unset = (*item, 0, 3, 0, 16, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0)
    items = [(*item, 0, 3, k, 16, 0.0, 0.0, 0.0, 0.0, 46.0, 8.0 + k * 0.01, 100.0, 3) for k in (1, 2)]
    out = DataflashWriter()
    for message in ((*origin, 0, 0, 47.0, 9.0, 1.0), (*origin, 0, 1, 46.5, 8.5, 431.0), unset, *items):
        out.message(*message)
    out.message("POS", "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt", 0, 46.0, 8.0, 500.0, 0.0)
    path = tmp_path / "a.BIN"
    path.write_bytes(bytes(out.data))
    (logged,) = read_dataflash(path).missions
    assert logged.mission.home == Home(46.5, 8.5, 431.0)
    assert [(item.seq, item.frame, item.alt) for item in logged.mission.items] == [(1, 3, 100.0), (2, 3, 100.0)]


# ----------------------------------------------------------------------
# ArduPilot's logs as pymavlink alone reads them, of other releases, and with parts missing.

NAMES = ("tight", "steep", "ridge-10mps")


@pytest.mark.parametrize("name", NAMES)
def test_the_mission_is_the_one_beside_it_item_by_item(name: str) -> None:
    (logged,) = read_dataflash(FLIGHTS / f"{name}.BIN").missions
    home, *items = mission_lines(FLIGHTS / f"{name}.waypoints")
    assert logged.mission.home is not None
    assert (logged.mission.home.lat_deg, logged.mission.home.lon_deg, logged.mission.home.alt) == tuple(home[8:11])
    assert len(logged.mission.items) == len(items)
    for item, line in zip(logged.mission.items, items, strict=True):
        assert [item.seq, item.frame, item.command, *item.params] == [line[0], *line[2:8]]
        assert [item.lat_deg, item.lon_deg] == line[8:10]
        assert item.alt == pytest.approx(line[10], abs=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_rows_are_what_pymavlink_reads(name: str) -> None:
    raw = read_dataflash(FLIGHTS / f"{name}.BIN")
    rows = read_rows(FLIGHTS / f"{name}.BIN", "POS", "ATT", "XKF1", "XKF2", "ARSP", "CTUN")
    for k in np.linspace(0, len(rows["POS"]) - 1, 10).astype(int):
        place, angle = rows["POS"][k], rows["ATT"][k]
        position, attitude = raw.series["position"], raw.series["attitude"]
        assert position.time[k] == pytest.approx(place.TimeUS * 1e-6, abs=1e-9)
        assert position.values[k].tolist() == [place.Lat, place.Lng, place.Alt]
        assert np.degrees(attitude.values[k]) == pytest.approx([angle.Roll, angle.Pitch, angle.Yaw], abs=1e-9)
        wind, velocity = rows["XKF2"][k], rows["XKF1"][k]
        assert raw.series["wind"].values[k].tolist() == [wind.VWE, wind.VWN]
        assert raw.series["velocity"].values[k].tolist() == [velocity.VE, velocity.VN, -velocity.VD]
    for k in np.linspace(0, len(rows["ARSP"]) - 1, 10).astype(int):
        ratio = np.interp(rows["ARSP"][k].TimeUS, [c.TimeUS for c in rows["CTUN"]], [c.E2T for c in rows["CTUN"]])
        assert raw.series["airspeed"].values[k, 0] == pytest.approx(rows["ARSP"][k].Airspeed * ratio, abs=1e-6)


def test_time_0_is_what_the_receiver_says() -> None:
    raw = read_dataflash(FLIGHTS / "tight.BIN")
    first = next(row for row in read_rows(FLIGHTS / "tight.BIN", "GPS")["GPS"] if row.GWk > 1000)
    seconds = 315_964_800 + first.GWk * 604_800 + first.GMS * 1e-3 - 18.0 - first.TimeUS * 1e-6
    assert raw.utc_start == pytest.approx(seconds, abs=1e-3)


def test_a_log_of_an_older_release_says_the_same(tmp_path: Path) -> None:
    """EKF1 and EKF2, centimetres and centidegrees in the parameters, items without frames."""
    new = read_dataflash(dataflash(tmp_path / "new.BIN"))
    old = read_dataflash(dataflash(tmp_path / "old.BIN", old=True, with_frames=False))
    for name in ("position", "velocity", "attitude", "wind", "airspeed", "battery"):
        assert np.array_equal(new.series[name].values, old.series[name].values)
    assert old.parameters["TRIM_ARSPD_CM"] == 2500.0
    assert [item.frame for item in old.missions[0].mission.items] == [3, 3, 3]
    assert old.missions[0].mission.warnings == (
        "the log states no altitude frames: altitudes are taken as heights above home",
    )


@pytest.mark.parametrize(
    ("left_out", "lacks"),
    [("ARSP", "airspeed"), ("XKF2", "wind"), ("BAT", "battery"), ("ATT", "attitude"), ("CTUN", "throttle")],
)
def test_what_is_not_there_is_not_held(tmp_path: Path, left_out: str, lacks: str) -> None:
    assert lacks not in read_dataflash(dataflash(tmp_path / "a.BIN", leave_out=[left_out])).series


def test_without_positions_of_its_own_those_of_the_receiver_count(tmp_path: Path) -> None:
    raw = read_dataflash(dataflash(tmp_path / "a.BIN", leave_out=["POS", "XKF1"]))
    assert raw.series["position"].source == "GPS"
    assert raw.series["velocity"].source == "GPS"
    assert raw.series["velocity"].values[0] == pytest.approx([0.0, 25.0, 0.0], abs=1e-5)


def test_nothing_that_says_where_it_flew_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no POS, AHR2 or GPS message"):
        read_dataflash(dataflash(tmp_path / "a.BIN", leave_out=["POS", "GPS"]))


@pytest.mark.parametrize(
    ("program", "vehicle"),
    [("ArduCopter V4.5.7 (x)", "copter"), ("ArduRover V4.2", "rover"), ("ArduPlane V3.9", "plane"), ("", "unknown")],
)
def test_the_vehicle_is_named_by_its_program(tmp_path: Path, program: str, vehicle: str) -> None:
    assert read_dataflash(dataflash(tmp_path / "a.BIN", program=program)).vehicle == vehicle


def test_modes_are_told_by_number(tmp_path: Path) -> None:
    raw = read_dataflash(dataflash(tmp_path / "a.BIN", modes=[(20.0, 5), (30.0, 10), (60.0, 11)]))
    assert [(mode.name, mode.automatic) for mode in raw.modes] == [("FBWA", False), ("AUTO", True), ("RTL", False)]


def test_a_second_upload_is_a_second_mission(tmp_path: Path) -> None:
    path = dataflash(tmp_path / "a.BIN")
    out = DataflashWriter()
    columns = "TimeUS,CTot,CNum,CId,Prm1,Prm2,Prm3,Prm4,Lat,Lng,Alt,Frame"
    # Behind the formats that the log has already: the same number as the log's own.
    for number, lat in enumerate((46.0, 46.1, 46.2)):
        out.message("CMD", "QHHHffffLLfB", columns, 90_000_000, 3, number, 16, *(0.0,) * 4, lat, 8.0, 300.0, 0)
    data = bytes(out.data)
    # Given the same type number as the CMD of the log.
    known = path.read_bytes()
    at = known.index(b"CMD\x00") - 5
    number = known[at + 3]
    body = data[89:].replace(b"\xa3\x95\x81", bytes([0xA3, 0x95, number]))
    path.write_bytes(known + body)
    first, second = read_dataflash(path).missions
    assert (len(first.mission.items), len(second.mission.items)) == (3, 2)
    assert second.time == 90.0


def test_a_clock_that_went_back_goes_on(tmp_path: Path) -> None:
    """As after a restart in the same file: the second half begins at 20 s again."""
    whole = dataflash(tmp_path / "a.BIN").read_bytes()
    body = whole[whole.index(b"\xa3\x95\x80" + b"\x83") :] if b"\xa3\x95\x80\x83" in whole else whole
    path = tmp_path / "twice.BIN"
    path.write_bytes(whole + body)
    raw = read_dataflash(path)
    assert len(raw.clock_jumps) == 1
    assert raw.clock_jumps[0] == pytest.approx(20.0 + 91.8, abs=0.3)
    assert (np.diff(raw.series["position"].time) >= 0.0).all()


def test_the_battery_of_a_log_without_energies_is_volts_times_amperes(tmp_path: Path) -> None:
    out = DataflashWriter()
    out.message("MSG", "QZ", "TimeUS,Message", 0, "ArduPlane V4.5.0")
    for k in range(101):
        out.message("POS", "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt", k * 100_000, 46.0, 8.0, 500.0, 0.0)
        out.message("BAT", "Qff", "TimeUS,Volt,Curr", k * 100_000, 24.0, 10.0)
    path = tmp_path / "a.BIN"
    path.write_bytes(bytes(out.data))
    battery = read_dataflash(path).series["battery"]
    assert battery.values[-1].tolist() == pytest.approx([10.0, 24.0 * 10.0 * 10.0 / 3600.0])


def test_equivalent_airspeeds_become_true_ones_by_height_where_no_ratio_is_logged(tmp_path: Path) -> None:
    raw = read_dataflash(dataflash(tmp_path / "a.BIN", example_raw_log(up=3000.0), leave_out=["CTUN"]))
    # The standard atmosphere at 3,000 m has 0.7422 of the density at the sea.
    assert raw.series["airspeed"].values[0, 0] == pytest.approx(24.4 / math.sqrt(0.7422), rel=1e-3)


# ----------------------------------------------------------------------
# Numbers that no autopilot writes: of a hostile log, or of garbage that looks like a message.

COMMAND_COLUMNS = "TimeUS,CTot,CNum,CId,Prm1,Prm2,Prm3,Prm4,Lat,Lng,Alt,Frame"


def missions_of(path: Path, rows: list[tuple[float, float, float]]) -> list[LoggedMission]:
    """Missions of a log whose messages CMD have these counts, numbers and commands, as doubles."""
    out = DataflashWriter()
    for total, number, command in rows:
        place = (0.0, 0.0, 0.0, 0.0, 46.0, 8.0, 100.0, 3)
        out.message("CMD", "QdddffffLLfB", COMMAND_COLUMNS, 0, total, number, command, *place)
    out.message("POS", "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt", 0, 46.0, 8.0, 500.0, 0.0)
    path.write_bytes(bytes(out.data))
    return list(read_dataflash(path).missions)


@pytest.mark.parametrize("total", [4e6, -1.0, math.nan, math.inf])
def test_a_count_that_cannot_be_is_none(tmp_path: Path, total: float) -> None:
    (logged,) = missions_of(tmp_path / "a.BIN", [(total, k, 16.0) for k in range(4)])
    assert [item.seq for item in logged.mission.items] == [1, 2, 3]
    assert logged.missing is None


@pytest.mark.parametrize(
    ("number", "command"), [(4e6, 16.0), (-2.0, 16.0), (math.nan, 16.0), (math.inf, 16.0), (3.0, math.nan)]
)
def test_an_item_whose_number_or_command_cannot_be_is_left_out(tmp_path: Path, number: float, command: float) -> None:
    rows = [*((0.0, float(k), 16.0) for k in range(3)), (0.0, number, command)]
    (logged,) = missions_of(tmp_path / "a.BIN", rows)
    assert [item.seq for item in logged.mission.items] == [1, 2]
    assert logged.missing is None
