"""Plan and track as KML and GPX, read back by a parser of XML alone."""

import dataclasses
import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from logs import theme
from logs.views.exports.map_files import (
    MapLine,
    glide_shapes,
    gpx_text,
    kml_text,
    map_zones,
    plan_line,
    return_lines,
    track_line,
)
from tests.logs.made_flight import WAYPOINTS, make_setup, make_track
from tests.logs.verdict.returns.hill import hill_drawn, hill_setup

# The names of OGC 12-007 and of GPX 1.1, clause for clause theirs.
KML = "{http://www.opengis.net/kml/2.2}"
BOUNDARIES = ("outerBoundaryIs", "innerBoundaryIs")
GPX = "{http://www.topografix.com/GPX/1/1}"
LINE = MapLine("evil <name> & \x07", np.array([46.0, 46.01]), np.array([8.0, -8.5]), np.array([500.0, 520.25]))


def test_waypoints_stand_where_the_scenario_puts_them() -> None:
    setup = make_setup()
    line = plan_line(setup)
    origin = setup.scenario.origin
    # A degree of latitude is 111.2 km, of longitude that times the cosine of the latitude, within half a percent.
    north = (line.lat_deg - origin.lat_deg) * 111_200.0
    east = (line.lon_deg - origin.lon_deg) * 111_200.0 * math.cos(math.radians(origin.lat_deg))
    np.testing.assert_allclose(north, WAYPOINTS[:, 1], atol=8.0)
    np.testing.assert_allclose(east, WAYPOINTS[:, 0], atol=8.0)
    np.testing.assert_array_equal(line.amsl, WAYPOINTS[:, 2])
    assert line.marks == ("0", "1 (item 2)", "2 (item 3)", "3 (item 4)")


def test_a_track_has_a_point_each_half_second_and_its_last() -> None:
    setup, track = make_setup(), make_track(seconds=8.0)
    line = track_line(setup, track)
    # Rows at 0, 0.5 ... 7.5 s, and the last at 479/60 s.
    assert line.amsl.size == 17
    np.testing.assert_array_equal(line.amsl, track.position[[*range(0, 480, 30), 479], 2])
    holed = track.position.copy()
    holed[30:60] = math.nan
    assert np.isfinite(track_line(setup, dataclasses.replace(track, position=holed)).lat_deg).all()
    gone = dataclasses.replace(track, position=np.full_like(track.position, math.nan))
    assert track_line(setup, gone).amsl.size == 0


def test_kml_has_absolute_heights_and_longitude_first() -> None:
    root = ElementTree.fromstring(kml_text("a <title>", [LINE, plan_line(make_setup())]))
    assert root.tag == f"{KML}kml"
    assert root.findtext(f"{KML}Document/{KML}name") == "a <title>"
    folders = root.findall(f"{KML}Document/{KML}Folder")
    assert [folder.findtext(f"{KML}name") for folder in folders] == ["evil <name> & ", "synthetic plan"]
    string = folders[0].find(f"{KML}Placemark/{KML}LineString")
    assert string is not None
    assert string.findtext(f"{KML}altitudeMode") == "absolute"
    text = string.findtext(f"{KML}coordinates")
    assert text is not None
    points = [[float(value) for value in point.split(",")] for point in text.split()]
    assert points == [[8.0, 46.0, 500.0], [-8.5, 46.01, 520.25]]
    assert len(folders[0].findall(f".//{KML}Point")) == 0
    assert len(folders[1].findall(f".//{KML}Point")) == 4


def test_gpx_has_named_points_as_a_route_and_others_as_a_track() -> None:
    line = dataclasses.replace(LINE, name="evil <name> & x")
    lost = dataclasses.replace(line, amsl=np.array([500.0, math.nan]))
    root = ElementTree.fromstring(gpx_text("flight", [line, plan_line(make_setup()), lost]))
    assert (root.tag, root.get("version")) == (f"{GPX}gpx", "1.1")
    tracks, routes = root.findall(f"{GPX}trk"), root.findall(f"{GPX}rte")
    assert (len(tracks), len(routes)) == (2, 1)
    assert tracks[0].findtext(f"{GPX}name") == "evil <name> & x"
    points = tracks[0].findall(f".//{GPX}trkpt")
    assert [(float(point.get("lat", "")), float(point.get("lon", ""))) for point in points] == [
        (46.0, 8.0),
        (46.01, -8.5),
    ]
    assert [float(point.findtext(f"{GPX}ele", "")) for point in points] == pytest.approx([500.0, 520.25])
    # A point without a height is left out.
    assert len(tracks[1].findall(f".//{GPX}trkpt")) == 1
    named = [point.findtext(f"{GPX}name") for point in routes[0].findall(f"{GPX}rtept")]
    assert named == ["0", "1 (item 2)", "2 (item 3)", "3 (item 4)"]


# The scenario's, and the mission's own fence.
ZONES = ["a & b (keep out)", "fence (stay in)", "fence item 0 (keep out)"]


def zoned_setup() -> FlightSetup:
    outer, hole = [[-300, -300], [300, -300], [300, 300], [-300, 300]], [[-90, -90], [90, -90], [90, 90], [-90, 90]]
    zones = [
        {"name": "a & b", "kind": "exclusion", "rings_m": [hole, outer], "ceiling_agl_m": 120},
        {"name": "fence", "kind": "inclusion", "east_m": 0, "north_m": 0, "radius_m": 1400},
    ]
    return make_setup(zones=zones)


def test_zones_are_polygons_of_kml_with_their_holes_and_ceilings() -> None:
    setup = zoned_setup()
    root = ElementTree.fromstring(kml_text("zones", [], map_zones(setup)))
    marks = root.findall(f"{KML}Document/{KML}Folder/{KML}Placemark")
    assert [mark.findtext(f"{KML}name") for mark in marks] == ZONES
    polygon = marks[0].find(f"{KML}MultiGeometry/{KML}Polygon")
    assert polygon is not None
    assert polygon.findtext(f"{KML}altitudeMode") == "relativeToGround"
    rings = [polygon.findtext(f"{KML}{kind}/{KML}LinearRing/{KML}coordinates") for kind in BOUNDARIES]
    corners = [[tuple(map(float, point.split(","))) for point in (ring or "").split()] for ring in rings]
    assert [len(ring) for ring in corners] == [5, 5]
    assert all(ring[0] == ring[-1] and ring[0][2] == 120.0 for ring in corners)
    # 300 m and 90 m north of the origin.
    north = [(max(lat for _, lat, _ in ring) - setup.scenario.origin.lat_deg) * 111_200.0 for ring in corners]
    assert north == pytest.approx([300.0, 90.0], rel=0.01)
    open_top = marks[1].find(f"{KML}MultiGeometry/{KML}Polygon")
    assert open_top is not None
    assert open_top.findtext(f"{KML}altitudeMode") is None


def test_zones_are_tracks_of_gpx_a_segment_a_ring() -> None:
    root = ElementTree.fromstring(gpx_text("zones", [], map_zones(zoned_setup())))
    tracks = root.findall(f"{GPX}trk")
    assert [track.findtext(f"{GPX}name") for track in tracks] == ZONES
    assert [len(track.findall(f"{GPX}trkseg")) for track in tracks] == [2, 1, 1]


def test_returns_have_the_colours_of_what_they_come_to(tmp_path: Path) -> None:
    setup = hill_setup(tmp_path)
    drawn = hill_drawn(setup)
    lines, shapes = return_lines(setup, drawn, None), glide_shapes(setup, drawn)
    root = ElementTree.fromstring(kml_text("returns", lines, shapes))
    folders = {
        folder.findtext(f"{KML}name"): folder.findall(f"{KML}Placemark")
        for folder in root.findall(f"{KML}Document/{KML}Folder")
    }
    assert list(folders) == ["returns to launch", "the worst returns", "without its engine", "the glide's footprint"]
    way = folders["returns to launch"]
    assert len(way) == len(drawn.segments_by_outcome)
    for mark, (kind, ones) in zip(way, drawn.segments_by_outcome, strict=True):
        red, green, blue = (round(255.0 * part) for part in theme.rgb(theme.colour(f"return-{kind}", dark=True)))
        assert mark.findtext(f"{KML}Style/{KML}LineStyle/{KML}color") == f"ff{blue:02x}{green:02x}{red:02x}"
        begins = float((mark.findtext(f"{KML}name") or "").split(" to ")[0])
        # The coloured path begins half way from the start before.
        assert begins == pytest.approx(ones[0].time, abs=6.0)
        first = (mark.findtext(f"{KML}LineString/{KML}coordinates") or "").split()[0]
        lon, lat, up = (float(value) for value in first.split(","))
        assert (lon - 8.0) * 77_448.0 == pytest.approx(ones[0].start[0], abs=160.0)
        assert (lat, up) == pytest.approx((46.0, ones[0].start[2]), abs=1e-3)
    assert "hits the ground" in (folders["the worst returns"][0].findtext(f"{KML}name") or "")
    near = folders["the glide's footprint"][0]
    assert near.findtext(f"{KML}name") == "home or another chosen place in reach from 150 m above ground"
    opacity = round(255.0 * theme.ROLE_STYLES["glide-near"].fill)
    assert (near.findtext(f"{KML}Style/{KML}PolyStyle/{KML}color") or "").startswith(f"{opacity:02x}")
    # It lies about home, and no height is stated: on the ground.
    ring = near.findtext(f".//{KML}outerBoundaryIs/{KML}LinearRing/{KML}coordinates") or ""
    longitudes = [float(point.split(",")[0]) for point in ring.split()]
    assert min(longitudes) < 8.0 < max(longitudes)
    assert near.find(f".//{KML}extrude") is None
    # Where nothing is flat there is no shape of it.
    footprint = drawn.glides.footprint
    assert footprint is not None
    steep = dataclasses.replace(footprint, is_landable=np.zeros_like(footprint.is_landable))
    glides = dataclasses.replace(drawn.glides, footprint=steep)
    assert len(glide_shapes(setup, dataclasses.replace(drawn, glides=glides))) == len(shapes) - 1
