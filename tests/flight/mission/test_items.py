"""Notes stand in the order in which their reasons came up, each with its items in ranges."""

import math

import pytest

from flight.mission.items import (
    Command,
    Frame,
    Home,
    Mission,
    MissionItem,
    Notes,
    command_name,
    item_problem,
    renumber_items,
)


def test_each_reason_is_said_once_with_all_its_items_in_ranges() -> None:
    notes = Notes()
    for text, seq in (("b", 7), ("a", 2), ("b", 8), ("b", 8), ("b", 11), ("whole", None), ("whole", None), ("a", 1)):
        notes.add(text, seq)
    assert notes.lines() == ("items 7-8, 11: b", "items 1-2: a", "whole")


def test_one_item_is_no_items_and_nothing_noted_is_no_line() -> None:
    notes = Notes()
    assert notes.lines() == ()
    notes.add("a", 5)
    assert notes.lines() == ("item 5: a",)


# ----------------------------------------------------------------------
# Items: which have a position, what no autopilot could make sense of, and numbers after home's.


def item(command: int = 16, frame: int = 3, lat: float = 36.5, lon: float = -84.2, **others: float) -> MissionItem:
    params = (others.get("p1", 0.0), others.get("p2", 0.0), 0.0, 0.0)
    return MissionItem(int(others.get("seq", 1)), command, frame, params, lat, lon, others.get("alt", 100.0))


@pytest.mark.parametrize(
    ("lat", "lon", "positioned"), [(36.5, -84.2, True), (0.0, 0.0, False), (math.nan, -84.2, False), (0.0, 1.0, True)]
)
def test_zero_zero_and_nan_are_no_position(lat: float, lon: float, positioned: bool) -> None:
    assert item(lat=lat, lon=lon).has_position == positioned


def test_a_command_without_a_position_keeps_its_parameters_unscaled() -> None:
    servo = item(command=Command.DO_SET_SERVO, frame=Frame.MISSION, lat=5.0, lon=6.0)
    assert (servo.x, servo.y, servo.has_position) == (5, 6, False)
    assert (item().x, item().y) == (365_000_000, -842_000_000)
    assert item(lat=math.nan).x == 2**31 - 1


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (item(frame=1), "frame 1"),
        (item(lat=91.0), "latitude 91: allowed -90..90 degrees (latitude"),
        (item(lon=181.0), "longitude 181"),
        (item(alt=20_001.0), "altitude 20001"),
        (item(p1=1e39), "p1 1e+39"),
        (item(command=Command.DO_JUMP, frame=Frame.MISSION, p1=1.5), "p1 1.5"),
        (item(command=Command.DO_JUMP, frame=Frame.MISSION, p1=1.0, p2=-2.0), "p2 -2"),
        (item(command=Command.NAV_LOITER_TURNS, p1=-1.0), "p1 -1"),
        (item(command=Command.NAV_FENCE_POLYGON_VERTEX_INCLUSION, p1=2.0), "p1 2"),
        (item(command=Command.NAV_FENCE_CIRCLE_EXCLUSION, p1=0.0), "p1 0"),
        (item(frame=Frame.MISSION), "frame 2: has no coordinates"),
    ],
)
def test_a_problem_names_the_field_and_the_value(wrong: MissionItem, text: str) -> None:
    assert str(item_problem(wrong)).startswith(text)
    assert item_problem(item()) is None


def test_numbers_move_up_for_home_and_jumps_with_them() -> None:
    jump = item(command=Command.DO_JUMP, frame=Frame.MISSION, lat=0.0, lon=0.0, seq=1, p1=0.0, p2=2.0)
    moved = renumber_items(Mission(Home(36.5, -84.2, 300.0), (item(seq=0), jump)))
    assert [one.seq for one in moved.items] == [1, 2]
    assert moved.items[1].params[:2] == (1.0, 2.0)
    assert renumber_items(moved) is moved


def test_every_command_has_its_mavlink_name() -> None:
    from pymavlink.dialects.v20 import common

    for command in Command:
        known = common.enums["MAV_CMD"].get(int(command))
        if known is not None:
            assert known.name == f"MAV_CMD_{command_name(command)}"
