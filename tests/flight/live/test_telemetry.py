"""Telemetry: each message carries the snapshot's numbers in its own units, and none overflows."""

from dataclasses import fields, replace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight.live.snapshot import Snapshot
from flight.live.telemetry import AUTO, PERIODS, STREAMS, Status, heartbeat, telemetry_message
from flight.mission.items import Home

FLYING = Snapshot(
    time=9.0, lat_deg=46.5, lon_deg=-8.25, amsl=612.5, height=112.5, v_north=3.0, v_east=4.0, v_down=-0.5, yaw=-0.5,
    airspeed=6.0, throttle=0.625, wind_north=1.0, current=12.0, energy=50.0, leg=1.0,
)  # fmt: skip
STATUS = Status(FLYING, Home(46.5, -8.25, 500.0), battery=200.0, mode=AUTO, flying=True)


def test_positions_and_speeds_have_the_messages_units() -> None:
    position = telemetry_message("GLOBAL_POSITION_INT", STATUS)
    assert (position.lat, position.lon, position.alt) == (465_000_000, -82_500_000, 612_500)
    assert (position.relative_alt, position.vx, position.vy, position.vz) == (112_500, 300, 400, -50)
    assert position.hdg == 33_135  # -0.5 rad, as 0..360 degrees
    hud = telemetry_message("VFR_HUD", STATUS)
    assert (hud.groundspeed, hud.throttle, hud.climb) == (5.0, 62, 0.5)
    battery = telemetry_message("SYS_STATUS", STATUS)
    assert (battery.battery_remaining, battery.current_battery) == (75, 1200)
    wind = telemetry_message("WIND", STATUS)
    assert (abs(wind.direction), wind.speed) == (180.0, 1.0)  # it blows north, from the south


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
