"""The flown rows as tables: read back by other people's readers to the very numbers."""

import csv
import io
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.csv
import pyarrow.parquet
import pyproj
import pytest
from pyulog import ULog
from scipy.spatial.transform import Rotation

from flight.simulation.track import Track
from logs.importers.px4_log import read_px4
from logs.importers.telemetry_log import read_telemetry
from logs.recording.example_log import example_log
from logs.recording.reader import FlightLog, read_log
from logs.views.exports.log_files import (
    compute_attitude_quaternion,
    csv_text,
    make_flight_columns,
    parquet_bytes,
    px4_log_bytes,
)
from logs.views.exports.telemetry_file import telemetry_bytes
from world.errors import MissingExtraError
from world.frames import to_geo


def test_csv_reads_back_to_the_logged_numbers(log_file: Path) -> None:
    log = read_log(log_file)
    table = pyarrow.csv.read_csv(io.BytesIO(csv_text(log).encode()))
    assert table.num_rows == len(log.track)
    assert table["time_s"].to_numpy().tobytes() == log.track.time.tobytes()
    assert table["up_amsl_m"].to_numpy().tobytes() == log.track.position[:, 2].tobytes()
    roll = table["roll_rad"].to_numpy().astype(np.float32)
    assert roll.tobytes() == log.track.attitude[:, 0].tobytes(), "a float32's own digits"
    assert table["leg_index"].to_numpy().tolist() == log.track.leg.tolist()
    assert len(csv_text(log).splitlines()) == len(log.track) + 1
    assert {len(row) for row in csv.reader(io.StringIO(csv_text(log)))} == {table.num_columns}


def test_parquet_keeps_types_and_says_what_it_is(log_file: Path) -> None:
    log = read_log(log_file)
    table = pyarrow.parquet.read_table(io.BytesIO(parquet_bytes(log)))
    assert table.column_names == list(make_flight_columns(log))
    assert (str(table.schema.field("time_s").type), str(table.schema.field("roll_rad").type)) == ("double", "float")
    assert table["airspeed_mps"].to_numpy().tobytes() == log.track.airspeed.tobytes()
    # A track alone has no origin for a latitude and a longitude.
    of_track = [name for name in table.column_names if name not in ("latitude_deg", "longitude_deg")]
    assert list(log.track.to_pandas().columns) == of_track
    about = {key.decode(): value.decode() for key, value in table.schema.metadata.items()}
    assert about["planfly.scenario"] == log.setup.scenario.name
    assert about["planfly.ended"] == log.ended
    origin = log.setup.scenario.origin
    place = pyproj.Proj(proj="aeqd", lat_0=origin.lat_deg, lon_0=origin.lon_deg, ellps="WGS84")
    lon, lat = place(*log.track.position[:, :2].T, inverse=True)
    assert table["latitude_deg"].to_numpy() == pytest.approx(lat, abs=1e-9)
    assert table["longitude_deg"].to_numpy() == pytest.approx(lon, abs=1e-9)


def test_without_pyarrow_the_extra_is_named(log_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = read_log(log_file)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r"^\.parquet needs the extra 'tables'"):
        parquet_bytes(log)


# ----------------------------------------------------------------------
# A flight as a `.tlog`: what pymavlink's own reader makes of it.

# 2000-01-01T00:00:00Z.
BEGAN = 946_684_800.0


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> FlightLog:
    from logs.recording.example_log import write_example_log

    return read_log(write_example_log(tmp_path_factory.mktemp("log") / "example.mcap"))


@pytest.fixture(scope="module")
def tlog(log: FlightLog, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("tlog") / "flight.tlog"
    file.write_bytes(telemetry_bytes(log))
    return file


def read_messages(tlog: Path) -> list[Any]:
    """Every message, as MAVExplorer and MAVProxy read them."""
    from pymavlink import mavutil

    mavutil.set_dialect("ardupilotmega")
    reader, found = mavutil.mavlink_connection(str(tlog)), []
    while (message := reader.recv_match()) is not None:
        found.append(message)
    reader.close()
    return found


@pytest.fixture(scope="module")
def messages(tlog: Path) -> list[Any]:
    return read_messages(tlog)


def of(messages: list[Any], kind: str) -> list[Any]:
    return [message for message in messages if message.get_type() == kind]


def test_places_and_speeds_are_in_mavlinks_units(messages: list[Any], log: FlightLog) -> None:
    track, found = log.track, of(messages, "GLOBAL_POSITION_INT")
    assert not of(messages, "BAD_DATA")
    # Ten a second of a track that has ten rows a second.
    assert len(found) == pytest.approx(10.0 * log.end_time, abs=2)
    for message in found[::50]:
        k = int(np.argmin(np.abs(track.time - message.time_boot_ms / 1e3)))
        lat, lon = to_geo(log.setup.scenario.origin, *track.position[k, :2])
        assert (message.lat, message.lon) == pytest.approx((float(lat) * 1e7, float(lon) * 1e7), abs=1.0)
        assert message.alt == pytest.approx(track.position[k, 2] * 1e3, abs=1.0)
        assert message.vz == pytest.approx(-100.0 * track.velocity[k, 2], abs=1.0)
        assert message._timestamp == pytest.approx(BEGAN + track.time[k], abs=1e-4)
    hud = of(messages, "VFR_HUD")[10]
    assert hud.airspeed == pytest.approx(24.4, abs=3.0)
    assert {m.custom_mode for m in of(messages, "HEARTBEAT") if m.get_srcSystem() == 1} == {10}


def test_attitudes_are_the_flights(messages: list[Any], log: FlightLog) -> None:
    found = of(messages, "ATTITUDE")
    rolls = np.interp([m.time_boot_ms / 1e3 for m in found], log.track.time, log.track.attitude[:, 0])
    assert [m.roll for m in found] == pytest.approx(rolls.tolist(), abs=0.002)


def test_the_mission_comes_first_and_its_items_are_reached_in_order(messages: list[Any], log: FlightLog) -> None:
    items = log.setup.mission.items
    uploaded = of(messages, "MISSION_ITEM_INT")
    assert [(m.command, m.x, m.y) for m in uploaded[1:]] == [(it.command, it.x, it.y) for it in items]
    reached = [m.seq for m in of(messages, "MISSION_ITEM_REACHED")]
    assert reached == sorted(set(reached))
    assert reached[0] == 1
    stamps = [m._timestamp for m in messages]
    assert stamps == sorted(stamps)


def test_events_are_texts_at_their_time(messages: list[Any], log: FlightLog) -> None:
    texts = {m.text: m._timestamp - BEGAN for m in of(messages, "STATUSTEXT")}
    for event in log.events:
        assert texts[event.text[:50]] == pytest.approx(event.time, abs=0.2)


def test_our_own_reader_opens_the_tlog(tlog: Path, log: FlightLog) -> None:
    raw = read_telemetry(tlog)
    assert raw.vehicle == "plane"
    assert len(raw.missions[-1].mission.items) == len(log.setup.mission.items)
    assert raw.series["position"].time[-1] - raw.series["position"].time[0] == pytest.approx(log.end_time, abs=0.2)


@pytest.mark.parametrize("stated", [14.8, 0.0])
def test_every_log_states_the_voltage_with_which_the_current_is_the_power(
    log: FlightLog, stated: float, tmp_path: Path
) -> None:
    """A stated voltage of 14.8 V is written; without one it follows from 74 W and 5 A."""
    time = np.asarray(log.track.time)
    values = {"current": np.full(len(time), 5.0), "energy": 74.0 * time / 3600.0}
    columns = {name: getattr(log.track, name) for name in Track.__dataclass_fields__} | values
    limits = replace(log.setup.limits, envelope=replace(log.setup.envelope, volts=stated))
    powered = replace(log, track=Track(**columns), setup=replace(log.setup, limits=limits))
    (tmp_path / "flight.tlog").write_bytes(telemetry_bytes(powered))
    written = of(read_messages(tmp_path / "flight.tlog"), "SYS_STATUS")
    assert {(message.voltage_battery, message.current_battery) for message in written} == {(14_800, 500)}
    found = ULog(io.BytesIO(px4_log_bytes(powered))).get_dataset("battery_status").data
    assert found["voltage_v"] * found["current_a"] == pytest.approx(74.0, rel=1e-5)


# ----------------------------------------------------------------------
# A flight as PX4's log: what pyulog makes of it.


@pytest.fixture(scope="module")
def small_log() -> FlightLog:
    return example_log()


@pytest.fixture(scope="module")
def found(small_log: FlightLog) -> ULog:
    return ULog(io.BytesIO(px4_log_bytes(small_log)))


def test_the_topics_are_px4s(found: ULog) -> None:
    names = {data.name for data in found.data_list}
    assert names == {
        "vehicle_attitude",
        "vehicle_angular_velocity",
        "vehicle_local_position",
        "vehicle_global_position",
        "airspeed_validated",
        "wind",
        "vehicle_thrust_setpoint",
        "battery_status",
        "vehicle_status",
        "navigator_mission_item",
    }
    assert not found.file_corruption
    assert not found.dropouts


def test_places_are_north_east_down_and_on_earth(found: ULog, small_log: FlightLog) -> None:
    local, place = (found.get_dataset(f"vehicle_{name}_position").data for name in ("local", "global"))
    rows = np.searchsorted(small_log.track.time, local["timestamp"] * 1e-6 - 1e-6)
    east, north, up = small_log.track.position[rows].T
    assert local["x"] == pytest.approx(north, abs=1e-3)
    assert local["y"] == pytest.approx(east, abs=1e-3)
    assert local["ref_alt"] - local["z"] == pytest.approx(up, abs=1e-3)
    assert local["vz"] == pytest.approx(-small_log.track.velocity[rows, 2], abs=1e-6)
    assert local["vy"] == pytest.approx(small_log.track.velocity[rows, 0], abs=1e-6)
    assert local["xy_valid"].all()
    lat, lon = to_geo(small_log.setup.scenario.origin, east, north)
    assert place["lat"] == pytest.approx(lat, abs=1e-12)
    assert place["lon"] == pytest.approx(lon, abs=1e-12)
    assert place["alt"] == pytest.approx(up, abs=1e-3)
    assert place["alt"] - place["terrain_alt"] == pytest.approx(small_log.track.clearance[rows], abs=1e-3)


def test_the_attitude_is_scipys_quaternion(found: ULog, small_log: FlightLog) -> None:
    data = found.get_dataset("vehicle_attitude").data
    assert len(data["timestamp"]) == len(small_log.track)
    wanted = Rotation.from_euler("ZYX", small_log.track.attitude[:, ::-1]).as_quat()[:, [3, 0, 1, 2]]
    given = np.stack([data[f"q[{k}]"] for k in range(4)], axis=1)
    assert np.abs((given * wanted).sum(axis=1)) == pytest.approx(1.0, abs=1e-6)


def test_any_attitude_is_the_rotation_it_names() -> None:
    angles = np.random.default_rng(5).uniform(-3.0, 3.0, (200, 3)) * np.array([1.0, 0.5, 1.0])
    wanted = Rotation.from_euler("ZYX", angles[:, ::-1])
    given = Rotation.from_quat(compute_attitude_quaternion(angles)[:, [1, 2, 3, 0]])
    assert (given * wanted.inv()).magnitude() == pytest.approx(0.0, abs=1e-7)


def test_air_and_battery(found: ULog, small_log: FlightLog) -> None:
    air = found.get_dataset("airspeed_validated").data
    rows = np.searchsorted(small_log.track.time, air["timestamp"] * 1e-6 - 1e-6)
    assert air["true_airspeed_m_s"] == pytest.approx(small_log.track.airspeed[rows], abs=1e-6)
    # The standard atmosphere's density at 200 m is 1.2017 of 1.2250 kg/m^3.
    at = int(np.argmin(np.abs(small_log.track.position[rows, 2] - 200.0)))
    share = air["calibrated_airspeed_m_s"][at] / air["true_airspeed_m_s"][at]
    assert share == pytest.approx((1.2017 / 1.2250) ** 0.5, abs=2e-4)
    wind = found.get_dataset("wind").data
    assert wind["windspeed_east"] == pytest.approx(small_log.track.wind[rows, 0], abs=1e-6)
    battery = found.get_dataset("battery_status").data
    energy = (battery["voltage_v"] * battery["discharged_mah"])[-1] / 1000.0
    assert energy == pytest.approx(float(small_log.track.energy[-1] - small_log.track.energy[0]), rel=1e-2)


def test_events_are_logged_messages_at_their_time(found: ULog, small_log: FlightLog) -> None:
    assert [(one.message, one.timestamp) for one in found.logged_messages] == [
        (event.text, round(event.time * 1e6)) for event in small_log.events
    ]


def test_our_own_reader_opens_the_ulog(small_log: FlightLog, tmp_path: Path) -> None:
    file = tmp_path / "flight.ulg"
    file.write_bytes(px4_log_bytes(small_log))
    raw = read_px4(file)
    assert raw.vehicle == "plane"
    assert [item.x for item in raw.missions[0].mission.items] == [item.x for item in small_log.setup.mission.items]
    assert (raw.damage.places, raw.modes[0].time) == (0, 0.0)


def test_rows_without_a_place_are_left_out(small_log: FlightLog) -> None:
    position = np.array(small_log.track.position)
    position[100:110] = np.nan
    columns = {name: getattr(small_log.track, name) for name in Track.__dataclass_fields__}
    holed = replace(small_log, track=Track(**(columns | {"position": position})))
    data = ULog(io.BytesIO(px4_log_bytes(holed))).get_dataset("vehicle_attitude").data
    assert len(data["timestamp"]) == len(small_log.track) - 10
