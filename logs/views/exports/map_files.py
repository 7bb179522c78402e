"""Export plan, track, zones and simulated returns to launch for maps: KML (OGC 12-007) and GPX 1.1.

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
    """A line in a map file.

    name: name of the line.
    lat_deg, lon_deg: latitude and longitude of each point, degrees, (n,).
    amsl: altitude of each point, m above mean sea level, (n,).
    marks: a name for each point, or empty.
    folder: name of the KML folder that the line shares with others; "" for a folder of its own.
    role: role in `logs.theme` that gives the line's style; "" for the viewer's default style.
    """

    name: str
    lat_deg: Floats
    lon_deg: Floats
    amsl: Floats
    marks: tuple[str, ...] = ()
    folder: str = ""
    role: str = ""


def plan_line(setup: FlightSetup) -> MapLine:
    """Return the planned route as a line whose points are named by waypoint and mission item.

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
    """Return the flown track as a line, with a point in every interval `POINT_INTERVAL_S` and at the end.

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
    """A zone or another area in a map file.

    name: name of the zone, with its kind.
    parts: rings of each part: its outline, then its holes.  A ring is closed: latitude and longitude, degrees, (k, 2).
    height: height of the zone's ceiling, m; None without a ceiling.
    above_ground: True if `height` is above ground, False if it is above mean sea level.
    folder: name of the KML folder that the zone shares with others.
    role: role in `logs.theme` that gives the zone's style; "" for the viewer's default style.
    """

    name: str
    parts: tuple[tuple[Floats, ...], ...]
    height: float | None = None
    above_ground: bool = False
    folder: str = "zones"
    role: str = ""


def map_zones(setup: FlightSetup) -> list[MapZone]:
    """Return the zones of the scenario and of the mission's fence, for a map file.

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


# Simulated returns to launch and glides, in colours.


def return_lines(setup: FlightSetup, drawn_returns: DrawnReturns, track: Track | None) -> list[MapLine]:
    """Return map lines of a flight's simulated returns to launch and its glides.

    They are: the flight path, in segments coloured by the outcome of a return from there; the paths of the worst
    returns; the flight path, in segments coloured by the destination that a glide from there reaches.

    track: flown track; None if the returns start on the planned path.
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
    """Make a map line without named points from positions, m, (n, 3).

    role: role in `logs.theme` that gives colour and width.
    """
    points = np.asarray(positions, dtype=np.float64)
    lat, lon = to_geo(setup.scenario.origin, points[:, 0], points[:, 1])
    return MapLine(name, np.asarray(lat), np.asarray(lon), points[:, 2], folder=folder, role=role)


def glide_shapes(setup: FlightSetup, drawn_returns: DrawnReturns) -> list[MapZone]:
    """Return the areas of the glide footprint for a map file; [] if no footprint was computed.

    There is an area for each band of heights above ground: from there, a glide reaches home or another chosen place.
    Another area is the flat ground on which a glide can end.
    """
    footprint = drawn_returns.glides.footprint
    if footprint is None:
        return []

    def make_shape(name: str, role: str, parts: tuple[Part, ...]) -> MapZone:
        """Make an area for a map file from parts, whose outlines are in m east and north of the origin."""
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
    """Convert an outline from east and north, m, (n, 2), to latitude and longitude, degrees, (n, 2)."""
    return np.stack(to_geo(setup.scenario.origin, ring[:, 0], ring[:, 1]), axis=-1)


def kml_text(title: str, lines: list[MapLine], zones: Sequence[MapZone] = ()) -> str:
    """Return a KML document with a placemark for each line, each named point and each zone.

    Placemarks are in the folder of their line or zone; a line without a folder gets its own.  A zone with a ceiling is
    a body from the ground to the ceiling, otherwise an outline on the ground.

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
    """The folders of a KML document, added to it as they are needed."""

    def __init__(self, document: ElementTree.Element) -> None:
        """Add the folders to `document`, the KML element Document."""
        self._document = document
        self._folder_by_name: dict[str, ElementTree.Element] = {}

    def add_folder(self, name: str) -> ElementTree.Element:
        """Add a new folder with this name to the document, and return its element."""
        folder = _add_element(self._document, "Folder")
        _add_element(folder, "name", name)
        return folder

    def shared_folder(self, name: str) -> ElementTree.Element:
        """Return the element of the one shared folder with this name; it is added at the first call."""
        if name not in self._folder_by_name:
            self._folder_by_name[name] = self.add_folder(name)
        return self._folder_by_name[name]


def _add_style(mark: ElementTree.Element, role: str) -> None:
    """Add the colour and the line width of a role to a placemark; nothing if `role` is "".

    The colour is the one for dark backgrounds, because maps show aerial pictures.
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
    """Add one closed ring to a polygon, at the height of the zone's ceiling, or at 0 without a ceiling.

    kind: name of the ring's KML element, "outerBoundaryIs" or "innerBoundaryIs".
    ring: latitude and longitude of its corners, degrees, (k, 2).
    """
    line = _add_element(_add_element(polygon, kind), "LinearRing")
    up = 0.0 if zone.height is None else zone.height
    _add_element(line, "coordinates", " ".join(f"{lon:.8f},{lat:.8f},{up:.3f}" for lat, lon in ring))


def _add_element(parent: ElementTree.Element, name: str, text: str = "") -> ElementTree.Element:
    """Add a child element to a KML element, and return it; unprintable characters of its text are removed."""
    element = ElementTree.SubElement(parent, f"{{{KML}}}{name}")
    element.text = (
        "".join(character for character in text if character.isprintable() or character == " ") if text else None
    )
    return element


def _format_coordinates(line: MapLine, index: int) -> str:
    """Return a point of a line in KML syntax: longitude, latitude and altitude, separated by commas."""
    return f"{line.lon_deg[index]:.8f},{line.lat_deg[index]:.8f},{line.amsl[index]:.3f}"


def gpx_text(title: str, lines: list[MapLine], zones: Sequence[MapZone] = ()) -> str:
    """Return a GPX document with lines and zones.

    Lines with named points become routes; other lines, and the outlines of zones, become tracks.  Points that are not
    finite are omitted.

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
