"""Export plan and track for maps: KML (OGC 12-007) and GPX 1.1.

GPX is written by gpxpy.  KML is written with the standard library, in 58 lines: simplekml 1.3.6 would save 30, but it
continues element numbers from one document to the next, writes coordinates of points before altitudeMode (against OGC
12-007), raises ExpatError for a control character in a name, and takes 4.5 times as long for 2,000 waypoints.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

import gpxpy.gpx
import numpy as np
from numpy.typing import ArrayLike

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.theme import ROLE_STYLES
from logs.verdict.measures.route_requirements import with_fence_zones
from logs.verdict.returns.drawn_returns import DrawnReturns
from logs.verdict.returns.glide_footprint import BAND_ROLES, Part
from logs.verdict.returns.glides_text import reached_text
from logs.verdict.returns.returns_text import outcome_text, segment_text
from logs.views.returns import split_path_by_outcome, split_path_by_reach
from world.airspace.zones_on_map import zone_parts
from world.arrays import Floats
from world.frames import to_geo

KML = "http://www.opengis.net/kml/2.2"
# Interval between points of a track in a map file, s.
POINT_INTERVAL_S = 0.5


@dataclass(frozen=True, slots=True)
class MapLine:
    """A line on the map.

    name: name of the line.
    lat_deg, lon_deg: (n,) degrees.
    amsl: (n,) m above mean sea level.
    marks: a name for each point, or empty.
    folder: KML folder shared with other lines; "" for its own folder.
    role: role in `logs.theme` that gives its style; "" for the viewer's default style.
    """

    name: str
    lat_deg: Floats
    lon_deg: Floats
    amsl: Floats
    marks: tuple[str, ...] = ()
    folder: str = ""
    role: str = ""


def plan_line(setup: FlightSetup) -> MapLine:
    """Return the route of a setup, with waypoints named by number and mission item as in a verdict.

    >>> from logs.recording.example_log import example_log
    >>> line = plan_line(example_log().setup)
    >>> line.name, line.marks
    ('example plan', ('0 (item 1)', '1 (item 2)', '2 (item 3)'))
    """
    points, items = setup.display_waypoints, setup.route.items
    lat, lon = to_geo(setup.scenario.origin, points[:, 0], points[:, 1])
    marks = tuple(f"{k} (item {item})" if item >= 0 else str(k) for k, item in enumerate(items))
    return MapLine(f"{setup.scenario.name} plan", np.asarray(lat), np.asarray(lon), points[:, 2], marks)


def track_line(setup: FlightSetup, track: Track) -> MapLine:
    """Return the flown track as a line, with a point every `POINT_INTERVAL_S` seconds and at the end.

    Rows without a position are omitted.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> line = track_line(log.setup, log.track)
    >>> line.name, line.amsl.size, float(line.amsl[0])
    ('example flown', 74, 200.0)
    """
    finite_rows = np.flatnonzero(np.isfinite(track.position).all(axis=1) & np.isfinite(track.time))
    intervals = np.floor(track.time[finite_rows] / POINT_INTERVAL_S + 1e-9)
    is_kept = np.concatenate([[True], np.diff(intervals) > 0.0])[: finite_rows.size]
    is_kept[-1:] = True
    position = track.position[finite_rows[is_kept]]
    lat, lon = to_geo(setup.scenario.origin, position[:, 0], position[:, 1])
    return MapLine(f"{setup.scenario.name} flown", np.asarray(lat), np.asarray(lon), position[:, 2])


@dataclass(frozen=True, slots=True)
class MapZone:
    """A zone on the map.

    name: name and kind of the zone.
    parts: closed outline of each part, then its holes: (k, 2) latitude and longitude, degrees.
    height: height of its ceiling, m; None without a ceiling.
    above_ground: True if that height is above ground, not above mean sea level.
    folder, role: as in `MapLine`.
    """

    name: str
    parts: tuple[tuple[Floats, ...], ...]
    height: float | None = None
    above_ground: bool = False
    folder: str = "zones"
    role: str = ""


def map_zones(setup: FlightSetup) -> list[MapZone]:
    """Return the zones of a setup's scenario, and the zones of its mission's fence.

    >>> from logs.recording.example_log import example_log
    >>> map_zones(example_log().setup)
    []
    """
    zones = []
    for zone in with_fence_zones(setup).scenario.zones:
        parts = tuple(tuple(_to_geographic(setup, ring) for ring in part) for part in zone_parts(zone))
        top = zone.ceiling
        name = f"{zone.name} ({'keep out' if zone.kind == 'exclusion' else 'stay in'})"
        height = None if top is None else top.height
        zones.append(MapZone(name, parts, height, top is not None and top.datum == "ground"))
    return zones


# Returns and glides, in colours.


def return_lines(setup: FlightSetup, drawn_returns: DrawnReturns, track: Track | None) -> list[MapLine]:
    """Return lines of a flight's returns and glides.

    They are the path coloured by the outcome of a return from each point, the paths of the worst returns, and the path
    coloured by the destination that a glide reaches.

    track: the flown track; None for returns from the planned path.
    """
    limit, lines = drawn_returns.returns.limit, []
    for kind, segment in split_path_by_outcome(setup, drawn_returns, track):
        name = f"{segment[0].time:.0f} to {segment[-1].time:.0f} s: {segment_text(kind)}"
        positions = [point.position for point in segment]
        lines.append(_make_line(setup, name, positions, "returns to launch", f"return-{kind}"))
    for number, worst in enumerate(drawn_returns.worst, 1):
        ret = worst.simulated
        name = f"{number}: from {ret.time:.0f} s to {ret.target.name}: {outcome_text(ret, limit)}"
        lines.append(_make_line(setup, name, worst.path, "the worst returns", "return-way"))
    for reach, glide_segment in split_path_by_reach(setup, drawn_returns, track):
        name = f"{glide_segment[0].time:.0f} to {glide_segment[-1].time:.0f} s: {reached_text(reach)}"
        positions = [point.position for point in glide_segment]
        lines.append(_make_line(setup, name, positions, "without its engine", f"reach-{reach}"))
    return lines


def _make_line(setup: FlightSetup, name: str, positions: ArrayLike, folder: str, role: str) -> MapLine:
    """Make a line on the map from positions, m, (n, 3).

    role: role of the data, which decides colour and width.
    """
    points = np.asarray(positions, dtype=np.float64)
    lat, lon = to_geo(setup.scenario.origin, points[:, 0], points[:, 1])
    return MapLine(name, np.asarray(lat), np.asarray(lon), points[:, 2], folder=folder, role=role)


def glide_shapes(setup: FlightSetup, drawn_returns: DrawnReturns) -> list[MapZone]:
    """Return the areas of the glide footprint; [] if none was computed.

    There is an area for each height above ground from which a chosen place can be reached, and one of flat ground.
    """
    footprint = drawn_returns.glides.footprint
    if footprint is None:
        return []

    def make_shape(name: str, role: str, parts: tuple[Part, ...]) -> MapZone:
        """Make an area on the map from outlines in m."""
        geographic_parts = tuple(tuple(_to_geographic(setup, ring) for ring in part) for part in parts)
        return MapZone(name, geographic_parts, folder="the glide's footprint", role=role)

    shapes = [
        make_shape(f"home or another chosen place in reach from {band.max_height:.0f} m above ground", role, band.parts)
        for band in footprint.bands()
        for role in [BAND_ROLES[band.max_height]]
    ]
    flat_parts = footprint.landings()
    return [
        *shapes,
        *([make_shape("flat ground according to the elevation file", "landable", flat_parts)] if flat_parts else []),
    ]


def _to_geographic(setup: FlightSetup, ring: Floats) -> Floats:
    """Convert an outline (n, 2) in m to latitude and longitude, deg, (n, 2)."""
    return np.stack(to_geo(setup.scenario.origin, ring[:, 0], ring[:, 1]), axis=-1)


def kml_text(title: str, lines: list[MapLine], zones: Sequence[MapZone] = ()) -> str:
    """Return a KML document with a folder for each line, and a placemark for each named point and zone.

    A zone is an outline on the ground, or a body up to its ceiling.

    >>> line = MapLine("leg", np.array([46.0, 46.01]), np.array([8.0, 8.0]), np.array([500.0, 520.0]))
    >>> text = kml_text("one leg", [line])
    >>> "<coordinates>8.00000000,46.00000000,500.000 8.00000000,46.01000000,520.000</coordinates>" in text
    True
    """
    ElementTree.register_namespace("", KML)
    root = ElementTree.Element(f"{{{KML}}}kml")
    document = _add_element(root, "Document")
    _add_element(document, "name", title)
    folders = _Folders(document)
    for line in lines:
        folder = folders.shared_folder(line.folder) if line.folder else folders.add_folder(line.name)
        mark = _add_element(folder, "Placemark")
        _add_element(mark, "name", line.name)
        _add_style(mark, line.role)
        string = _add_element(mark, "LineString")
        _add_element(string, "altitudeMode", "absolute")
        _add_element(string, "coordinates", " ".join(_format_coordinates(line, k) for k in range(len(line.lat_deg))))
        for k, name in enumerate(line.marks):
            mark = _add_element(folder, "Placemark")
            _add_element(mark, "name", name)
            point = _add_element(mark, "Point")
            _add_element(point, "altitudeMode", "absolute")
            _add_element(point, "coordinates", _format_coordinates(line, k))
    for zone in zones:
        mark = _add_element(folders.shared_folder(zone.folder), "Placemark")
        _add_element(mark, "name", zone.name)
        _add_style(mark, zone.role)
        geometry = _add_element(mark, "MultiGeometry")
        for outline, *holes in zone.parts:
            polygon = _add_element(geometry, "Polygon")
            if zone.height is not None:
                _add_element(polygon, "extrude", "1")
                _add_element(polygon, "altitudeMode", "relativeToGround" if zone.above_ground else "absolute")
            _add_ring(polygon, "outerBoundaryIs", outline, zone)
            for hole in holes:
                _add_ring(polygon, "innerBoundaryIs", hole, zone)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


class _Folders:
    """Folders of a KML document."""

    def __init__(self, document: ElementTree.Element) -> None:
        """Take the KML element to which folders are added."""
        self._document = document
        self._folder_by_name: dict[str, ElementTree.Element] = {}

    def add_folder(self, name: str) -> ElementTree.Element:
        """Add a folder with a name to the document, and return the folder."""
        folder = _add_element(self._document, "Folder")
        _add_element(folder, "name", name)
        return folder

    def shared_folder(self, name: str) -> ElementTree.Element:
        """Return the folder that all lines and zones with this folder name share."""
        if name not in self._folder_by_name:
            self._folder_by_name[name] = self.add_folder(name)
        return self._folder_by_name[name]


def _add_style(mark: ElementTree.Element, role: str) -> None:
    """Add the colour and the width of a role, for the dark background of aerial pictures.

    Nothing is added if `role` is "".
    """
    if not role:
        return
    role_style, style = ROLE_STYLES[role], _add_element(mark, "Style")
    # KML colours are opacity, blue, green, red.
    colour = "".join(role_style.dark[k : k + 2] for k in (5, 3, 1))
    line = _add_element(style, "LineStyle")
    _add_element(line, "color", f"ff{colour}")
    _add_element(line, "width", f"{max(1.0, role_style.width):g}")
    _add_element(_add_element(style, "PolyStyle"), "color", f"{round(255.0 * role_style.fill):02x}{colour}")


def _add_ring(polygon: ElementTree.Element, kind: str, ring: Floats, zone: MapZone) -> None:
    """Add one closed outline to a polygon, at the height of the zone's ceiling.

    kind: name of the outline's element, "outerBoundaryIs" or "innerBoundaryIs".
    ring: latitude and longitude of its corners, deg, (k, 2).
    """
    line = _add_element(_add_element(polygon, kind), "LinearRing")
    up = 0.0 if zone.height is None else zone.height
    _add_element(line, "coordinates", " ".join(f"{lon:.8f},{lat:.8f},{up:.3f}" for lat, lon in ring))


def _add_element(parent: ElementTree.Element, name: str, text: str = "") -> ElementTree.Element:
    """Add an element to a KML element, with the printable characters of a text."""
    element = ElementTree.SubElement(parent, f"{{{KML}}}{name}")
    element.text = (
        "".join(character for character in text if character.isprintable() or character == " ") if text else None
    )
    return element


def _format_coordinates(line: MapLine, index: int) -> str:
    """Return longitude, latitude and altitude of a point in the syntax of KML."""
    return f"{line.lon_deg[index]:.8f},{line.lat_deg[index]:.8f},{line.amsl[index]:.3f}"


def gpx_text(title: str, lines: list[MapLine], zones: Sequence[MapZone] = ()) -> str:
    """Return a GPX document with lines and zones.

    Lines with named points are routes; other lines and the outlines of zones are tracks.

    >>> line = MapLine("leg", np.array([46.0, 46.01]), np.array([8.0, 8.0]), np.array([500.0, 520.0]))
    >>> '<trkpt lat="46.01" lon="8.0">' in gpx_text("one leg", [line])
    True
    """
    gpx = gpxpy.gpx.GPX()
    gpx.creator = "planfly"
    gpx.name = "".join(character for character in title if character.isprintable())
    for line in lines:
        rows = [
            (round(float(lat), 8), round(float(lon), 8), round(float(up), 3))
            for lat, lon, up in zip(line.lat_deg, line.lon_deg, line.amsl, strict=True)
            if math.isfinite(lat + lon + up)
        ]
        if line.marks:
            route = gpxpy.gpx.GPXRoute(name=line.name)
            route.points = [
                gpxpy.gpx.GPXRoutePoint(lat, lon, elevation=up, name=name)
                for (lat, lon, up), name in zip(rows, line.marks, strict=True)
            ]
            gpx.routes.append(route)
        else:
            track = gpxpy.gpx.GPXTrack(name=line.name)
            track.segments.append(
                gpxpy.gpx.GPXTrackSegment([gpxpy.gpx.GPXTrackPoint(lat, lon, elevation=up) for lat, lon, up in rows])
            )
            gpx.tracks.append(track)
    for zone in zones:
        track = gpxpy.gpx.GPXTrack(name="".join(character for character in zone.name if character.isprintable()))
        for ring in itertools.chain.from_iterable(zone.parts):
            points = [gpxpy.gpx.GPXTrackPoint(round(float(lat), 8), round(float(lon), 8)) for lat, lon in ring]
            track.segments.append(gpxpy.gpx.GPXTrackSegment(points))
        gpx.tracks.append(track)
    return str(gpx.to_xml(version="1.1")) + "\n"
