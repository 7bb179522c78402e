"""Coordinates through our files into other people's importers, as whole numbers of 1e-7 degrees."""

import json
import math
import random
import subprocess
import sys
from pathlib import Path

import pytest

from flight.live.mavlink_items import MissionType, from_message, item_type, to_message
from flight.mission.fences import numbered
from flight.mission.items import Command, Frame, Home, Mission, MissionItem, on_grid
from flight.mission_files.formats import mission_text, parse_mission
from flight.mission_files.wpl import fence_text
from world.errors import MissionError

IMPORTERS = Path(__file__).parents[2] / "clients" / "mavsdk_import.py"


def some_mission(count: int, seed: int = 1) -> Mission:
    """Waypoints and loiters all over the world, at coordinates that are not round."""
    dice = random.Random(seed)
    items = []
    for k in range(count):
        lat, lon = on_grid(dice.uniform(-89.9, 89.9)), on_grid(dice.uniform(-179.9, 179.9))
        command = dice.choice([16, 16, 16, 17, 18, 19, 31])
        items.append(MissionItem(k + 1, command, 3, (1.0, 30.0, 120.0, 0.0), lat, lon, round(dice.uniform(50, 900), 3)))
    place = [items[0].lat_deg, items[0].lon_deg]
    fences = [MissionItem(0, 5002, 0, (4.0, 0.0, 0.0, 0.0), item.lat_deg, item.lon_deg, 0.0) for item in items[:4]]
    fences += [MissionItem(0, 5004, 0, (250.5, 0.0, 0.0, 0.0), item.lat_deg, item.lon_deg, 0.0) for item in items[4:9]]
    rally = [MissionItem(0, 5100, 3, (0.0,) * 4, item.lat_deg, item.lon_deg, 100.0) for item in items[9:12]]
    return Mission(Home(place[0], place[1], 300.0), tuple(items), numbered(fences), numbered(rally))


@pytest.mark.client
def test_mavsdk_importers_get_the_same_integers(tmp_path: Path) -> None:
    pytest.importorskip("mavsdk")
    mission = some_mission(400)
    names = []
    for kind in ("plan", "waypoints"):
        file = tmp_path / f"a.{kind}"
        file.write_text(mission_text(mission, kind), encoding="ascii", newline="")  # type: ignore[arg-type]  # a Kind
        names.append(str(file))
    done = subprocess.run(
        [sys.executable, str(IMPORTERS), *names], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr[-1000:]
    plan, waypoints = json.loads(done.stdout.splitlines()[-1])
    wanted = [(int(item.frame), item.command, item.x, item.y) for item in mission.items]
    assert [tuple(row[1:5]) for row in plan[0]] == wanted
    # Mission Planner's importer keeps the home line as item 0.
    assert [tuple(row[1:5]) for row in waypoints[0]][-len(wanted) :] == wanted
    assert [tuple(row[2:5]) for row in plan[1]] == [(item.command, item.x, item.y) for item in mission.fences]
    assert [tuple(row[2:5]) for row in plan[2]] == [(item.command, item.x, item.y) for item in mission.rally]


def test_messages_come_back_the_same() -> None:
    from pymavlink.dialects.v20 import common

    link = common.MAVLink(None, srcSystem=1, srcComponent=1)
    mission = some_mission(200, seed=2)
    jump = MissionItem(201, int(Command.DO_JUMP), int(Frame.MISSION), (3.0, 2.0, 0.0, 0.0), 0.0, 0.0, 0.0)
    unset = MissionItem(202, 16, 3, (0.0, 0.0, 0.0, math.nan), math.nan, math.nan, 100.0)
    for item in (*mission.items, *mission.fences, *mission.rally, jump, unset):
        back = link.decode(bytearray(to_message(item, target_system=7).pack(link)))
        assert (back.x, back.y, back.seq, back.target_system) == (item.x, item.y, item.seq, 7)
        assert back.mission_type == item_type(item)
        again = from_message(back, "station")
        assert (again.x, again.y, again.command, again.frame) == (item.x, item.y, item.command, item.frame)
        assert str(again.params) == str(item.params)
        assert math.isnan(again.lat_deg) == math.isnan(item.lat_deg)
    assert item_type(mission.rally[0]) == MissionType.RALLY


def test_a_bad_message_is_refused() -> None:
    from pymavlink.dialects.v20 import common

    good = to_message(some_mission(1).items[0])
    for field, value, words in (
        ("x", 910_000_000, "latitude 91"),
        ("frame", 1, "frame 1"),
        ("param1", math.inf, "p1 inf"),
        ("z", math.inf, "altitude inf"),
    ):
        message = common.MAVLink_mission_item_int_message(
            *(getattr(good, name) if name != field else value for name in good.fieldnames)
        )
        with pytest.raises(MissionError, match=f"^station: item 1: .*{words}"):
            from_message(message, "station")


def test_pymavlink_loads_fences_as_they_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A fence file has no home line: pymavlink, and MAVProxy with it, would send that to the fence."""
    monkeypatch.setenv("MAVLINK20", "1")
    from pymavlink import mavwp

    mission = some_mission(30)
    text = fence_text(mission)
    assert parse_mission(text, "a.fence").fences == mission.fences
    loader = mavwp.MissionItemProtocol_Fence()
    file = tmp_path / "a.fence"
    file.write_text(text)
    assert loader.load(str(file)) == len(mission.fences)
    assert [loader.wp(k).command for k in range(loader.count())] == [item.command for item in mission.fences]
    assert [round(loader.wp(k).x * 1e7) for k in range(loader.count())] == [item.x for item in mission.fences]
