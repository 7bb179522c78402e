from dataclasses import replace

from flight.mission.items import MissionItem
from logs.importers.logged_missions import Item, gather_items, logged_mission

WAY = [MissionItem(k, 16, 0, (0.0,) * 4, 46.0 + 0.01 * k, 8.0, 75.0) for k in range(4)]


def items(time: float, way: list[MissionItem], total: int = 4) -> list[Item]:
    return [Item(time, total, item) for item in way]


def test_items_that_are_flown_make_no_mission() -> None:
    rows = [*items(1.0, WAY), Item(30.0, 4, WAY[2]), Item(60.0, 4, WAY[3])]
    assert [(start, len(found)) for start, found in gather_items(rows)] == [(1.0, 4)]


def test_the_same_mission_again_is_one() -> None:
    assert len(gather_items([*items(1.0, WAY), *items(50.0, WAY)])) == 1


def test_another_place_begins_another_mission() -> None:
    moved = [WAY[0], replace(WAY[1], lat_deg=45.0), *WAY[2:]]
    found = gather_items([*items(1.0, WAY), *items(50.0, moved)])
    assert [start for start, _ in found] == [1.0, 50.0]
    assert found[1][1][1].lat_deg == 45.0


def test_another_count_begins_another_mission() -> None:
    found = gather_items([*items(1.0, WAY), *items(50.0, WAY[:3], total=3)])
    assert [len(one) for _, one in found] == [4, 3]


def test_items_that_no_autopilot_takes_are_left_out_and_told() -> None:
    made = logged_mission((WAY[0], WAY[1], replace(WAY[2], lat_deg=95.0), WAY[3]), "a.BIN")
    assert made is not None
    assert [item.seq for item in made.items] == [1, 3]
    assert len(made.warnings) == 2
    assert "item 2: left out: latitude 95" in made.warnings[0]
    assert made.warnings[1] == "the log holds no item 2 of the mission"


def test_one_item_is_no_mission() -> None:
    assert logged_mission((WAY[0], WAY[1]), "a.BIN") is None


def test_a_changed_item_alone_changes_the_mission() -> None:
    found = gather_items([*items(1.0, WAY), Item(50.0, 4, replace(WAY[2], alt=90.0))])
    assert [(start, len(one), one[2].alt) for start, one in found] == [(1.0, 4, 75.0), (50.0, 4, 90.0)]
