"""A flight as a `.tlog`: what pymavlink's own reader makes of it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from logs.exports.telemetry_file import telemetry_bytes
from logs.field_logs.readers.telemetry_log import read_telemetry
from logs.recording.reader import FlightLog, read_log
from world.frames import to_geo

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


@pytest.fixture(scope="module")
def messages(tlog: Path) -> list[Any]:
    """Every message, as MAVExplorer and MAVProxy read them."""
    from pymavlink import mavutil

    mavutil.set_dialect("ardupilotmega")
    reader, found = mavutil.mavlink_connection(str(tlog)), []
    while (message := reader.recv_match()) is not None:
        found.append(message)
    reader.close()
    return found


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


def test_our_own_reader_finds_flight_and_mission(tlog: Path, log: FlightLog) -> None:
    raw = read_telemetry(tlog)
    assert raw.vehicle == "plane"
    assert len(raw.missions[-1].mission.items) == len(log.setup.mission.items)
    assert raw.series["position"].time[-1] - raw.series["position"].time[0] == pytest.approx(log.end_time, abs=0.2)
