"""Read files of zones, in the format of their suffix, into [[zones]] tables of a scenario file."""

import functools
import json
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from world.airspace.edge_checks import MAX_CROSSINGS
from world.airspace.geopackage import geopackage_features
from world.airspace.openair import is_openair, openair_zones
from world.airspace.uas_zones import ed269_zones, ed318_zones, is_ed269, is_ed318
from world.airspace.zone_entries import NO_BAND, PUBLISHED, UPSIDE_DOWN, zone_entries
from world.airspace.zone_suffixes import GEOPACKAGE, SUFFIXES
from world.airspace.zones import are_holes_inside, repair_rings
from world.errors import ScenarioError
from world.files import json_value, missing_text
from world.scenario_file import checked_table
from world.scenario_tables import MAX_ZONES, ZoneTable

# ----------------------------------------------------------------------
# Zones of a GeoJSON file (RFC 7946): polygons, multipolygons with their holes, and points with a radius.

# Endings of the CRS names in GeoJSON of 2008 that mean longitude and latitude on WGS84.
_WGS84_CRS_SUFFIXES = ("CRS84", "4326")
# Location of a zone in its file, and its [[zones]] entries, or the reason why it restricts no flight.
Found = tuple[str, dict[str, Any] | str]


def geojson_zones(text: str, source: str) -> Iterator[Found]:
    """Yield the zones of a GeoJSON file (including ED-318), or of a JSON file in ED-269 format.

    A multipolygon is one zone of several parts.  Raises ScenarioError for any other text, and for a geometry that is
    not a zone.

    >>> square = '{"type": "Polygon", "coordinates": [[[8, 46], [8.01, 46], [8.01, 46.01], [8, 46]]]}'
    >>> [(where, entries["name"], len(entries["rings_deg"][0])) for where, entries in geojson_zones(square, "a file")]
    [('geometry (zone 1)', 'zone 1', 4)]
    """
    try:
        data = json_value(text, parse_constant=_reject_constant)
    except ValueError as error:
        raise ScenarioError(f"{source}: not valid JSON: {str(error).splitlines()[0]}", file=source) from error
    # The data of a large file takes several times its size: release the text, and each feature once it is converted.
    del text
    if not isinstance(data, dict):
        raise ScenarioError(f"{source}: expected a GeoJSON object, got {type(data).__name__}", file=source)
    if is_ed269(data):
        yield from ed269_zones(data, source)
        return
    crs = data.get("crs")
    if crs is not None:
        properties = crs.get("properties") if isinstance(crs, dict) else None
        name = properties.get("name") if isinstance(properties, dict) else None
        if not (isinstance(name, str) and name.endswith(_WGS84_CRS_SUFFIXES)):
            raise ScenarioError(
                f"{source}: crs: coordinates are longitude and latitude on WGS84 (RFC 7946)", file=source, field="crs"
            )
    geojson_type = data.get("type")
    if geojson_type == "FeatureCollection":
        features = data.get("features")
        if not isinstance(features, list):
            raise ScenarioError(f"{source}: features: expected a list", file=source, field="features")
        located_features = [(f"features[{k}]", feature) for k, feature in enumerate(features)]
        features.clear()
    elif geojson_type == "Feature":
        located_features = [("feature", data)]
    else:
        located_features = [("geometry", {"type": "Feature", "geometry": data})]
    located_features.reverse()
    for k in range(len(located_features)):
        location, feature = located_features.pop()
        if is_ed318(feature):
            yield from ed318_zones(feature, location, k, source)
        else:
            yield _geojson_zone(feature, location, k, source)


def _reject_constant(name: str) -> float:
    """Raise ValueError for NaN or Infinity, which Python's JSON reader accepts."""
    raise ValueError(f"{name} is not a JSON number")


def _geojson_zone(feature: Any, location: str, index: int, source: str) -> tuple[str, dict[str, Any]]:
    """Return the location of a GeoJSON feature for messages, and the [[zones]] entries of its zone.

    index: index of the feature, from 0, for the default name.

    Raises ScenarioError if the feature is not a zone.
    """
    if not isinstance(feature, dict) or feature.get("type") != "Feature":
        raise ScenarioError(f"{source}: {location}: expected a Feature", file=source, field=location)
    properties, geometry = feature.get("properties"), feature.get("geometry")
    properties = properties if isinstance(properties, dict) else {}
    name = properties.get("name") or f"zone {index + 1}"
    if isinstance(name, str):
        # Latvia's file has a tab before a name.
        name = " ".join(name.split())
    label = f"{location} ({name})" if isinstance(name, str) and name.isprintable() else location
    geometry = geometry if isinstance(geometry, dict) else {}
    geometry_type = geometry.get("type")
    coordinates: Any = geometry.get("coordinates")
    entries: dict[str, Any] = {"name": name, **zone_entries(properties, f"{source}: {label}")}
    try:
        if geometry_type == "Point":
            lat, lon = _parse_corner(coordinates)
            if "radius_m" not in entries:
                message = f"{source}: {label}: radius_m: missing; a point is the centre of a cylinder"
                raise ScenarioError(message, file=source, field="radius_m")
            return label, entries | {"lat_deg": lat, "lon_deg": lon}
        if geometry_type == "Polygon":
            coordinates, geometry_type = [coordinates], "MultiPolygon"
        if geometry_type == "MultiPolygon":
            parts = [[[_parse_corner(corner) for corner in ring] for ring in part] for part in coordinates]
            place = f"{source}: {label}"
            try:
                is_inside = all(are_holes_inside(part) for part in parts if part)
            except ValueError as error:
                raise ScenarioError(f"{place}: coordinates: {error}", file=place, field="coordinates") from error
            if not is_inside:
                fault = f"{place}: coordinates: a hole lies outside its outline"
                raise ScenarioError(fault, file=place, field="coordinates")
            rings = [[list(corner) for corner in ring] for part in parts for ring in part]
            return label, entries | {"rings_deg": rings}
    except (TypeError, ValueError, IndexError) as error:
        allowed = "expected lists of [longitude, latitude]"
        message = f"{source}: {label}: coordinates: {allowed}"
        raise ScenarioError(message, file=source, field="coordinates", allowed=allowed) from error
    allowed = "expected a Polygon, MultiPolygon or Point"
    message = f"{source}: {label}: geometry {json.dumps(geometry_type)[:40]}: {allowed}"
    raise ScenarioError(message, file=source, field="geometry", value=geometry_type, allowed=allowed)


def _parse_corner(coordinates: Any) -> tuple[float, float]:
    """Return the latitude and longitude of a GeoJSON position, which states the longitude first.

    Raises TypeError if it is not a list of numbers.
    """
    if not isinstance(coordinates, list) or not all(type(value) in (int, float) for value in coordinates):
        raise TypeError("no position")
    lon, lat = coordinates[0], coordinates[1]
    return lat, lon


# ----------------------------------------------------------------------
# Zones of a KML file (OGC 07-147r2): placemarks with polygons, and with a point and a radius.

# KML 2.0 to 2.2 use several namespaces, which need not be distinguished here.
_Element = ElementTree.Element
# Largest height difference between the corners of a level ceiling, m.
_LEVEL_TOLERANCE_M = 0.5
_NUMERIC_KEYS = ("floor_amsl_m", "floor_agl_m", "ceiling_amsl_m", "ceiling_agl_m", "radius_m")


def kml_zones(text: str, source: str) -> Iterator[Found]:
    """Yield the location of each zone in a KML file, and its [[zones]] entries.

    An extruded polygon is a zone up to its height, with the datum that `altitudeMode` states. A polygon that is clamped
    to the ground has no ceiling. ExtendedData states kind, floors, ceilings and radii with the keys of a scenario file.
    Raises ScenarioError for text that is not KML, and for a placemark that is not a zone.

    >>> ring = "<coordinates>8,46 8.01,46 8.01,46.01</coordinates>"
    >>> ring = f"<outerBoundaryIs><LinearRing>{ring}</LinearRing></outerBoundaryIs>"
    >>> text = f"<kml><Placemark><name>lake</name><Polygon>{ring}</Polygon></Placemark></kml>"
    >>> [(where, len(entries["rings_deg"][0])) for where, entries in kml_zones(text, "a file")]
    [('Placemark 1 (lake)', 3)]
    """
    # Entities can read other files and expand a small file without limit; KML does not need them.
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ScenarioError(
            f"{source}: declares a document type (DOCTYPE), which is not allowed in a zone file", file=source
        )
    try:
        root = ElementTree.fromstring(text)  # entities were refused above
    except (ElementTree.ParseError, ValueError) as error:
        raise ScenarioError(f"{source}: not valid XML: {str(error).splitlines()[0]}", file=source) from error
    if _tag_name(root) != "kml":
        raise ScenarioError(f"{source}: expected a <kml> element", file=source)
    for number, placemark in enumerate((element for element in root.iter() if _tag_name(element) == "Placemark"), 1):
        name = _kml_text(placemark, "name") or f"zone {number}"
        label = f"Placemark {number}" + (f" ({name})" if name.isprintable() else "")
        yield label, {"name": name, **_kml_zone(placemark, f"{source}: {label}")}


def _tag_name(element: _Element) -> str:
    """Return the tag of an XML element without its namespace."""
    return element.tag.rpartition("}")[2]


def _find_descendants(element: _Element, tag: str) -> list[_Element]:
    """Return the descendants of an XML element that have a tag, in any namespace."""
    return [child for child in element.iter() if _tag_name(child) == tag]


def _kml_text(element: _Element, tag: str) -> str:
    """Return the text of an element's direct child with this tag, or "" without one."""
    return next(((child.text or "").strip() for child in element if _tag_name(child) == tag), "")


def _kml_zone(placemark: _Element, source: str) -> dict[str, Any]:
    """Return the [[zones]] entries of a placemark, without its name.

    Raises ScenarioError if the placemark is not a zone.
    """
    # ExtendedData: Data and SimpleData by name, with numbers converted.
    texts = {str(element.get("name")): _kml_text(element, "value") for element in _find_descendants(placemark, "Data")}
    for element in _find_descendants(placemark, "SimpleData"):
        texts[str(element.get("name"))] = (element.text or "").strip()
    extended_data: dict[str, Any] = {}
    for name, value in texts.items():
        if name in _NUMERIC_KEYS:
            try:
                extended_data[name] = float(value)
            except ValueError as error:
                raise ScenarioError.at(source, name, value, "expected a number", shown=repr(value[:40])) from error
        elif value:
            extended_data[name] = value
    entries = zone_entries(extended_data, source)
    polygons, points = _find_descendants(placemark, "Polygon"), _find_descendants(placemark, "Point")
    if not polygons:
        if len(points) != 1 or "radius_m" not in entries:
            raise ScenarioError(
                f"{source}: expected a Polygon, or a Point with radius_m in its ExtendedData", file=source
            )
        ((lon, lat, _),) = _parse_positions(points[0], source)[:1] or [(math.nan, math.nan, 0.0)]
        return entries | {"lat_deg": lat, "lon_deg": lon}
    rings, ceilings = [], set()
    for polygon in polygons:
        corners = []
        for boundary in (
            *_find_descendants(polygon, "outerBoundaryIs"),
            *_find_descendants(polygon, "innerBoundaryIs"),
        ):
            ring = _parse_positions(boundary, source)
            rings.append([[lat, lon] for lon, lat, _ in ring])
            corners += ring
        ceilings.add(_ceiling_entry(polygon, [up for _, _, up in corners], source))
    if len(ceilings) > 1:
        raise ScenarioError(
            f"{source}: its polygons have different heights: give each polygon a placemark", file=source
        )
    key, height = ceilings.pop()
    states_ceiling = any(ceiling_key in entries for ceiling_key in ("ceiling_amsl_m", "ceiling_agl_m"))
    return {"rings_deg": rings, **({key: height} if key and not states_ceiling else {}), **entries}


def _ceiling_entry(polygon: _Element, heights: list[float], source: str) -> tuple[str, float]:
    """Return the [[zones]] key of a KML polygon's ceiling and its height, m; ("", 0) without a ceiling.

    heights: heights of the polygon's corners, m.

    Raises ScenarioError for a polygon that is above the ground and not extruded, and for a ceiling that is not level.
    """
    mode = _kml_text(polygon, "altitudeMode") or "clampToGround"
    if mode == "clampToGround":
        return "", 0.0
    key = {"absolute": "ceiling_amsl_m", "relativeToGround": "ceiling_agl_m"}.get(mode)
    if key is None:
        allowed = "allowed clampToGround, relativeToGround, absolute"
        message = f"{source}: altitudeMode {mode[:40]!r}: {allowed}"
        raise ScenarioError(message, file=source, field="altitudeMode", value=mode, allowed=allowed)
    if _kml_text(polygon, "extrude") not in ("1", "true"):
        message = f"{source}: altitudeMode {mode} without extrude: such a surface encloses no airspace"
        raise ScenarioError(message, file=source, field="altitudeMode", value=mode)
    if not heights or max(heights) - min(heights) > _LEVEL_TOLERANCE_M:
        raise ScenarioError(f"{source}: its corners have different heights: a zone has a level ceiling", file=source)
    return key, heights[0]


def _parse_positions(element: _Element, source: str) -> list[tuple[float, float, float]]:
    """Return longitude, latitude (deg) and height (m, 0 if not stated) of each position in an XML element.

    Raises ScenarioError for invalid coordinates.
    """
    positions = []
    for coordinates in _find_descendants(element, "coordinates"):
        for position in (coordinates.text or "").split():
            try:
                lon, lat, *altitudes = (float(part) for part in position.split(","))
            except ValueError as error:
                allowed = "expected lon,lat or lon,lat,up"
                message = f"{source}: coordinates {position[:40]!r}: {allowed}"
                raise ScenarioError(
                    message, file=source, field="coordinates", value=position, allowed=allowed
                ) from error
            positions.append((lon, lat, altitudes[0] if altitudes else 0.0))
    return positions


# ----------------------------------------------------------------------
# Formats by suffix, and reading of files.

# A function of a file's text, and of the file's name in messages, that yields the zones.
Reader = Callable[[str, str], Iterator[Found]]
# Readers of text formats by suffix; a GeoPackage is not a text.
FORMATS: dict[str, Reader] = {
    ".geojson": geojson_zones,
    ".json": geojson_zones,
    ".kml": kml_zones,
    ".openair": openair_zones,
    ".txt": openair_zones,
}
# Notes about repairs to authorities' files.
_SELF_CROSSING = "an outline that crosses itself is taken as the area it encloses"
_EMPTY = "outlines that enclose no area are ignored"
_SWAPPED = "lower and upper limits in the wrong order are swapped"
_NO_BAND = "upper limits of 0, or equal to the lower one, mean no ceiling"
# Maximum size of a file, bytes.
MAX_BYTES = 48 * 2**20
# Maximum number of corners of all zones of a file: arcs of OpenAir make hundreds of corners of a few bytes.
MAX_FILE_CORNERS = 1_500_000


@dataclass(slots=True)
class FileZones:
    """Zones of a file, and notes: one line for each kind of change or omission made on reading."""

    zones: list[ZoneTable] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def is_zone_file(path: Path) -> bool:
    """Return True if a file contains zones, judged by its suffix.

    A .txt file contains zones if its first line is an OpenAir command.
    """
    suffix = path.suffix.lower()
    if suffix != ".txt":
        return suffix in SUFFIXES
    try:
        with path.open("rb") as file:
            # A letter cut in two, or in another encoding, does not matter: commands are ASCII.
            return is_openair(file.read(65536).decode("utf-8-sig", errors="replace"))
    except OSError:
        return False


def read_zone_files(files: str | Sequence[str], source: str, base: Path | None) -> FileZones:
    """Read the zones of one or more files of a scenario.

    source: name of the scenario in messages.
    base: folder of relative paths.

    Raises ScenarioError as `read_zone_file` does, and for more zones than a scenario may have.
    """
    all_zones = FileZones()
    for file in [files] if isinstance(files, str) else files:
        file_zones = read_zone_file(
            Path(base or "", file), f"{source}: zones_file: {file}", MAX_ZONES - len(all_zones.zones)
        )
        all_zones.zones += file_zones.zones
        all_zones.notes += file_zones.notes
    return all_zones


def read_zone_file(path: Path, source: str, max_zones: int = MAX_ZONES) -> FileZones:
    """Read the zones of a file, in the format of its suffix.

    source: name of the file in messages.
    max_zones: maximum number of zones.

    Raises ScenarioError for a file that cannot be read, for more zones than ``max_zones``, and for an invalid zone.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "lake.geojson"
    ...     _ = path.write_text(
    ...         '{"type": "Polygon", "coordinates": [[[8, 46], [8.01, 46], [8.01, 46.01], [8, 46]]]}', encoding="ascii"
    ...     )
    ...     [(zone.name, zone.kind) for zone in read_zone_file(path, "a file").zones]
    [('zone 1', 'exclusion')]
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        allowed = f"a file of zones is {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}"
        message = f"{source}: suffix {path.suffix!r}: {allowed}"
        raise ScenarioError(message, file=source, field="suffix", value=path.suffix, allowed=allowed)
    file_zones, unrestricted_counts = FileZones(), Counter[str]()
    repaired_names: dict[str, list[str]] = {_SELF_CROSSING: [], _SWAPPED: [], _NO_BAND: [], _EMPTY: []}
    corner_count = total_crossings = 0
    found_zones: Iterator[Found]
    if suffix == GEOPACKAGE:
        _check_size(path, source)
        features = enumerate(geopackage_features(path, source))
        found_zones = (_geojson_zone(feature, location, k, source) for k, (location, feature) in features)
    else:
        text = _read_text(path, source, openair=FORMATS[suffix] is openair_zones)
        found_zones = FORMATS[suffix](text, source)
        # The zones of a large file take several times its size: release the text.
        del text
    for location, entries in found_zones:
        if isinstance(entries, str):
            unrestricted_counts[entries] += 1
            continue
        if len(file_zones.zones) >= max_zones:
            message = f"{source}: too many zones: at most {MAX_ZONES:,} are allowed in all files together"
            raise ScenarioError(message, file=source, field="zones", allowed=f"at most {MAX_ZONES:,}")
        corner_count += sum(map(len, entries.get("rings_deg", ())))
        if corner_count > MAX_FILE_CORNERS:
            allowed = f"at most {MAX_FILE_CORNERS:,}"
            message = f"{source}: too many corners: {allowed} are allowed in one file"
            raise ScenarioError(message, file=source, allowed=allowed)
        place = f"{source}: {location}"
        # Repair the outline of a zone from an authority's file.
        is_published = entries.pop(PUBLISHED, False)
        notes = [note for flag, note in ((UPSIDE_DOWN, _SWAPPED), (NO_BAND, _NO_BAND)) if entries.pop(flag, False)]
        if is_published and "rings_deg" in entries:
            try:
                repaired = repair_rings(entries["rings_deg"], MAX_CROSSINGS - total_crossings)
            except ValueError as error:
                raise ScenarioError(f"{place}: {error}", file=place, field="rings_deg", allowed=str(error)) from error
            if repaired is not None:
                entries["rings_deg"], crossing_count = repaired
                total_crossings += crossing_count
                notes.append(_SELF_CROSSING if entries["rings_deg"] else _EMPTY)
        for note in notes:
            repaired_names[note].append(str(entries["name"]))
        if _EMPTY in notes:
            continue
        if entries.get("rings_deg") == []:
            raise ScenarioError(f"{place}: its outline encloses no area", file=source, field="rings_deg")
        file_zones.zones.append(checked_table(functools.partial(ZoneTable.model_validate, entries), place))
    if not file_zones.zones and not unrestricted_counts and not repaired_names[_EMPTY]:
        raise ScenarioError(f"{source}: contains no zone", file=source)
    for reason, count in unrestricted_counts.items():
        subject = "1 zone restricts" if count == 1 else f"{count:,} zones restrict"
        file_zones.notes.append(f"{source}: {subject} no flight: {reason}")
    for note_text, names in repaired_names.items():
        if names:
            remainder = f" and {len(names) - 5:,} more" if len(names) > 5 else ""
            file_zones.notes.append(f"{source}: {note_text}: {', '.join(names[:5])}{remainder}")
    return file_zones


def _check_size(path: Path, source: str) -> None:
    """Raise ScenarioError for a file that is missing or too large."""
    if not path.is_file():
        raise ScenarioError(f"{source}: {missing_text(path)}", file=source)
    if path.stat().st_size > MAX_BYTES:
        raise ScenarioError(
            f"{source}: {path.stat().st_size:,} bytes: a file of zones has at most {MAX_BYTES:,} bytes", file=source
        )


def _read_text(path: Path, source: str, *, openair: bool) -> str:
    """Return the text of a file, decoded as UTF-8, or an OpenAir file as Latin-1 if it is not UTF-8.

    Raises ScenarioError for a file that is missing, too large or not text.
    """
    try:
        _check_size(path, source)
        data = path.read_bytes()
        try:
            return data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            if openair and b"\0" not in data:
                return data.decode("latin-1")
            raise ScenarioError(f"{source}: not a text file in UTF-8 (byte {error.start})", file=source) from error
    except OSError as error:
        raise ScenarioError(f"{source}: cannot be read: {error.strerror}", file=source) from error
