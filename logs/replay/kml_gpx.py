"""Plan and track for maps: KML (OGC 12-007) and GPX 1.1.

GPX is made with gpxpy (Apache-2.0).  KML is written with the standard library: the Python packages that write it are
LGPL (simplekml, fastkml) or no longer kept up.
"""

import math
from dataclasses import dataclass
from xml.etree import ElementTree

import gpxpy.gpx
import numpy as np
from numpy.typing import NDArray

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from world.frames import to_geo

Floats = NDArray[np.float64]

KML = "http://www.opengis.net/kml/2.2"
# Seconds between points of a track in a map file.
EVERY = 0.5


@dataclass(frozen=True, slots=True)
class MapLine:
    """A line on the map.

    name: of the line.
    lat_deg, lon_deg: (n,).
    amsl: (n,) m above mean sea level.
    marks: a name for each point, or none.
    """

    name: str
    lat_deg: Floats
    lon_deg: Floats
    amsl: Floats
    marks: tuple[str, ...] = ()


def plan_line(setup: FlightSetup) -> MapLine:
    """Route of a setup, its waypoints named by number and mission item as in a verdict.

    >>> from logs.recording.example_log import example_log
    >>> line = plan_line(example_log().setup)
    >>> line.name, line.marks
    ('example plan', ('0 (item 1)', '1 (item 2)', '2 (item 3)'))
    """
    points, items = setup.route.waypoints, setup.route.items
    lat, lon = to_geo(setup.scenario.origin, points[:, 0], points[:, 1])
    marks = tuple(f"{k} (item {item})" if item >= 0 else str(k) for k, item in enumerate(items))
    return MapLine(f"{setup.scenario.name} plan", np.asarray(lat), np.asarray(lon), points[:, 2], marks)


def track_line(setup: FlightSetup, track: Track) -> MapLine:
    """Flown track, thinned to a point each `EVERY` seconds and the last, rows without a position left out.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> line = track_line(log.setup, log.track)
    >>> line.name, line.amsl.size, float(line.amsl[0])
    ('example flown', 74, 200.0)
    """
    good = np.flatnonzero(np.isfinite(track.position).all(axis=1) & np.isfinite(track.time))
    slots = np.floor(track.time[good] / EVERY + 1e-9)
    keep = np.concatenate([[True], np.diff(slots) > 0.0])[: good.size]
    keep[-1:] = True
    position = track.position[good[keep]]
    lat, lon = to_geo(setup.scenario.origin, position[:, 0], position[:, 1])
    return MapLine(f"{setup.scenario.name} flown", np.asarray(lat), np.asarray(lon), position[:, 2])


def kml_text(title: str, lines: list[MapLine]) -> str:
    """KML document: a folder for each line, heights absolute, and a placemark for each named point.

    >>> line = MapLine("leg", np.array([46.0, 46.01]), np.array([8.0, 8.0]), np.array([500.0, 520.0]))
    >>> text = kml_text("one leg", [line])
    >>> "<coordinates>8.00000000,46.00000000,500.000 8.00000000,46.01000000,520.000</coordinates>" in text
    True
    """
    ElementTree.register_namespace("", KML)
    root = ElementTree.Element(f"{{{KML}}}kml")
    document = _add(root, "Document")
    _add(document, "name", title)
    for line in lines:
        folder = _add(document, "Folder")
        _add(folder, "name", line.name)
        mark = _add(folder, "Placemark")
        _add(mark, "name", line.name)
        string = _add(mark, "LineString")
        _add(string, "altitudeMode", "absolute")
        _add(string, "coordinates", " ".join(_coordinates(line, k) for k in range(len(line.lat_deg))))
        for k, name in enumerate(line.marks):
            mark = _add(folder, "Placemark")
            _add(mark, "name", name)
            point = _add(mark, "Point")
            _add(point, "altitudeMode", "absolute")
            _add(point, "coordinates", _coordinates(line, k))
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _add(parent: ElementTree.Element, name: str, text: str = "") -> ElementTree.Element:
    element = ElementTree.SubElement(parent, f"{{{KML}}}{name}")
    element.text = "".join(ch for ch in text if ch.isprintable() or ch == " ") if text else None
    return element


def _coordinates(line: MapLine, k: int) -> str:
    return f"{line.lon_deg[k]:.8f},{line.lat_deg[k]:.8f},{line.amsl[k]:.3f}"


def gpx_text(title: str, lines: list[MapLine]) -> str:
    """GPX document: a line with named points is a route, any other a track.

    >>> line = MapLine("leg", np.array([46.0, 46.01]), np.array([8.0, 8.0]), np.array([500.0, 520.0]))
    >>> '<trkpt lat="46.01" lon="8.0">' in gpx_text("one leg", [line])
    True
    """
    gpx = gpxpy.gpx.GPX()
    gpx.creator = "planfly"
    gpx.name = "".join(ch for ch in title if ch.isprintable())
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
                gpxpy.gpx.GPXTrackSegment([gpxpy.gpx.GPXTrackPoint(a, b, elevation=c) for a, b, c in rows])
            )
            gpx.tracks.append(track)
    return str(gpx.to_xml(version="1.1")) + "\n"
