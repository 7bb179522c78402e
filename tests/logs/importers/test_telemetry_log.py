from pathlib import Path

import numpy as np
import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as dialect

from flight.mission.items import Home
from logs.importers.raw_log import example_raw_log
from logs.importers.telemetry_log import SystemMessages, TelemetryReader, read_telemetry
from tests.logs.importers.written_logs import telemetry
from world.errors import LogError

ATTITUDE = 30


def read(data: bytes) -> tuple[int, TelemetryReader]:
    reader = TelemetryReader(memoryview(data), frozenset({ATTITUDE}))
    return len(list(reader.messages())), reader


def test_wanted_messages_alone_are_decoded(tmp_path: Path) -> None:
    count, reader = read(telemetry(tmp_path / "a.tlog").read_bytes())
    assert count == 460
    assert not reader.damage().lossy


def test_a_checksum_that_fails_is_counted(tmp_path: Path) -> None:
    data = bytearray(telemetry(tmp_path / "a.tlog").read_bytes())
    # A packet of MAVLink 2: ten bytes before the payload, the message's number from the eighth on.
    half = len(data) // 2
    at = next(k for k in range(half, len(data)) if data[k] == 0xFD and data[k + 7 : k + 10] == bytes([ATTITUDE, 0, 0]))
    data[at + 12] ^= 1
    count, reader = read(bytes(data))
    assert (count, reader.damage().unreadable) == (459, 1)


def test_bytes_that_are_no_packet_are_passed_over_and_counted(tmp_path: Path) -> None:
    data = telemetry(tmp_path / "a.tlog").read_bytes()
    _, reader = read(b"\x01" * 37 + data)
    assert (reader.damage().places, reader.damage().size) == (1, 37)


def test_a_cut_is_told(tmp_path: Path) -> None:
    _, reader = read(telemetry(tmp_path / "a.tlog").read_bytes()[:-7])
    assert reader.damage().cut


link = dialect.MAVLink(None)


def attitude(millis: int) -> dialect.MAVLink_attitude_message:
    return link.attitude_encode(millis, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0)


def test_rows_hold_their_numbers_and_fields() -> None:
    found = SystemMessages()
    found.add(1000.0, attitude(500))
    found.add(1000.5, link.heartbeat_encode(1, 3, 81, 10, 4))
    found.add(1001.0, attitude(1500))
    assert np.allclose(found.table("ATTITUDE"), [[0, 0.1, 0.2, 0.3], [2, 0.1, 0.2, 0.3]])
    assert [number for number, _ in found.named("HEARTBEAT")] == [1]
    assert len(found.table("WIND")) == 0


def test_a_message_without_a_time_of_its_own_comes_as_much_later_as_it_was_received() -> None:
    found = SystemMessages()
    found.add(1000.0, attitude(500))
    found.add(1000.25, link.heartbeat_encode(1, 3, 81, 10, 4))
    clock = found.boot_clock()
    assert clock.offset == 999.5
    assert clock.time.tolist() == [0.5, 0.75]


def test_rows_are_what_mavutil_reads(tmp_path: Path) -> None:
    path = telemetry(tmp_path / "a.tlog")
    raw = read_telemetry(path)
    log = mavutil.mavlink_connection(str(path))
    places = []
    while (message := log.recv_match(type="GLOBAL_POSITION_INT")) is not None:
        places.append(message)
    log.close()
    position, velocity = raw.series["position"], raw.series["velocity"]
    assert len(places) == len(position.time) == 460
    for k in np.linspace(0, 459, 10).astype(int):
        one = places[k]
        assert position.time[k] == pytest.approx(one.time_boot_ms * 1e-3)
        assert position.values[k] == pytest.approx([one.lat * 1e-7, one.lon * 1e-7, one.alt * 1e-3], abs=1e-9)
        assert velocity.values[k] == pytest.approx([one.vy * 0.01, one.vx * 0.01, -one.vz * 0.01])


def test_the_mission_is_the_one_that_went_up(tmp_path: Path) -> None:
    (logged,) = read_telemetry(telemetry(tmp_path / "a.tlog")).missions
    wanted = example_raw_log().missions[0].mission
    assert logged.mission.items == wanted.items
    assert logged.mission.home == wanted.home


def test_a_wind_blows_from_its_direction(tmp_path: Path) -> None:
    wind = read_telemetry(telemetry(tmp_path / "a.tlog")).series["wind"]
    assert wind.values[0] == pytest.approx([0.0, -3.0])


def test_equivalent_airspeed_becomes_true(tmp_path: Path) -> None:
    airspeed = read_telemetry(telemetry(tmp_path / "a.tlog")).series["airspeed"]
    # The standard atmosphere at 500 m has 0.9529 of the density at the sea.
    assert airspeed.values[0, 0] == pytest.approx(24.4 / 0.9529**0.5, rel=1e-3)


def test_the_vehicle_and_its_modes(tmp_path: Path) -> None:
    raw = read_telemetry(telemetry(tmp_path / "a.tlog"))
    assert (raw.vehicle, raw.program) == ("plane", "ArduPlane V4.5.0 (abcdef)")
    assert [(mode.name, mode.automatic) for mode in raw.modes] == [("AUTO", True)]
    assert read_telemetry(telemetry(tmp_path / "b.tlog", kind=2)).vehicle == "copter"
    px4 = read_telemetry(telemetry(tmp_path / "c.tlog", autopilot=12, mode=4 << 24 | 4 << 16))
    assert px4.modes[0].automatic


def test_a_log_of_a_station_alone_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no HEARTBEAT of a vehicle"):
        read_telemetry(telemetry(tmp_path / "a.tlog", kind=6, autopilot=8))


def test_a_restart_in_flight_goes_on(tmp_path: Path) -> None:
    """The clock since boot begins anew; what was received goes on."""
    path = telemetry(tmp_path / "a.tlog")
    path.write_bytes(path.read_bytes() * 2)
    raw = read_telemetry(path)
    assert len(raw.clock_jumps) == 1
    assert (np.diff(raw.series["position"].time) >= 0.0).all()


def test_home_is_where_the_vehicle_has_it_not_where_the_station_supposed_it(tmp_path: Path) -> None:
    path, sink = telemetry(tmp_path / "a.tlog"), bytearray()
    home = dialect.MAVLink_home_position_message(
        461_000_000, 81_000_000, 431_500, 0.0, 0.0, 0.0, [1.0, 0, 0, 0], 0, 0, 0
    )
    packet = home.pack(dialect.MAVLink(None, 1, 1))
    sink += path.read_bytes() + path.read_bytes()[:8] + packet
    path.write_bytes(bytes(sink))
    assert read_telemetry(path).missions[0].mission.home == Home(46.1, 8.1, 431.5)
