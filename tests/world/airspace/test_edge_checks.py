"""Outlines that would take gigabytes or minutes to check or repair are refused in a line, in every format."""

import json
import math
from pathlib import Path

import pytest

from flight.mission.fences import fence_item, fence_zones
from flight.mission.items import Command
from world.airspace import edge_checks, zone_files, zones_on_map
from world.airspace.edge_checks import MAX_CROSSINGS, check_edges, count_crossings
from world.airspace.openair import openair_zones
from world.airspace.zones import make_polygon
from world.airspace.zones_on_map import make_zones, ring_on_map
from world.errors import MissionError, ScenarioError
from world.frames import GeoOrigin

# A ring of (latitude, longitude).
Ring = list[tuple[float, float]]
ORIGIN = GeoOrigin(46.0, 8.0)
OPENAIR = "AC R\nAN X\nAL SFC\nAH FL100\nV X=46:00:00 N 008:00:00 E\n"


def star(corners: int, step: int) -> Ring:
    """Return the regular star polygon {corners/step}, whose edges cross corners * (step - 1) times."""
    angles = [2.0 * math.pi * k * step / corners for k in range(corners)]
    return [(46.0 + 0.02 * math.sin(angle), 8.0 + 0.02 * math.cos(angle)) for angle in angles]


def diagonals(count: int) -> Ring:
    """Return an outline of parallel diagonals that do not cross, but whose bounding boxes overlap."""
    ring: Ring = []
    for k in range(count // 2):
        off = 1e-5 * k
        pair = [(46.0 + off, 8.0 - off), (46.05 + off, 8.05 - off)]
        ring += pair if k % 2 == 0 else pair[::-1]
    return [*ring, (45.99, 7.9)]


def geojson(ring: Ring) -> str:
    corners = [[lon, lat] for lat, lon in [*ring, ring[0]]]
    return json.dumps({"type": "Polygon", "coordinates": [corners]})


def ed269(ring: Ring) -> str:
    volume = {"uomDimensions": "M", "horizontalProjection": json.loads(geojson(ring))}
    feature = {"name": "x", "restriction": "PROHIBITED", "geometry": [volume]}
    return json.dumps({"title": "t", "features": [feature]})


def ed318(ring: Ring) -> str:
    properties = {"name": [{"text": "x"}], "type": "PROHIBITED", "variant": "COMMON"}
    return json.dumps({"type": "Feature", "properties": properties, "geometry": json.loads(geojson(ring))})


def kml(ring: Ring) -> str:
    corners = " ".join(f"{lon},{lat}" for lat, lon in ring)
    outline = f"<outerBoundaryIs><LinearRing><coordinates>{corners}</coordinates></LinearRing></outerBoundaryIs>"
    return f"<kml><Placemark><name>x</name><Polygon>{outline}</Polygon></Placemark></kml>"


def openair(ring: Ring) -> str:
    return OPENAIR + "".join(f"DP {lat:.7f} N {lon:.7f} E\n" for lat, lon in ring)


# Formats of authorities' files, whose outlines are repaired.
REPAIRED = {"ed269.json": ed269, "ed318.json": ed318, "x.openair": openair}
FORMATS = {"x.geojson": geojson, "x.kml": kml, **REPAIRED}


def read(path: Path, text: str) -> None:
    """Read a file of zones, and place them on a map."""
    path.write_text(text, encoding="ascii")
    make_zones(zone_files.read_zone_file(path, path.name).zones, path.name, ORIGIN, None)


def test_crossings_of_stars() -> None:
    for corners, step in ((5, 2), (7, 3), (41, 20)):
        assert count_crossings([star(corners, step)], 10_000) == corners * (step - 1)


def test_edges_that_meet_at_their_shared_corner_do_not_cross(monkeypatch: pytest.MonkeyPatch) -> None:
    square = [(0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 9.0)]
    monkeypatch.setattr(edge_checks, "MAX_EDGE_PAIRS", 1)  # an edge at a time
    assert count_crossings([square], 9) == 0
    assert count_crossings([square, [(at[0] + 4.0, at[1] + 4.0) for at in square]], 9) == 2
    # An open line has no edge from its last corner to its first, which crosses the second edge of this one.
    line = [(0.0, 0.0), (9.0, 0.0), (0.0, 9.0), (9.0, 9.0)]
    assert [count_crossings([line], 9, closed=closed) for closed in (True, False)] == [1, 0]


@pytest.mark.parametrize("name", REPAIRED)
def test_an_outline_of_too_many_crossings_is_not_repaired(name: str, tmp_path: Path) -> None:
    assert MAX_CROSSINGS < 601 * 299
    with pytest.raises(ScenarioError, match=r": more crossings than can be repaired: at most 50,000 in a file$"):
        read(tmp_path / name, REPAIRED[name](star(601, 300)))


@pytest.mark.parametrize("name", FORMATS)
def test_an_outline_of_too_many_near_edges_is_not_checked(name: str, tmp_path: Path) -> None:
    with pytest.raises(
        ScenarioError,
        match=r"too many edges at the same place: at most 2,000,000 pairs of neighbouring edges are allowed$",
    ):
        read(tmp_path / name, FORMATS[name](diagonals(3000)))


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_has_a_limited_number_of_corners(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    corners = 4 if name.endswith("json") else 3  # in JSON a ring ends with its first corner
    monkeypatch.setattr(zone_files, "MAX_FILE_CORNERS", corners)
    read(tmp_path / name, FORMATS[name](star(3, 1)))
    monkeypatch.setattr(zone_files, "MAX_FILE_CORNERS", corners - 1)
    with pytest.raises(ScenarioError, match=f"too many corners: at most {corners - 1} are allowed in one file$"):
        read(tmp_path / name, FORMATS[name](star(3, 1)))


def test_crossings_of_all_zones_of_a_file_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = json.loads(ed269(star(7, 3)))["features"][0]  # 14 crossings
    monkeypatch.setattr(zone_files, "MAX_CROSSINGS", 30)
    read(tmp_path / "two.json", json.dumps({"title": "t", "features": [one] * 2}))
    with pytest.raises(ScenarioError, match=r"features\[2\] \(x\): more crossings than can be repaired"):
        read(tmp_path / "three.json", json.dumps({"title": "t", "features": [one] * 3}))


LINES = {
    "one full turn after another": ("DA 1,0,359\n" * 600, "too many edges at the same place"),
    "more corners than a zone has": ("DA 500,0,359\n" * 60, "more corners than a zone may have: at most 100,000"),
    "a radius beyond the Earth": ("DA 9e300,0,359\n", "allowed 0..10800 nautical miles"),
    "a circle beyond the Earth": ("DC 9e300\n", "allowed 0..10800 nautical miles"),
    "an airway beyond the Earth": ("V W=1e300\n", "allowed 0..10800 nautical miles"),
    "an airway that crosses itself": (
        "V W=0.001\n" + openair(star(601, 300)).removeprefix(OPENAIR).replace("DP", "DY"),
        "crosses itself more than 50,000 times",
    ),
}


@pytest.mark.parametrize(("lines", "message"), LINES.values(), ids=LINES)
def test_a_short_openair_file_of_many_corners(lines: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=message) as caught:
        read(tmp_path / "x.openair", OPENAIR + lines)
    assert len(str(caught.value).splitlines()) == 1


def test_an_openair_block_is_refused_at_the_line_that_is_too_much() -> None:
    found = openair_zones(OPENAIR + "DA 500,0,359\n" * 100_000, "a file")
    # Chords within 1 m of an arc of 359 degrees, and its last corner.
    corners = math.ceil(math.radians(359.0) / (2.0 * math.acos(1.0 - 1.0 / (500.0 * 1852.0)))) + 1
    with pytest.raises(ScenarioError, match=f"line {5 + 100_000 // corners + 1}: DA"):
        next(found)


def test_edges_around_the_earth_make_no_millions_of_corners(monkeypatch: pytest.MonkeyPatch) -> None:
    ring = [(46.0 + k / 1000.0, 8.0 + 170.0 * (k % 2)) for k in range(101)]
    with pytest.raises(ValueError, match=r"edges too long: 2[0-9]{2},[0-9]{3} corners on the map; at most 100,000"):
        ring_on_map(ORIGIN, ring)
    assert len(ring_on_map(ORIGIN, ring[:9])) > 8 * 1000
    monkeypatch.setattr(zones_on_map, "MAX_MAP_CORNERS", 7)
    corners = ((0.0, 0.0), (900.0, 0.0), (900.0, 900.0))
    command = Command.NAV_FENCE_POLYGON_VERTEX_EXCLUSION
    fences = tuple(fence_item(ORIGIN, command, 3.0, corner) for corner in corners)
    assert len(fence_zones(fences * 2, ORIGIN)) == 2
    with pytest.raises(MissionError, match="corners; at most 7 are allowed"):
        fence_zones(fences * 3, ORIGIN)


def test_a_zone_has_a_limited_number_of_corners_in_all_rings(monkeypatch: pytest.MonkeyPatch) -> None:
    squares = [[(9.0 * k, 0.0), (9.0 * k + 5.0, 0.0), (9.0 * k + 5.0, 5.0), (9.0 * k, 5.0)] for k in range(3)]
    monkeypatch.setattr(edge_checks, "MAX_CORNERS", 8)
    assert len(make_polygon(squares[:2]).rings) == 2
    with pytest.raises(ValueError, match=r"^12 corners: at most 8 are allowed in one zone$"):
        make_polygon(squares)


def test_a_coast_of_100_000_corners_is_checked() -> None:
    """A rough outline with an edge in every direction, each next to the last."""
    coast = [
        (
            (1.0 + 1e-5 * (k % 7)) * math.cos(k / 50_000.0 * math.pi),
            (1.0 + 1e-5 * (k % 5)) * math.sin(k / 50_000.0 * math.pi),
        )
        for k in range(100_000)
    ]
    check_edges([coast])
