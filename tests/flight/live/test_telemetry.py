"""Snapshots: what was flown comes out under its name, true courses for courses on the map, and survives packing."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.telemetry import (
    AUTO,
    PERIODS,
    STREAMS,
    WARNING,
    Snapshot,
    SnapshotMaker,
    Status,
    heartbeat,
    status_texts,
    telemetry_message,
)
from flight.mission.items import Home
from flight.simulation.simulate import LocalMap
from flight.simulation.track import Track, track_rows
from tests.mission_lines import setup_of, wp


def a_track() -> Track:
    """One row, each number of it another."""
    return Track(
        time=np.array([7.0]),
        position=np.array([[120.0, 340.0, 560.0]]),
        velocity=np.array([[3.0, 4.0, 5.0]]),
        attitude=np.array([[0.1, 0.2, 0.3]]),
        rates=np.array([[0.01, 0.02, 0.03]]),
        airspeed=np.array([25.5]),
        flow=np.array([[0.04, 0.05]]),
        controls=np.array([[0.11, 0.12, 0.13, 0.75]]),
        commands=np.array([[0.21, 0.22, 0.23, 0.25]]),
        wind=np.array([[1.5, -2.5, 0.5]]),
        load_factor=np.array([1.25]),
        current=np.array([6.5]),
        energy=np.array([8.25]),
        leg=np.array([2]),
        cross_track=np.array([0.5]),
        height_error=np.array([0.125]),
        speed_command=np.array([24.0]),
        clearance=np.array([460.0]),
    )


def test_a_row_comes_out_under_its_names() -> None:
    """On the meridian of the map's origin north is true north."""
    setup = setup_of(wp(0, 0), wp(0, 2000))
    track = a_track()
    snapshot = SnapshotMaker(setup, LocalMap.around(setup)).snapshot(track_rows(track)[0])
    assert (snapshot.time, snapshot.amsl, snapshot.height, snapshot.leg) == (7.0, 560.0, 460.0, 2.0)
    assert (snapshot.airspeed, snapshot.throttle, snapshot.current, snapshot.energy) == (25.5, 0.75, 6.5, 8.25)
    assert (snapshot.roll, snapshot.pitch) == pytest.approx((0.1, 0.2))
    assert (snapshot.p, snapshot.q, snapshot.r) == pytest.approx((0.01, 0.02, 0.03))
    assert (snapshot.v_north, snapshot.v_east, snapshot.v_down) == pytest.approx((4.0, 3.0, -5.0), abs=1e-3)
    assert (snapshot.wind_north, snapshot.wind_east) == pytest.approx((-2.5, 1.5), abs=1e-3)
    assert snapshot.yaw == pytest.approx(0.3, abs=1e-4)
    assert Snapshot.unpack(snapshot.pack()) == snapshot
    assert snapshot.is_finite


def test_an_aircraft_waits_at_the_start_on_its_first_course() -> None:
    setup = setup_of(wp(0, 500), wp(2000, 500))
    snapshot = SnapshotMaker(setup, LocalMap.around(setup)).start_snapshot(setup)
    assert snapshot.amsl == pytest.approx(400.0)
    assert snapshot.height == pytest.approx(300.0)
    assert snapshot.yaw == pytest.approx(math.pi / 2.0, abs=1e-3)
    assert (snapshot.time, snapshot.airspeed, snapshot.leg) == (0.0, 0.0, -1.0)


# ----------------------------------------------------------------------
# Texts for stations: ASCII, in pieces that join to the whole, the last of them not full.


@pytest.mark.parametrize("length", [0, 1, 49, 50, 51, 99, 100, 399, 400, 500])
def test_pieces_join_to_the_text(length: int) -> None:
    text = ("0123456789" * 50)[:length]
    pieces = status_texts(text, WARNING, 3)
    assert "".join(piece.text for piece in pieces) == text[:400]
    assert all(piece.severity == WARNING for piece in pieces)
    if len(pieces) > 1:
        assert [(piece.id, piece.chunk_seq) for piece in pieces] == [(3, k) for k in range(len(pieces))]
        assert len(pieces[-1].text) < 50


def test_what_stations_cannot_show_is_replaced() -> None:
    (piece,) = status_texts("9° über 3 m", WARNING, 1)
    assert piece.text == "9 deg ?ber 3 m"


# ----------------------------------------------------------------------
# Telemetry: each message carries the snapshot's numbers in its own units, and none overflows.

FLYING = Snapshot(
    time=9.0,
    lat_deg=46.5,
    lon_deg=-8.25,
    amsl=612.5,
    height=112.5,
    v_north=3.0,
    v_east=4.0,
    v_down=-0.5,
    yaw=-0.5,
    airspeed=6.0,
    throttle=0.625,
    wind_north=1.0,
    current=12.0,
    energy=50.0,
    leg=1.0,
)
STATUS = Status(FLYING, Home(46.5, -8.25, 500.0), battery=200.0, volts=14.8, mode=AUTO, flying=True)


def test_positions_and_speeds_have_the_messages_units() -> None:
    position = telemetry_message("GLOBAL_POSITION_INT", STATUS)
    assert (position.lat, position.lon, position.alt) == (465_000_000, -82_500_000, 612_500)
    assert (position.relative_alt, position.vx, position.vy, position.vz) == (112_500, 300, 400, -50)
    assert position.hdg == 33_135  # -0.5 rad, as 0..360 degrees
    hud = telemetry_message("VFR_HUD", STATUS)
    assert (hud.groundspeed, hud.throttle, hud.climb) == (5.0, 62, 0.5)
    battery = telemetry_message("SYS_STATUS", STATUS)
    assert (battery.battery_remaining, battery.voltage_battery, battery.current_battery) == (75, 14_800, 1200)
    wind = telemetry_message("WIND", STATUS)
    assert (abs(wind.direction), wind.speed) == (180.0, 1.0)  # it blows north, from the south


@pytest.mark.parametrize("volts", [0.0, float("nan")])
def test_without_a_battery_neither_voltage_nor_current_is_measured(volts: float) -> None:
    """MAVLink's SYS_STATUS: voltage UINT16_MAX and current -1 are "not sent by autopilot"."""
    battery = telemetry_message("SYS_STATUS", replace(STATUS, volts=volts))
    assert (battery.voltage_battery, battery.current_battery) == (65535, -1)


@pytest.mark.parametrize("name", ["HEARTBEAT", *PERIODS])
@pytest.mark.parametrize("value", [-1e6, 0.0, 1e6])
def test_any_numbers_can_be_sent(name: str, value: float) -> None:
    bounded = ("lat_deg", "lon_deg", "energy")
    far = replace(FLYING, **{item.name: value for item in fields(FLYING) if item.name not in bounded})
    message = telemetry_message(name, replace(STATUS, snapshot=far))
    assert message.get_type() == name
    assert message.pack(mavlink.MAVLink(None, 1, 1))


def test_every_stream_names_messages_that_are_sent() -> None:
    assert {name for names in STREAMS.values() for name in names} == set(PERIODS)
    assert telemetry_message("NO_SUCH", STATUS) is None


def test_the_heartbeat_says_what_the_vehicle_does() -> None:
    flying = heartbeat(STATUS)
    assert (flying.custom_mode, flying.system_status) == (AUTO, mavlink.MAV_STATE_ACTIVE)
    parked = heartbeat(replace(STATUS, flying=False, armed=False))
    assert parked.system_status == mavlink.MAV_STATE_STANDBY
    assert not parked.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
