"""Malformed .waypoints files: each is refused in one line that names the line, the field and what is allowed."""

from pathlib import Path

import pytest
from pymavlink.mavwp import MAVFenceLoader, MAVWPLoader

from flight.mission.items import Home, Mission, MissionItem
from flight.mission.itinerary import make_itinerary
from flight.mission_files.formats import (
    is_point_list,
    mission_text,
    parse_fence_points,
    parse_mission,
    read_fence,
    waypoints_text,
)
from tests.flight.mission_files.malformed_files import BAD_WPL, refused
from world.errors import MissionError


@pytest.mark.parametrize("case", sorted(BAD_WPL))
def test_malformed_waypoints_are_refused(case: str, tmp_path: Path) -> None:
    text, wanted = BAD_WPL[case]
    file = tmp_path / "bad.waypoints"
    file.write_text(text, encoding="utf-8", newline="")
    refused(file, wanted)


# ----------------------------------------------------------------------
# Fences as lists of points: as pymavlink's own loader saves them, and what is no such list.

RETURN = (36.505, -84.195)
CORNERS = [(36.5, -84.2), (36.5, -84.19), (36.51, -84.19), (36.51, -84.2)]


def text_of(points: list[tuple[float, float]]) -> str:
    return "".join(f"{lat}\t{lon}\n" for lat, lon in points)


def test_a_fence_that_pymavlink_saved_is_its_polygon_without_the_return_point(tmp_path: Path) -> None:
    loader = MAVFenceLoader()
    for lat, lon in [RETURN, *CORNERS, CORNERS[0]]:
        loader.add_latlon(lat, lon)
    loader.save(str(tmp_path / "saved.fence"))
    items = read_fence(tmp_path / "saved.fence").fences
    assert [(item.lat_deg, item.lon_deg) for item in items] == CORNERS
    assert {(item.command, item.params[0]) for item in items} == {(5001, 4.0)}


def test_a_ring_without_a_return_point_is_taken_whole() -> None:
    items = parse_fence_points("#saved by hand\r\n\r\n" + text_of([*CORNERS, CORNERS[0]]), "a.fence")
    assert [(item.lat_deg, item.lon_deg) for item in items] == CORNERS


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (text_of([RETURN, *CORNERS]), "a.fence: 5 points: expected a return point and a closed ring"),
        (text_of([RETURN, *CORNERS[:2], CORNERS[0]]), "a.fence: 4 points"),
        (text_of([*CORNERS[:2], CORNERS[0]]), "a.fence: 3 points"),
        ("36.5 -84.2\n36.5\n", "a.fence:2: '36.5': expected a latitude and a longitude"),
        ("36.5 -84.2\n36.5 west\n", "a.fence:2: '36.5 west'"),
        ("36.5 -84.2\n96.5 -84.2\n", "a.fence:2: latitude"),
        ("36.5 -84.2\nnan -84.2\n", "a.fence:2: 'nan -84.2': expected a latitude"),
        (text_of([RETURN, *CORNERS * 64, CORNERS[0]]), "a.fence: too long: 258 points; the limit is 255"),
    ],
)
def test_what_is_no_such_fence(text: str, message: str) -> None:
    with pytest.raises(MissionError) as error:
        parse_fence_points(text, "a.fence")
    assert str(error.value).startswith(message)


def test_three_corners_and_255_points_are_enough() -> None:
    assert len(parse_fence_points(text_of([RETURN, *CORNERS[:3], CORNERS[0]]), "a.fence")) == 3
    many = [(36.5 + 1e-4 * k, -84.2) for k in range(253)]
    assert len(parse_fence_points(text_of([RETURN, *many, many[0]]), "a.fence")) == 253


@pytest.mark.parametrize(("text", "points"), [("", False), ("QGC WPL 110\n", False), ("{}", False), ("-3.5 8", True)])
def test_a_list_of_points_begins_with_a_number(text: str, points: bool) -> None:
    assert is_point_list(text) is points


# ----------------------------------------------------------------------
# Items are counted by their lines.

JUMPING = """QGC WPL 110
0 1 0 16 0 0 0 0 36.5 -84.2 300 1
3 0 3 16 0 0 0 0 36.51 -84.2 100 1
7 0 3 16 0 0 0 0 36.52 -84.2 100 1
9 0 2 177 2 1 0 0 0 0 0 1
40 0 3 16 0 0 0 0 36.53 -84.2 100 1
"""


def test_items_whose_seq_jumps_are_counted_as_pymavlink_counts_them(tmp_path: Path) -> None:
    file = tmp_path / "a.waypoints"
    file.write_text(JUMPING, encoding="utf-8")
    loader = MAVWPLoader()
    loader.load(str(file))
    theirs = [loader.wp(k) for k in range(1, loader.count())]
    mission = parse_mission(JUMPING, "a.waypoints")
    assert [(item.seq, item.command, item.lat_deg) for item in mission.items] == [
        (one.seq, one.command, pytest.approx(one.x)) for one in theirs
    ]
    # The jump goes to the second item, whatever number its line has.
    assert [stop.item for stop in make_itinerary(mission).stops] == [1, 2, 2, 4]
    (said,) = mission.warnings
    assert said == (
        "a.waypoints:3: the sequence numbers have a gap before 3 (4 gaps in all): items are numbered by line"
        " instead, as ground stations do, and jumps use these numbers"
    )


def test_items_whose_seq_does_not_rise_are_counted_as_pymavlink_counts_them(tmp_path: Path) -> None:
    """A ground station's own grids begin with two lines 1, and no home."""
    file, text = tmp_path / "a.waypoints", JUMPING.replace("\n7 ", "\n3 ").replace("\n40 ", "\n2 ")
    file.write_text(text, encoding="utf-8")
    loader = MAVWPLoader()
    loader.load(str(file))
    mission = parse_mission(text, "a.waypoints")
    assert [(item.seq, item.lat_deg) for item in mission.items] == [
        (loader.wp(k).seq, pytest.approx(loader.wp(k).x)) for k in range(1, loader.count())
    ]
    assert [stop.item for stop in make_itinerary(mission).stops] == [1, 2, 2, 4]
    assert [said for said in mission.warnings if "not above" in said] == [
        "a.waypoints:4: sequence number 3 is not above the previous line's number (2 such lines in all): items are"
        " numbered by line instead, as ground stations do, and jumps use these numbers"
    ]


@pytest.mark.parametrize("kind", ["waypoints", "plan"])
def test_a_home_at_0_0_is_left_out_and_said(kind: str) -> None:
    """It is counted as home all the same: the first item is number 1."""
    text = JUMPING.replace("36.5 -84.2 300", "0 0 0").replace("\n3 ", "\n1 ").replace("\n7 ", "\n2 ")
    text = text.replace("\n9 ", "\n3 ").replace("\n40 ", "\n4 ")
    mission = parse_mission(text, "a.waypoints")
    if kind == "plan":
        mission = parse_mission(mission_text(mission, "plan"), "a.plan")
    assert mission.home is None
    assert [item.seq for item in mission.items] == [1, 2, 3, 4]
    (said,) = mission.warnings
    assert "position: the mission has no home" in said


@pytest.mark.parametrize(
    ("line", "home", "said"),
    [
        ("0 22 15 0 0 0 36.5 -84.2 310", Home(36.5, -84.2, 310.0), []),
        (
            "3 22 15 0 0 0 36.5 -84.2 310",
            Home(36.5, -84.2, 310.0),
            [
                "home in frame 3: its height is read as an altitude above mean sea level."
                " Probably the file has no home line"
            ],
        ),
        ("3 22 15 0 0 0 0 0 100", None, ["home is at 0, 0, which stands for no position"]),
        ("2 178 0 22 0 0 0 0 0", None, ["home is at 0, 0, which stands for no position"]),
    ],
)
def test_whatever_stands_in_the_line_of_home_is_home_as_in_pymavlink(
    line: str, home: Home | None, said: list[str], tmp_path: Path
) -> None:
    text = f"QGC WPL 110\n0 1 {line} 1\n1 0 3 16 0 0 0 0 36.51 -84.2 100 1\n2 0 2 177 1 1 0 0 0 0 0 1\n"
    file = tmp_path / "a.waypoints"
    file.write_text(text, encoding="utf-8")
    loader = MAVWPLoader()
    loader.load(str(file))
    mission = parse_mission(text, "a.waypoints")
    # pymavlink's first is what ArduPilot takes for home.
    assert [(item.seq, item.command) for item in mission.items] == [
        (loader.wp(k).seq, loader.wp(k).command) for k in range(1, loader.count())
    ]
    assert mission.home == home
    name = "NAV_TAKEOFF" if " 22 15" in line else "DO_CHANGE_SPEED"
    assert mission.warnings[0] == (
        f"a.waypoints:2: {name} in the line of home (seq 0): ignored, because ground stations treat that line as home"
        " and do not fly it"
    )
    for found, wanted in zip(mission.warnings[1:], said, strict=True):
        assert wanted in found


def test_what_is_written_has_no_gap_and_jumps_to_the_same_item() -> None:
    places = [MissionItem(seq, 16, 3, (0.0,) * 4, 36.5 + seq / 100, -84.2, 100.0) for seq in (2, 5, 9)]
    jumps = [MissionItem(seq, 177, 2, (float(to), 1.0, 0.0, 0.0), 0.0, 0.0, 0.0) for seq, to in ((11, 5), (12, 7))]
    again = parse_mission(waypoints_text(Mission(None, (*places, *jumps))), "a.waypoints")
    assert [item.seq for item in again.items] == [1, 2, 3, 4, 5]
    # To the second, and to one that is not there.
    assert [item.params[0] for item in again.items[3:]] == [2.0, 7.0]
