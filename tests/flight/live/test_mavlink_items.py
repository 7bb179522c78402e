"""Items as MISSION_ITEM_INT: the same after the wire, or refused with the item and the field."""

import math

import pytest

from flight.live.mavlink_items import MissionType, from_message, item_type, to_message
from flight.mission.items import Command, Frame, MissionItem
from tests.flight.mission_files.worldwide_mission import some_mission
from world.errors import MissionError


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
    for field, value, text in (
        ("x", 910_000_000, "latitude 91"),
        ("frame", 1, "frame 1"),
        ("param1", math.inf, "p1 inf"),
        ("z", math.inf, "altitude inf"),
    ):
        message = common.MAVLink_mission_item_int_message(
            *(getattr(good, name) if name != field else value for name in good.fieldnames)
        )
        with pytest.raises(MissionError, match=f"^station: item 1: .*{text}"):
            from_message(message, "station")
