from dataclasses import replace

import pytest

from flight.mission.items import Command, MissionItem
from flight.simulation.setup import MissingItems
from logs.importers.logged_missions import LoggedItem, LoggedItemGroup, combine_items, make_logged_mission
from logs.importers.raw_log import LoggedMission

WAY = [MissionItem(k, 16, 0, (0.0,) * 4, 46.0 + 0.01 * k, 8.0, 75.0) for k in range(4)]


def items(time: float, way: list[MissionItem], total: int = 4) -> list[LoggedItem]:
    return [LoggedItem(time, total, item) for item in way]


def made_of(way: list[MissionItem], total: int) -> LoggedMission | None:
    return make_logged_mission(LoggedItemGroup(1.0, total, tuple(way)), "a.BIN", "CMD")


def test_items_that_are_flown_make_no_mission() -> None:
    rows = [*items(1.0, WAY), LoggedItem(30.0, 4, WAY[2]), LoggedItem(60.0, 4, WAY[3])]
    assert [(start, len(found)) for start, _, found in combine_items(rows)] == [(1.0, 4)]


def test_the_same_mission_again_is_one() -> None:
    assert len(combine_items([*items(1.0, WAY), *items(50.0, WAY)])) == 1


def test_another_place_begins_another_mission() -> None:
    moved = [WAY[0], replace(WAY[1], lat_deg=45.0), *WAY[2:]]
    found = combine_items([*items(1.0, WAY), *items(50.0, moved)])
    assert [one.time for one in found] == [1.0, 50.0]
    assert found[1].items[1].lat_deg == 45.0


def test_another_count_begins_another_mission() -> None:
    found = combine_items([*items(1.0, WAY), *items(50.0, WAY[:3], total=3)])
    assert [(one.total, len(one.items)) for one in found] == [(4, 4), (3, 3)]


def test_a_mission_that_is_downloaded_again_in_part_is_one() -> None:
    """The first three items of four, after all of them and before all of them."""
    begins = LoggedItem(50.0, 4, WAY[0], begins_mission=True)
    for rows in ([*items(1.0, WAY), begins, *items(51.0, WAY[1:3])], [*items(1.0, WAY[:3]), begins, *items(51.0, WAY)]):
        (found,) = combine_items(rows)
        assert (found.time, found.total, found.items) == (1.0, 4, tuple(WAY))


def test_a_second_upload_whose_first_items_are_lost_is_not_mixed_with_the_first() -> None:
    moved = [replace(item, lon_deg=9.0) for item in WAY]
    found = combine_items(
        [*items(1.0, WAY), LoggedItem(50.0, 4, moved[2], begins_mission=True), LoggedItem(50.0, 4, moved[3])]
    )
    assert [one.items for one in found] == [tuple(WAY), tuple(moved[2:])]


@pytest.mark.parametrize("begins", [False, True])
def test_a_mission_elsewhere_of_as_many_items_and_the_same_home_is_another(begins: bool) -> None:
    """Of the first the end is lost, of the second the beginning: but for home they have no item in common."""
    way = [replace(WAY[0], seq=k) for k in range(6)]
    north = [replace(item, lat_deg=47.0) for item in way[4:]]
    rows = [*items(1.0, way[:3], 6), LoggedItem(50.0, 6, way[0], begins_mission=begins), *items(50.0, north, 6)]
    assert [one.items for one in combine_items(rows)] == [tuple(way[:3]), (way[0], *north)]


def test_a_home_that_is_logged_again_begins_no_mission() -> None:
    (found,) = combine_items(
        [*items(1.0, WAY), LoggedItem(30.0, 4, WAY[0]), LoggedItem(30.0, 4, WAY[2]), LoggedItem(60.0, 4, WAY[0])]
    )
    assert found.items == tuple(WAY)


def test_items_that_no_autopilot_takes_are_left_out_and_told() -> None:
    way = [replace(WAY[0], seq=k, lat_deg=46.0 + 0.01 * k) for k in range(6)]
    made = made_of([*way[:2], replace(way[2], lat_deg=95.0), *way[3:]], 6)
    assert made is not None
    assert [item.seq for item in made.mission.items] == [3, 4, 5]
    (warning,) = made.mission.warnings
    assert "item 2: left out: latitude 95" in warning
    assert made.missing == MissingItems((2,), total=6, first=3, last=5, end=5)


def test_one_item_is_no_mission() -> None:
    assert made_of(WAY[:2], 2) is None
    assert made_of(WAY[:1], 1) is None


@pytest.mark.parametrize(
    ("held", "judged", "missing"),
    [
        ([0, 1, 2, 3, 4, 5, 6], (1, 6), [7, 8, 9, 10, 11, 12, 13]),
        ([0, *range(4, 14)], (4, 13), [1, 2, 3]),
        ([0, 1, 2, 3, *range(5, 14)], (5, 13), [4]),
        ([0, 1, 2, 4, 6, 7, 8, 11], (6, 8), [3, 5, 9, 10, 12, 13]),
        ([0, 5], (5, 5), [1, 2, 3, 4, *range(6, 14)]),
        ([0], (0, 0), list(range(1, 14))),
    ],
)
def test_of_14_items_those_that_are_missing_are_known_and_the_longest_run_is_kept(
    held: list[int], judged: tuple[int, int], missing: list[int]
) -> None:
    way = [MissionItem(k, 16, 0, (0.0,) * 4, 46.0 + 0.01 * k, 8.0, 75.0) for k in held]
    made = made_of(way, 14)
    assert made is not None
    assert made.missing == MissingItems(tuple(missing), 14, *judged, end=13)
    assert [item.seq for item in made.mission.items] == (
        [] if judged == (0, 0) else list(range(judged[0], judged[1] + 1))
    )


def test_a_run_ends_before_a_jump_out_of_it() -> None:
    """Items 1 to 7, of which the fifth is a jump to item 9, and nothing else."""
    way = [MissionItem(k, 16, 0, (0.0,) * 4, 46.0 + 0.01 * k, 8.0, 75.0) for k in range(8)]
    way[5] = MissionItem(5, int(Command.DO_JUMP), 2, (9.0, 1.0, 0.0, 0.0), 0.0, 0.0, 0.0)
    made = made_of(way, 10)
    assert made is not None
    assert made.missing == MissingItems((8, 9), total=10, first=1, last=4, end=9)
    assert len(made.mission.items) == 4


def test_a_run_ends_before_a_jump_to_what_was_cut() -> None:
    """Items 1 to 6 of 12: item 5 jumps out of them, and item 3 to item 6, which is cut off with it."""
    way = [MissionItem(k, 16, 0, (0.0,) * 4, 46.0 + 0.01 * k, 8.0, 75.0) for k in range(7)]
    for k, target in ((3, 6.0), (5, 9.0)):
        way[k] = MissionItem(k, int(Command.DO_JUMP), 2, (target, 1.0, 0.0, 0.0), 0.0, 0.0, 0.0)
    made = made_of(way, 12)
    assert made is not None
    assert [item.seq for item in made.mission.items] == [1, 2]
    assert made.missing == MissingItems(tuple(range(7, 12)), total=12, first=1, last=2, end=11)


def test_a_home_that_is_not_in_the_log_is_told() -> None:
    made = made_of(WAY[1:], 4)
    assert made is not None
    assert made.missing is None
    assert made.mission.warnings == ("the log lacks item 0 (home) of the mission's 4 items",)


def test_a_changed_item_alone_changes_the_mission() -> None:
    found = combine_items([*items(1.0, WAY), LoggedItem(50.0, 4, replace(WAY[2], alt=90.0))])
    assert [(one.time, len(one.items), one.items[2].alt) for one in found] == [(1.0, 4, 75.0), (50.0, 4, 90.0)]
