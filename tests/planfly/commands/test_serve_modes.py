"""A served vehicle that a station sends elsewhere in flight: it holds, goes to a place, goes on, and returns."""

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from logs.recording.reader import FlightLog, read_log
from planfly.cli import main
from tests.planfly.conftest import Served
from tests.soak import only_in_soak, some
from tests.stations import UdpStation, item

LAT, LON = 460_000_000, 80_000_000
# East for 2.3 km, then back on another height.
ROUTE = [
    item(0, LAT, LON, 0.0),
    item(1, LAT, LON, 100.0),
    item(2, LAT, LON + 150_000, 100.0),
    item(3, LAT, LON + 300_000, 130.0),
]
EARTH = 111_320.0


def here(station: UdpStation) -> tuple[float, float, float]:
    """Latitude, longitude and height, degrees and m, by the next message."""
    found = station.until(lambda m: m.get_type() == "GLOBAL_POSITION_INT")
    return found.lat / 1e7, found.lon / 1e7, found.alt / 1e3


def off(place: tuple[float, float, float], lat: float, lon: float) -> float:
    """Metres between a place and another."""
    return math.hypot((place[0] - lat) * EARTH, (place[1] - lon) * EARTH * math.cos(math.radians(lat)))


def in_mode(station: UdpStation, mode: int) -> Any:
    return station.until(lambda m: m.get_type() == "HEARTBEAT" and m.custom_mode == mode)


def set_mode(station: UdpStation, mode: int) -> None:
    assert station.command(mavlink.MAV_CMD_DO_SET_MODE, 1, mode) == mavlink.MAV_RESULT_ACCEPTED
    in_mode(station, mode)


@only_in_soak
@pytest.mark.parametrize("law", some(["ardupilot", "px4", "planfly"], 3))
def test_it_holds_goes_elsewhere_goes_on_and_returns(serve: Callable[..., Served], law: str) -> None:
    vehicle = serve("--scenario", "field.toml", "--speed", "20", "--autopilot", law)
    with UdpStation(vehicle.port) as station:
        assert station.upload(ROUTE) == 0
        assert station.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 11) == mavlink.MAV_RESULT_DENIED, "on the ground"
        station.fly()
        station.until(lambda m: m.get_type() == "GLOBAL_POSITION_INT" and m.lon > LON + 60_000)
        # Hold: it stays within a circle, whose widest is that of 30 degrees of bank beside where it was told to.
        held = here(station)
        set_mode(station, 12)
        assert max(off(here(station), held[0], held[1]) for _ in range(20)) < 600.0
        # Go to a place 900 m north and 60 m up, and circle there.
        lat, lon = held[0] + 900.0 / EARTH, held[1]
        station.send(
            mavlink.MAVLink_command_int_message(
                1,
                1,
                3,
                mavlink.MAV_CMD_DO_REPOSITION,
                0,
                0,
                -1,
                1,
                0,
                math.nan,
                round(lat * 1e7),
                round(lon * 1e7),
                160.0,
            )
        )
        in_mode(station, 15)
        station.until(lambda m: m.get_type() == "GLOBAL_POSITION_INT" and abs(m.alt - 160_000) < 8_000)
        assert max(off(here(station), lat, lon) for _ in range(20)) < 600.0
        reached = [m.seq for m in station.log if m.get_type() == "MISSION_ITEM_REACHED"]
        assert reached == [1], "no item is reached beside the mission"
        # On with the mission, at the item that it was on the way to.
        set_mode(station, 10)
        station.until(lambda m: m.get_type() == "MISSION_ITEM_REACHED" and m.seq == 2)
        assert station.until(lambda m: m.get_type() == "MISSION_CURRENT" and m.seq == 3).mission_state == 3
        assert station.command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH) == mavlink.MAV_RESULT_ACCEPTED
        in_mode(station, 11)
        station.until(lambda m: m.get_type() == "STATUSTEXT" and m.text.startswith("flight completed"))
        assert off(here(station), LAT / 1e7, LON / 1e7) < 500.0
        station.until(lambda m: m.get_type() == "STATUSTEXT" and "flight-005" in m.text)
        texts = station.texts()
    assert vehicle.stop() == 0
    for mode in ("LOITER", "GUIDED", "AUTO", "RTL"):
        assert f"flying in {mode}" in texts
    follow_each_other([read_log(vehicle.folder / "logs" / f"flight-00{k}.mcap") for k in range(1, 6)])
    assert main(["check", str(vehicle.folder / "logs" / "flight-005.mcap")]) == 0


def follow_each_other(logs: list[FlightLog]) -> None:
    """The logs of the flight above: what is flown in each, and that the aircraft flies on from one to the next."""
    modes = ["LOITER", "GUIDED", "AUTO", "RTL"]
    left = [f"left at a ground station's request for {mode}" for mode in modes]
    assert [log.ended for log in logs] == [*left, "completed"]
    items = [[1, 2, 3], [-1, 0], [-1, 0], [-1, 2, 3], [-1, 0]]
    assert [[one.seq for one in log.setup.mission.items] for log in logs] == items
    for before, after in itertools.pairwise(logs):
        step = after.track.position[0] - before.track.position[-1]
        assert np.linalg.norm(step) < 3.0, "the aircraft flies on where it was"
        assert after.track.velocity[0] == pytest.approx(before.track.velocity[-1], abs=1.5)
        assert after.track.attitude[0] == pytest.approx(before.track.attitude[-1], abs=0.1)
        assert after.track.energy[0] >= before.track.energy[-1], "nor is its battery full again"
