from dataclasses import replace

from flight.mission.items import MissionItem
from logs.importers.logged_missions import Item, gather_items, logged_mission, logged_parameters
from logs.importers.raw_log import example_raw_log

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


# ----------------------------------------------------------------------
# Logged parameters.


def parameters(**values: float):
    return logged_parameters(replace(example_raw_log(), parameters=values))


def test_older_names_and_units_are_taken() -> None:
    found, notes = parameters(TRIM_ARSPD_CM=1800.0, LIM_ROLL_CD=4500.0)
    assert found is not None
    assert (found.airspeed_cruise, found.by_origin("file")["ROLL_LIMIT_DEG"], notes) == (18.0, 45.0, ())


def test_what_is_not_allowed_is_told_and_the_default_taken() -> None:
    found, notes = parameters(WP_RADIUS=-5.0, NAVL1_PERIOD=20.0)
    assert found is not None
    assert (found.wp_radius, found.navl1_period) == (90.0, 20.0)
    assert notes == ("WP_RADIUS -5 of the log is not allowed: the default is taken",)


def test_a_least_beyond_its_most_gives_way() -> None:
    found, notes = parameters(AIRSPEED_MIN=30.0, AIRSPEED_MAX=20.0)
    assert found is not None
    assert (found.airspeed_min, found.airspeed_max) == (9.0, 22.0)
    assert notes[0].startswith("AIRSPEED_MIN 30 and AIRSPEED_MAX 20")


def test_a_log_without_parameters_says_that_defaults_are_taken() -> None:
    found, notes = parameters()
    assert found is not None
    assert notes == ("the log holds no parameters: ArduPlane's defaults are taken",)


def test_another_autopilot_has_none() -> None:
    assert logged_parameters(replace(example_raw_log(), program="PX4 v1.14.0")) == (None, ())
