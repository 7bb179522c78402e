"""Edits of a mission's items: what is not changed stays as it was, numbers and jumps follow."""

import math
from dataclasses import replace

import pytest

from flight.mission import edits
from flight.mission.items import Command, Frame, Mission, MissionItem
from world.errors import MissionError


def item(seq: int, command: int = 16, frame: int = 3, alt: float = 75.0, p1: float = 0.0) -> MissionItem:
    place = (46.0 + 0.01 * seq, 8.0, alt) if command not in (177, 178) else (0.0, 0.0, 0.0)
    return MissionItem(seq, command, frame, (p1, 30.0, 0.0, 0.0), *place)


def mission(*items: MissionItem) -> Mission:
    return Mission(None, items, source="m.waypoints")


JUMPING = mission(item(1), item(2), item(3), item(4, 177, 2, p1=2.0), item(5), item(6))


@pytest.mark.parametrize("frame", [Frame.GLOBAL, Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_TERRAIN_ALT])
def test_a_move_changes_the_position_alone(frame: Frame) -> None:
    before = mission(item(1, frame=frame), item(2, frame=frame))
    after = edits.move_item(before, 1, 46.5, 8.5)
    assert after.items == (before.items[0], replace(before.items[1], lat_deg=46.5, lon_deg=8.5))


def test_a_height_changes_by_the_same_in_every_frame() -> None:
    for frame in (Frame.GLOBAL, Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_TERRAIN_ALT):
        after = edits.set_altitude(mission(item(1), item(2, frame=frame, alt=50.0)), 1, 512.0, 500.0)
        assert (after.items[1].frame, after.items[1].alt) == (frame, 62.0)


def test_an_item_without_a_height_gets_one_above_mean_sea_level() -> None:
    after = edits.set_altitude(mission(item(1), item(2, alt=math.nan)), 1, 512.0, 500.0)
    assert (after.items[1].frame, after.items[1].alt) == (Frame.GLOBAL, 512.0)
    assert math.isnan(edits.raise_items(mission(item(1), item(2, alt=math.nan)), [1], 10.0).items[1].alt)


def test_what_is_inserted_counts_on_items_and_jumps_beyond_it() -> None:
    after = edits.insert_waypoint(JUMPING, 0, 46.5, 8.5)
    assert [one.seq for one in after.items] == [1, 2, 3, 4, 5, 6, 7]
    assert after.items[4].params[0] == 3.0  # the same item as before
    behind = edits.insert_waypoint(JUMPING, 4, 46.5, 8.5)
    assert behind.items[3].params[0] == 2.0
    assert behind.items[5].params[1] == 30.0  # the acceptance radius of the one before


def test_what_is_deleted_is_undone_by_inserting_it() -> None:
    without = edits.delete_item(JUMPING, 2)
    assert [one.seq for one in without.items] == [1, 2, 3, 4, 5]
    assert without.items[2].params[0] == 2.0
    first = edits.delete_item(JUMPING, 0)
    assert first.items[2].params[0] == 1.0


def test_a_jump_to_what_is_deleted_leads_to_what_follows() -> None:
    after = edits.delete_item(JUMPING, 1)
    assert (after.items[2].command, after.items[2].params[0]) == (177, 2.0)
    assert after.items[1].lat_deg == JUMPING.items[2].lat_deg


def test_two_places_are_kept() -> None:
    with pytest.raises(MissionError, match="at least two positions"):
        edits.delete_item(mission(item(1), item(2)), 0)


@pytest.mark.parametrize(
    ("index", "words"),
    [(3, "item 4: 177: expected a command with a position"), (9, "expected 0..5"), (-1, "expected 0..5")],
)
def test_what_is_no_place_is_not_moved(index: int, words: str) -> None:
    with pytest.raises(MissionError, match=words):
        edits.move_item(JUMPING, index, 46.0, 8.0)


def test_a_place_beyond_the_world_is_refused() -> None:
    with pytest.raises(MissionError, match="latitude 91"):
        edits.move_item(JUMPING, 0, 91.0, 8.0)


def test_a_leg_is_flown_at_a_speed_and_the_next_as_before() -> None:
    after = edits.set_airspeed(JUMPING, 1, 20.0, 25.0)
    assert [(one.command, one.params[1]) for one in after.items[1:4]] == [(178, 20.0), (16, 30.0), (178, 25.0)]
    assert after.items[5].params[0] == 3.0
    again = edits.set_airspeed(after, 2, 22.0, 25.0)
    assert [one.command for one in again.items] == [one.command for one in after.items]
    assert again.items[1].params[1] == 22.0


def test_the_last_leg_needs_no_speed_after_it() -> None:
    after = edits.set_airspeed(mission(item(1), item(2)), 1, 20.0, 25.0)
    assert [one.command for one in after.items] == [16, Command.DO_CHANGE_SPEED, 16]


def test_an_airspeed_for_several_legs_is_restored_after_the_last() -> None:
    after = edits.set_airspeed(mission(*(item(k) for k in range(1, 6))), 1, 20.0, 25.0, 3)
    assert [(one.command, one.params[1]) for one in after.items if one.command == 178] == [(178, 20.0), (178, 25.0)]
    assert [one.command for one in after.items] == [16, 178, 16, 16, 16, 178, 16]


def test_a_mission_has_its_most_items() -> None:
    full = mission(*(item(k) for k in range(1, edits.MAX_EDITED_ITEMS + 1)))
    with pytest.raises(MissionError, match="the most that can be edited"):
        edits.insert_waypoint(full, 0, 46.0, 8.0)
