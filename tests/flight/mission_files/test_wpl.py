"""Malformed .waypoints files: each is refused in one line that names the line, the field and what is allowed."""

from pathlib import Path

import pytest
from pymavlink.mavwp import MAVFenceLoader

from flight.mission_files.formats import read_fence
from flight.mission_files.wpl import is_point_list, parse_fence_points
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
    items = read_fence(tmp_path / "saved.fence")
    assert [(item.lat_deg, item.lon_deg) for item in items] == CORNERS
    assert {(item.command, item.params[0]) for item in items} == {(5001, 4.0)}


def test_a_ring_without_a_return_point_is_taken_whole() -> None:
    items = parse_fence_points("#saved by hand\r\n\r\n" + text_of([*CORNERS, CORNERS[0]]), "a.fence")
    assert [(item.lat_deg, item.lon_deg) for item in items] == CORNERS


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (text_of([RETURN, *CORNERS]), "a.fence: 5 points: a return point and a ring"),
        (text_of([RETURN, *CORNERS[:2], CORNERS[0]]), "a.fence: 4 points"),
        (text_of([*CORNERS[:2], CORNERS[0]]), "a.fence: 3 points"),
        ("36.5 -84.2\n36.5\n", "a.fence:2: '36.5': a latitude and a longitude"),
        ("36.5 -84.2\n36.5 west\n", "a.fence:2: '36.5 west'"),
        ("36.5 -84.2\n96.5 -84.2\n", "a.fence:2: latitude"),
        ("36.5 -84.2\nnan -84.2\n", "a.fence:2: 'nan -84.2': a latitude"),
        (text_of([RETURN, *CORNERS * 64, CORNERS[0]]), "a.fence: 258 points: at most 255"),
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
