"""GeoJSON: every geometry that is a zone, and what is none, by its name and in one line."""

import json
from typing import Any

import pytest

from world.airspace.geojson_zones import geojson_zones
from world.errors import ScenarioError

RING = [[8.0, 46.0], [8.1, 46.0], [8.1, 46.1], [8.0, 46.0]]
HOLE = [[8.05, 46.01], [8.09, 46.01], [8.09, 46.05], [8.05, 46.01]]
FAR = [[9.0, 46.0], [9.1, 46.0], [9.1, 46.1], [9.0, 46.0]]


def feature(geometry_type: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    geometry = {"type": geometry_type, "coordinates": coordinates}
    return {"type": "Feature", "properties": {"name": "lake", **properties}, "geometry": geometry}


def read(*features: Any) -> list[tuple[str, dict[str, Any]]]:
    return list(geojson_zones(json.dumps({"type": "FeatureCollection", "features": list(features)}), "z.geojson"))


def turned(ring: list[list[float]]) -> list[list[float]]:
    """Latitude first."""
    return [[lat, lon] for lon, lat in ring]


def test_each_geometry() -> None:
    found = read(
        feature("Polygon", [RING], kind="inclusion", ceiling_agl_m=120),
        feature("Polygon", [RING, HOLE]),
        feature("MultiPolygon", [[RING, HOLE], [FAR]]),
        feature("Point", [8.0, 46.0, 500.0], radius_m=80),
    )
    assert [where for where, _ in found] == [f"features[{k}] (lake)" for k in range(4)]
    assert [entries for _, entries in found] == [
        {"name": "lake", "kind": "inclusion", "ceiling_agl_m": 120, "rings_deg": [turned(RING)]},
        {"name": "lake", "kind": "exclusion", "rings_deg": [turned(RING), turned(HOLE)]},
        {"name": "lake", "kind": "exclusion", "rings_deg": [turned(RING), turned(HOLE), turned(FAR)]},
        {"name": "lake", "kind": "exclusion", "radius_m": 80, "lat_deg": 46.0, "lon_deg": 8.0},
    ]


def test_a_feature_and_a_geometry_alone() -> None:
    alone = feature("Polygon", [[[*corner, 0.0] for corner in RING]])
    for data, where, name in ((alone, "feature (lake)", "lake"), (alone["geometry"], "geometry", "zone 1")):
        ((found, entries),) = geojson_zones(json.dumps(data), "z.geojson")
        assert (found.split(" (zone")[0], entries["name"]) == (where, name)
        assert entries["rings_deg"] == [turned(RING)]


DEEP = "[" * 200_000
FAULTS: dict[str, tuple[Any, str]] = {
    "not JSON": ("{", "not valid JSON"),
    "brackets without end": (DEEP, "not valid JSON"),
    "NaN": (json.dumps(feature("Polygon", [[[8.0, float("nan")], *RING]])), "NaN is no number of JSON"),
    "infinity": (json.dumps(feature("Point", [8.0, float("inf")], radius_m=9)), "Infinity is no number"),
    "a list": ("[]", "a GeoJSON object is expected, got list"),
    "no features": ('{"type": "FeatureCollection"}', "features: a list is expected"),
    "a feature that is none": ('{"type": "FeatureCollection", "features": [5]}', "features[0]: a Feature is expected"),
    "a line": (json.dumps(feature("LineString", RING)), 'feature (lake): geometry "LineString": a Polygon'),
    "no geometry": ('{"type": "Feature", "geometry": null}', "geometry null: a Polygon"),
    "a geometry of no kind": ('{"type": ["Polygon"]}', 'geometry ["Polygon"]: a Polygon'),
    "a point alone": (json.dumps(feature("Point", [8.0, 46.0])), "feature (lake): radius_m: missing"),
    "a ring too deep": (json.dumps(feature("Polygon", [[RING]])), "feature (lake): coordinates: lists of"),
    "a ring too flat": (json.dumps(feature("Polygon", RING)), "coordinates: lists of [longitude, latitude]"),
    "a corner of one": (json.dumps(feature("Polygon", [[[8.0]]])), "coordinates: lists of"),
    "a corner of text": (json.dumps(feature("Polygon", [[["8", "46"]]])), "coordinates: lists of"),
    "no coordinates": ('{"type": "Polygon"}', "coordinates: lists of"),
    "a hole outside": (json.dumps(feature("Polygon", [RING, FAR])), "a hole lies outside its outline"),
    "a key misspelt": (json.dumps(feature("Polygon", [RING], ceiling_m=9)), "feature (lake): ceiling_m: unknown"),
    "another CRS": (
        json.dumps({**feature("Polygon", [RING]), "crs": {"properties": {"name": "urn:ogc:def:crs:EPSG::25832"}}}),
        "crs: coordinates are longitude and latitude on WGS84",
    ),
}


@pytest.mark.parametrize("case", FAULTS)
def test_what_is_no_zone(case: str) -> None:
    text, wanted = FAULTS[case]
    with pytest.raises(ScenarioError) as caught:
        list(geojson_zones(text, "z.geojson"))
    message = str(caught.value)
    assert message.startswith("z.geojson: ")
    assert message.isprintable()
    assert wanted in message


def test_the_older_name_of_degrees_is_taken() -> None:
    data = {
        **feature("Polygon", [RING]),
        "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}},
    }
    assert len(list(geojson_zones(json.dumps(data), "z.geojson"))) == 1
