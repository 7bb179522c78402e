"""A flight as PX4's log: what pyulog makes of it."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog
from scipy.spatial.transform import Rotation

from flight.simulation.track import Track
from logs.exports.px4_file import attitude_quaternion, px4_log_bytes
from logs.field_logs.readers.px4_log import read_px4
from logs.recording.example_log import example_log
from logs.recording.reader import FlightLog
from world.frames import to_geo


@pytest.fixture(scope="module")
def log() -> FlightLog:
    return example_log()


@pytest.fixture(scope="module")
def found(log: FlightLog) -> ULog:
    return ULog(io.BytesIO(px4_log_bytes(log)))


def test_the_topics_are_px4s(found: ULog) -> None:
    names = {data.name for data in found.data_list}
    assert names == {
        "vehicle_attitude", "vehicle_angular_velocity", "vehicle_local_position", "vehicle_global_position",
        "airspeed_validated", "wind", "vehicle_thrust_setpoint", "battery_status", "vehicle_status",
        "navigator_mission_item",
    }  # fmt: skip
    assert not found.file_corruption
    assert not found.dropouts


def test_places_are_north_east_down_and_on_earth(found: ULog, log: FlightLog) -> None:
    local, place = (found.get_dataset(f"vehicle_{name}_position").data for name in ("local", "global"))
    rows = np.searchsorted(log.track.time, local["timestamp"] * 1e-6 - 1e-6)
    east, north, up = log.track.position[rows].T
    assert local["x"] == pytest.approx(north, abs=1e-3)
    assert local["y"] == pytest.approx(east, abs=1e-3)
    assert local["ref_alt"] - local["z"] == pytest.approx(up, abs=1e-3)
    assert local["vz"] == pytest.approx(-log.track.velocity[rows, 2], abs=1e-6)
    assert local["vy"] == pytest.approx(log.track.velocity[rows, 0], abs=1e-6)
    assert local["xy_valid"].all()
    lat, lon = to_geo(log.setup.scenario.origin, east, north)
    assert place["lat"] == pytest.approx(lat, abs=1e-12)
    assert place["lon"] == pytest.approx(lon, abs=1e-12)
    assert place["alt"] == pytest.approx(up, abs=1e-3)
    assert place["alt"] - place["terrain_alt"] == pytest.approx(log.track.clearance[rows], abs=1e-3)


def test_the_attitude_is_scipys_quaternion(found: ULog, log: FlightLog) -> None:
    data = found.get_dataset("vehicle_attitude").data
    assert len(data["timestamp"]) == len(log.track)
    wanted = Rotation.from_euler("ZYX", log.track.attitude[:, ::-1]).as_quat()[:, [3, 0, 1, 2]]
    given = np.stack([data[f"q[{k}]"] for k in range(4)], axis=1)
    assert np.abs((given * wanted).sum(axis=1)) == pytest.approx(1.0, abs=1e-6)


def test_any_attitude_is_the_rotation_it_names() -> None:
    angles = np.random.default_rng(5).uniform(-3.0, 3.0, (200, 3)) * np.array([1.0, 0.5, 1.0])
    wanted = Rotation.from_euler("ZYX", angles[:, ::-1])
    given = Rotation.from_quat(attitude_quaternion(angles)[:, [1, 2, 3, 0]])
    assert (given * wanted.inv()).magnitude() == pytest.approx(0.0, abs=1e-7)


def test_air_and_battery(found: ULog, log: FlightLog) -> None:
    air = found.get_dataset("airspeed_validated").data
    rows = np.searchsorted(log.track.time, air["timestamp"] * 1e-6 - 1e-6)
    assert air["true_airspeed_m_s"] == pytest.approx(log.track.airspeed[rows], abs=1e-6)
    # The standard atmosphere's density at 200 m is 1.2017 of 1.2250 kg/m^3.
    at = int(np.argmin(np.abs(log.track.position[rows, 2] - 200.0)))
    share = air["calibrated_airspeed_m_s"][at] / air["true_airspeed_m_s"][at]
    assert share == pytest.approx((1.2017 / 1.2250) ** 0.5, abs=2e-4)
    wind = found.get_dataset("wind").data
    assert wind["windspeed_east"] == pytest.approx(log.track.wind[rows, 0], abs=1e-6)
    battery = found.get_dataset("battery_status").data
    energy = (battery["voltage_v"] * battery["discharged_mah"])[-1] / 1000.0
    assert energy == pytest.approx(float(log.track.energy[-1] - log.track.energy[0]), rel=1e-2)


def test_events_are_logged_messages_at_their_time(found: ULog, log: FlightLog) -> None:
    assert [(one.message, one.timestamp) for one in found.logged_messages] == [
        (event.text, round(event.time * 1e6)) for event in log.events
    ]


def test_our_own_reader_finds_flight_and_mission(log: FlightLog, tmp_path: Path) -> None:
    file = tmp_path / "flight.ulg"
    file.write_bytes(px4_log_bytes(log))
    raw = read_px4(file)
    assert raw.vehicle == "plane"
    assert [item.x for item in raw.missions[0].mission.items] == [item.x for item in log.setup.mission.items]
    assert (raw.damage.places, raw.modes[0].time) == (0, 0.0)


def test_rows_without_a_place_are_left_out(log: FlightLog) -> None:
    position = np.array(log.track.position)
    position[100:110] = np.nan
    columns = {name: getattr(log.track, name) for name in Track.__dataclass_fields__}
    holed = replace(log, track=Track(**(columns | {"position": position})))
    data = ULog(io.BytesIO(px4_log_bytes(holed))).get_dataset("vehicle_attitude").data
    assert len(data["timestamp"]) == len(log.track) - 10
