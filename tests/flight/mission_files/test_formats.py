"""Mission files: our forms through other people's readers, other people's forms through ours."""

import json
import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight.mission.items import Command, Frame, Home, Mission, MissionItem, is_located, round_to_grid
from flight.mission_files.formats import fence_text, mission_text, parse_mission, rally_text, read_mission
from tests.soak import scaled

SAMPLES = Path(__file__).parents[1] / "missions"

# What each sample holds, counted by hand: mission items, of which have a place, warnings.
DIALECTS = {
    "by_hand.waypoints": (5, 5, ["no item is marked as current", "home is at 0, 0"]),
    "endless.waypoints": (6, 4, ["home is at 0, 0"]),
    "mavproxy.txt": (
        6,
        5,
        ["no item is marked as current", "the sequence numbers have a gap before 4 (2 gaps in all)"],
    ),
    "mavproxy_terrain.txt": (4, 4, []),
    "mission_planner.waypoints": (10, 5, []),
    "mission_planner_land.waypoints": (7, 6, []),
    "qgc.waypoints": (11, 5, []),
    "qgc_amsl.plan": (6, 5, ["item 2: NAV_WAYPOINT has no position", "plannedHomePosition is not a position"]),
    "qgc_takeoff.plan": (11, 7, []),
}


def test_every_sample_is_expected() -> None:
    assert sorted(DIALECTS) == sorted(path.name for path in SAMPLES.iterdir() if not path.name.startswith("."))


@pytest.mark.parametrize("name", sorted(DIALECTS))
def test_every_dialect_is_read(name: str) -> None:
    items, places, warnings = DIALECTS[name]
    mission = read_mission(SAMPLES / name)
    assert len(mission.items) == items
    assert sum(item.has_position for item in mission.items) == places
    assert len(mission.warnings) == len(warnings)
    for got, wanted in zip(mission.warnings, warnings, strict=True):
        assert wanted in got
    assert (mission.home is None) == (name in ("by_hand.waypoints", "endless.waypoints", "qgc_amsl.plan"))


def test_samples_are_what_their_names_say() -> None:
    """An editor that mends line ends would empty the test above of its meaning."""
    assert b"\r\n" in (SAMPLES / "mission_planner.waypoints").read_bytes()
    assert b"\t" not in (SAMPLES / "by_hand.waypoints").read_bytes()
    assert not (SAMPLES / "by_hand.waypoints").read_bytes().endswith(b"\n")
    assert b"\n# " in (SAMPLES / "mavproxy.txt").read_bytes()


@pytest.mark.parametrize("name", sorted(DIALECTS))
@pytest.mark.parametrize("kind", ["waypoints", "plan"])
def test_samples_survive_both_forms(name: str, kind: Any) -> None:
    mission = read_mission(SAMPLES / name)
    text = mission_text(mission, kind)
    again = parse_mission(text, f"again.{kind}")
    assert mission_text(again, kind) == text
    assert [(item.x, item.y, item.alt) for item in again.items if item.has_position] == [
        (item.x, item.y, item.alt) for item in mission.items if item.has_position
    ]


def test_fence_and_rally_of_a_plan_are_kept() -> None:
    mission = read_mission(SAMPLES / "qgc_takeoff.plan")
    assert [item.command for item in mission.fences] == [5001] * 4 + [5004]
    assert mission.fences[4].params[0] == 800.5
    assert [item.command for item in mission.rally] == [5100]
    assert parse_mission(mission_text(mission, "plan"), "x.plan") == mission
    assert parse_mission(fence_text(mission), "x.waypoints").fences == mission.fences
    assert parse_mission(rally_text(mission), "x.waypoints").rally == mission.rally


# Random missions.

latitudes = st.integers(-900_000_000, 900_000_000).map(lambda n: n / 1e7)
longitudes = st.integers(-1_800_000_000, 1_800_000_000).map(lambda n: n / 1e7)
heights = st.one_of(st.integers(-1_000_000, 20_000_000).map(lambda n: n / 1e3), st.floats(-1000.0, 20_000.0))
singles = st.floats(-(2.0**100), 2.0**100, width=32) | st.integers(-1000, 1000).map(float)
frames = st.sampled_from([int(frame) for frame in Frame if frame != Frame.MISSION])


@st.composite
def missions(draw: st.DrawFn) -> Mission:
    """Missions of positions and of commands without."""
    items: list[MissionItem] = []
    for seq in range(1, draw(st.integers(1, 8)) + 1):
        if draw(st.booleans()):
            command = draw(st.sampled_from([16, 17, 21, 22, 31, 82, 84, 189]))
            place = (draw(frames), draw(latitudes), draw(longitudes), draw(heights))
            params = (abs(draw(singles)), draw(singles), draw(singles), draw(singles))
        elif draw(st.booleans()):
            command = int(Command.DO_JUMP)
            place = (2, 0.0, 0.0, 0.0)
            params = (float(draw(st.integers(0, 500))), float(draw(st.integers(-1, 9))), 0.0, 0.0)
        else:
            command = draw(st.sampled_from([20, 93, 112, 178, 183, 203, 206, 530, 40_000]))
            place = (2, draw(st.floats(-2e9, 2e9)), 0.0, draw(singles))
            params = (draw(singles), draw(singles), draw(singles), draw(singles))
        items.append(MissionItem(seq, command, place[0], params, *place[1:], draw(st.booleans())))
    home = Home(draw(latitudes), draw(longitudes), draw(heights)) if draw(st.booleans()) else None
    if home is not None and home.lat_deg == 0.0 and home.lon_deg == 0.0:
        home = None
    return Mission(home, tuple(items))


@settings(max_examples=scaled(150, 50), deadline=None)
@given(mission=missions())
def test_write_then_read_is_the_same_mission(mission: Mission) -> None:
    assert parse_mission(mission_text(mission, "waypoints"), "a.waypoints") == mission
    assert parse_mission(mission_text(mission, "plan"), "a.plan") == mission


@settings(max_examples=60, deadline=None)
@given(mission=missions())
def test_other_readers_get_the_same_integers(mission: Mission, tmp_path_factory: pytest.TempPathFactory) -> None:
    os.environ.setdefault("MAVLINK20", "1")
    from pymavlink import mavutil, mavwp
    from pymavlink.dialects.v20 import common

    # Another test may have loaded the first version's messages.
    mavutil.set_dialect("ardupilotmega")

    file = tmp_path_factory.mktemp("wpl") / "a.waypoints"
    file.write_text(mission_text(mission, "waypoints"), encoding="ascii", newline="")
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(file)) == len(mission.items) + 1
    listed = json.loads(mission_text(mission, "plan"))["mission"]["items"]
    sender = common.MAVLink(None, srcSystem=1, srcComponent=1)
    for k, item in enumerate(mission.items):
        read = loader.wp(k + 1)
        assert (read.command, read.frame, read.z) == (item.command, item.frame, item.alt)
        assert (read.param1, read.param2, read.param3, read.param4) == item.params
        assert listed[k]["params"][:4] == list(item.params)
        if not is_located(item.command, item.frame):
            continue
        assert (round(read.x * 1e7), round(read.y * 1e7)) == (item.x, item.y)
        assert tuple(round(value * 1e7) for value in listed[k]["params"][4:6]) == (item.x, item.y)
        message = common.MAVLink_mission_item_int_message(
            1, 1, item.seq, item.frame, item.command, 0, 1, *item.params, item.x, item.y, item.alt
        )
        back = sender.decode(bytearray(message.pack(sender)))
        assert (back.x, back.y) == (item.x, item.y)
        assert (back.x / 1e7, back.y / 1e7) == (item.lat_deg, item.lon_deg)


@given(st.floats(-180.0, 180.0))
def test_grid_rounds_and_never_truncates(degrees: float) -> None:
    assert abs(round_to_grid(degrees) - degrees) <= 0.5e-7 * (1 + 1e-6)
    assert round_to_grid(round_to_grid(degrees)) == round_to_grid(degrees)


def test_what_is_written_to_the_byte() -> None:
    item = MissionItem(1, 16, 0, (0.0, 25.0, 0.0, math.nan), 36.5, -84.25, 850.125)
    mission = Mission(Home(36.5, -84.25, 354.5), (item,))
    assert mission_text(mission, "waypoints") == (
        "QGC WPL 110\n"
        "0\t1\t0\t16\t0\t0\t0\t0\t36.50000000\t-84.25000000\t354.500\t1\n"
        "1\t0\t0\t16\t0\t25\t0\t0\t36.50000000\t-84.25000000\t850.125\t1\n"
    )
    data = json.loads(mission_text(mission, "plan"))
    assert (data["fileType"], data["version"], data["mission"]["version"]) == ("Plan", 1, 2)
    assert (data["geoFence"]["version"], data["rallyPoints"]["version"]) == (2, 2)
    assert (data["mission"]["firmwareType"], data["mission"]["vehicleType"]) == (0, 1)
    for autopilot, firmware in (("ardupilot", 3), ("px4", 12), ("planfly", 0)):
        written = mission_text(replace(mission, autopilot=autopilot), "plan")
        assert json.loads(written)["mission"]["firmwareType"] == firmware
        assert parse_mission(written, "a.plan").autopilot == ("" if autopilot == "planfly" else autopilot)
    assert data["mission"]["plannedHomePosition"] == [36.5, -84.25, 354.5]
    assert data["mission"]["items"] == [
        {
            "AMSLAltAboveTerrain": None,
            "Altitude": 850.125,
            "AltitudeMode": 2,
            "autoContinue": True,
            "command": 16,
            "doJumpId": 1,
            "frame": 0,
            "params": [0.0, 25.0, 0.0, None, 36.5, -84.25, 850.125],
            "type": "SimpleItem",
        }
    ]


def test_a_file_without_home_keeps_its_first_item() -> None:
    """As Mission Planner, which puts an empty home before it; both written forms keep 0 for home."""
    text = "QGC WPL 110\n3 1 3 22 0 0 0 0 36.5 -84 100 1\n4 0 3 16 0 0 0 0 36.6 -84 100 1\n5 0 2 177 1 1 0 0 0 0 0 1\n"
    mission = parse_mission(text, "a.waypoints")
    assert mission.home is None
    assert [item.seq for item in mission.items] == [1, 2, 3]
    assert mission.warnings[0] == (
        "a.waypoints:2: no home line (seq 0): the mission has no home and begins with this item, as in Mission Planner."
        " QGroundControl and MAVProxy treat this item as home and do not fly it"
    )
    for kind in ("waypoints", "plan"):
        again = parse_mission(mission_text(mission, kind), f"a.{kind}")
        assert [item.seq for item in again.items] == [1, 2, 3]
        assert again.items[2].params[0] == 1.0
