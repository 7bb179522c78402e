"""Zones of a GeoJSON file (RFC 7946): polygons, multipolygons with their holes, and points with a radius."""

import json
from collections.abc import Iterator
from typing import Any

from world.airspace.zone_entries import zone_entries
from world.airspace.zones import holes_lie_inside
from world.errors import ScenarioError

# Names of the CRS that the older GeoJSON of 2008 may state and that means longitude and latitude on WGS84.
_DEGREES = ("CRS84", "4326")


def geojson_zones(text: str, source: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Where each zone stands in a file, and its entries as a [[zones]] table has them.

    A multipolygon is one zone of several parts.  Raises ScenarioError for what is no GeoJSON, and for a geometry that
    is no zone.

    >>> square = '{"type": "Polygon", "coordinates": [[[8, 46], [8.01, 46], [8.01, 46.01], [8, 46]]]}'
    >>> [(where, entries["name"], len(entries["rings_deg"][0])) for where, entries in geojson_zones(square, "a file")]
    [('geometry (zone 1)', 'zone 1', 4)]
    """
    try:
        data = json.loads(text, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise ScenarioError(f"{source}: not valid JSON: {str(error).splitlines()[0]}", file=source) from error
    if not isinstance(data, dict):
        raise ScenarioError(f"{source}: a GeoJSON object is expected, got {type(data).__name__}", file=source)
    _check_crs(data, source)
    kind = data.get("type")
    if kind == "FeatureCollection":
        features = data.get("features")
        if not isinstance(features, list):
            raise ScenarioError(f"{source}: features: a list is expected", file=source, field="features")
        for k, feature in enumerate(features):
            yield _zone(feature, f"features[{k}]", k, source)
    elif kind == "Feature":
        yield _zone(data, "feature", 0, source)
    else:
        yield _zone({"type": "Feature", "geometry": data}, "geometry", 0, source)


def _no_number(name: str) -> float:
    raise ValueError(f"{name} is no number of JSON")


def _check_crs(data: dict[str, Any], source: str) -> None:
    """Raise ScenarioError for coordinates of another kind than longitude and latitude."""
    crs = data.get("crs")
    if crs is None:
        return
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if not (isinstance(name, str) and name.endswith(_DEGREES)):
        raise ScenarioError(
            f"{source}: crs: coordinates are longitude and latitude on WGS84 (RFC 7946)", file=source, field="crs"
        )


def _zone(feature: Any, where: str, number: int, source: str) -> tuple[str, dict[str, Any]]:
    if not isinstance(feature, dict) or feature.get("type") != "Feature":
        raise ScenarioError(f"{source}: {where}: a Feature is expected", file=source, field=where)
    properties, geometry = feature.get("properties"), feature.get("geometry")
    properties = properties if isinstance(properties, dict) else {}
    name = properties.get("name") or f"zone {number + 1}"
    label = f"{where} ({name})" if isinstance(name, str) and name.isprintable() else where
    geometry = geometry if isinstance(geometry, dict) else {}
    kind = geometry.get("type")
    coordinates: Any = geometry.get("coordinates")
    entries: dict[str, Any] = {"name": name, **zone_entries(properties, f"{source}: {label}")}
    try:
        if kind == "Point":
            lat, lon = _corner(coordinates)
            if "radius_m" not in entries:
                message = f"{source}: {label}: radius_m: missing; a point is the centre of a cylinder"
                raise ScenarioError(message, file=source, field="radius_m")
            return label, entries | {"lat_deg": lat, "lon_deg": lon}
        if kind == "Polygon":
            coordinates, kind = [coordinates], "MultiPolygon"
        if kind == "MultiPolygon":
            parts = [_rings(part) for part in coordinates]
            if not all(holes_lie_inside(part) for part in parts if part):
                message = f"{source}: {label}: coordinates: a hole lies outside its outline"
                raise ScenarioError(message, file=source, field="coordinates")
            rings = [[list(corner) for corner in ring] for part in parts for ring in part]
            return label, entries | {"rings_deg": rings}
    except (TypeError, ValueError, IndexError) as error:
        allowed = "lists of [longitude, latitude] are expected"
        message = f"{source}: {label}: coordinates: {allowed}"
        raise ScenarioError(message, file=source, field="coordinates", allowed=allowed) from error
    allowed = "a Polygon, MultiPolygon or Point is expected"
    message = f"{source}: {label}: geometry {json.dumps(kind)[:40]}: {allowed}"
    raise ScenarioError(message, file=source, field="geometry", value=kind, allowed=allowed)


def _rings(coordinates: Any) -> list[list[tuple[float, float]]]:
    """Rings of (latitude, longitude) of a polygon's coordinates."""
    return [[_corner(corner) for corner in ring] for ring in coordinates]


def _corner(coordinates: Any) -> tuple[float, float]:
    """Latitude and longitude of a position, whose height, if it has one, says nothing of a zone."""
    if not isinstance(coordinates, list) or not all(type(value) in (int, float) for value in coordinates):
        raise TypeError("no position")
    lon, lat = coordinates[0], coordinates[1]
    return lat, lon
