"""Zones of a KML file (OGC 07-147r2): placemarks with polygons, and with a point and a radius."""

import math
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

from world.airspace.zone_entries import zone_entries
from world.errors import ScenarioError

# The names of KML 2.0 to 2.2 stand in several namespaces, which nothing of ours needs to tell apart.
_Element = ElementTree.Element
# m.  Corners of one level differ by no more.
_LEVEL = 0.5
_NUMBERS = ("floor_amsl_m", "floor_agl_m", "ceiling_amsl_m", "ceiling_agl_m", "radius_m")


def kml_zones(text: str, source: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Where each zone stands in a file, and its entries as a [[zones]] table has them.

    An extruded polygon is a zone up to its height, as `altitudeMode` counts it; one that is clamped to the ground has
    no ceiling.  ExtendedData states kind, floors, ceilings and radii by the keys of a scenario file.  Raises
    ScenarioError for what is no KML, and for a placemark that is no zone.

    >>> ring = "<coordinates>8,46 8.01,46 8.01,46.01</coordinates>"
    >>> ring = f"<outerBoundaryIs><LinearRing>{ring}</LinearRing></outerBoundaryIs>"
    >>> text = f"<kml><Placemark><name>lake</name><Polygon>{ring}</Polygon></Placemark></kml>"
    >>> [(where, len(entries["rings_deg"][0])) for where, entries in kml_zones(text, "a file")]
    [('Placemark 1 (lake)', 3)]
    """
    # Entities may name other files, and grow a small file without end: KML has no use of them.
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ScenarioError(f"{source}: a document type is declared: not allowed in a file of zones", file=source)
    try:
        root = ElementTree.fromstring(text)  # what could grow was refused above
    except (ElementTree.ParseError, ValueError) as error:
        raise ScenarioError(f"{source}: not valid XML: {str(error).splitlines()[0]}", file=source) from error
    if _tag(root) != "kml":
        raise ScenarioError(f"{source}: a <kml> element is expected", file=source)
    for number, placemark in enumerate((element for element in root.iter() if _tag(element) == "Placemark"), 1):
        name = _text(placemark, "name") or f"zone {number}"
        label = f"Placemark {number}" + (f" ({name})" if name.isprintable() else "")
        yield label, {"name": name, **_zone(placemark, f"{source}: {label}")}


def _tag(element: _Element) -> str:
    return element.tag.rpartition("}")[2]


def _all(element: _Element, tag: str) -> list[_Element]:
    return [child for child in element.iter() if _tag(child) == tag]


def _text(element: _Element, tag: str) -> str:
    """Text of an element's own child of this name; "" for none."""
    return next(((child.text or "").strip() for child in element if _tag(child) == tag), "")


def _zone(placemark: _Element, source: str) -> dict[str, Any]:
    entries = zone_entries(_extended(placemark, source), source)
    polygons, points = _all(placemark, "Polygon"), _all(placemark, "Point")
    if not polygons:
        if len(points) != 1 or "radius_m" not in entries:
            raise ScenarioError(
                f"{source}: a Polygon is expected, or a Point with radius_m in its ExtendedData", file=source
            )
        ((lon, lat, _),) = _coordinates(points[0], source)[:1] or [(math.nan, math.nan, 0.0)]
        return entries | {"lat_deg": lat, "lon_deg": lon}
    rings, ceilings = [], set()
    for polygon in polygons:
        corners = []
        for boundary in (*_all(polygon, "outerBoundaryIs"), *_all(polygon, "innerBoundaryIs")):
            ring = _coordinates(boundary, source)
            rings.append([[lat, lon] for lon, lat, _ in ring])
            corners += ring
        ceilings.add(_ceiling(polygon, [up for _, _, up in corners], source))
    if len(ceilings) > 1:
        raise ScenarioError(
            f"{source}: its polygons have different heights: give each a placemark of its own", file=source
        )
    key, height = ceilings.pop()
    stated = any(side in entries for side in ("ceiling_amsl_m", "ceiling_agl_m"))
    return {"rings_deg": rings, **({key: height} if key and not stated else {}), **entries}


def _ceiling(polygon: _Element, ups: list[float], source: str) -> tuple[str, float]:
    """The key of a polygon's ceiling and its height, m; ("", 0) where it has none."""
    mode = _text(polygon, "altitudeMode") or "clampToGround"
    if mode == "clampToGround":
        return "", 0.0
    key = {"absolute": "ceiling_amsl_m", "relativeToGround": "ceiling_agl_m"}.get(mode)
    if key is None:
        allowed = "allowed clampToGround, relativeToGround, absolute"
        message = f"{source}: altitudeMode {mode[:40]!r}: {allowed}"
        raise ScenarioError(message, file=source, field="altitudeMode", value=mode, allowed=allowed)
    if _text(polygon, "extrude") not in ("1", "true"):
        message = f"{source}: altitudeMode {mode} without extrude: a sheet in the air holds no airspace"
        raise ScenarioError(message, file=source, field="altitudeMode", value=mode)
    if not ups or max(ups) - min(ups) > _LEVEL:
        raise ScenarioError(f"{source}: its corners have different heights: a zone has a level ceiling", file=source)
    return key, ups[0]


def _coordinates(element: _Element, source: str) -> list[tuple[float, float, float]]:
    """Longitude, latitude and height of an element's positions."""
    out = []
    for coordinates in _all(element, "coordinates"):
        for position in (coordinates.text or "").split():
            try:
                lon, lat, *rest = (float(part) for part in position.split(","))
            except ValueError as error:
                allowed = "lon,lat or lon,lat,up is expected"
                message = f"{source}: coordinates {position[:40]!r}: {allowed}"
                raise ScenarioError(
                    message, file=source, field="coordinates", value=position, allowed=allowed
                ) from error
            out.append((lon, lat, rest[0] if rest else 0.0))
    return out


def _extended(placemark: _Element, source: str) -> dict[str, Any]:
    """What a placemark's ExtendedData states: Data with a value, and SimpleData."""
    stated = {str(one.get("name")): _text(one, "value") for one in _all(placemark, "Data")}
    stated |= {str(one.get("name")): (one.text or "").strip() for one in _all(placemark, "SimpleData")}
    found: dict[str, Any] = {}
    for key, value in stated.items():
        if key in _NUMBERS:
            try:
                found[key] = float(value)
            except ValueError as error:
                shown = repr(value[:40])
                raise ScenarioError.at(source, key, value, "a number is expected", shown=shown) from error
        elif value:
            found[key] = value
    return found
