"""What files state of a zone: our own keys, openAIP's limits in both of its spellings, and what is refused."""

import json
import time
import tomllib
import tracemalloc
from pathlib import Path
from typing import Any

import pytest

from planfly.flight_options import read_named_fences
from tests.soak import at_most
from tests.world.made.made_scenario import SMALL
from world.airspace import zone_files
from world.airspace.zone_entries import FLIGHT_LEVEL_ERROR, zone_entries
from world.airspace.zone_files import MAX_BYTES, geojson_zones, kml_zones, read_zone_file
from world.airspace.zones import Cylinder, Polygon
from world.errors import PlanflyError, ScenarioError
from world.scenario import Scenario, load_scenario, scenario_from_spec


def limit(value: Any, unit: Any, datum: Any) -> dict[str, Any]:
    return {"value": value, "unit": unit, "referenceDatum": datum}


def test_our_own_keys_are_taken_and_others_left() -> None:
    stated = {"kind": "inclusion", "floor_agl_m": 30.0, "ceiling_amsl_m": None, "colour": "red", "icaoClass": 3}
    assert zone_entries(stated, "a file") == {"kind": "inclusion", "floor_agl_m": 30.0}


@pytest.mark.parametrize(
    ("low", "high"),
    [
        (limit(500, 1, 1), limit(400, 1, 0)),
        (limit(500, "FT", "MSL"), limit(400, "FT", "GND")),
        (limit(152.4, "M", "MSL"), limit(121.92, 0, 0)),
    ],
)
def test_feet_and_metres_above_the_sea_and_the_ground(low: dict[str, Any], high: dict[str, Any]) -> None:
    entries = zone_entries({"lowerLimit": low, "upperLimit": high}, "a file")
    assert entries == {"kind": "exclusion", "floor_amsl_m": 152.4, "ceiling_agl_m": 121.92}
    assert zone_entries({"lowerCeiling": low, "upperCeiling": high}, "a file") == entries


def test_the_ground_is_no_floor() -> None:
    assert zone_entries({"lowerLimit": limit(0, 1, 0)}, "a file") == {"kind": "exclusion"}


def test_a_flight_level_bounds_an_exclusion_on_the_safe_side() -> None:
    entries = zone_entries({"lowerLimit": limit(65, 6, 2), "upperLimit": limit(195, "FL", "STD")}, "a file")
    assert entries["floor_amsl_m"] == pytest.approx(6500 * 0.3048 - FLIGHT_LEVEL_ERROR)
    assert entries["ceiling_amsl_m"] == pytest.approx(19500 * 0.3048 + FLIGHT_LEVEL_ERROR)
    # FL 660 is above every height that a scenario knows.
    assert zone_entries({"upperLimit": limit(660, 6, 2)}, "a file")["ceiling_amsl_m"] == 9000.0


FAULTS: dict[str, tuple[dict[str, Any], str]] = {
    "a key misspelt": ({"ceiling_m": 100.0}, "ceiling_m: unknown; known are kind, floor_amsl_m"),
    "another misspelt": ({"radius": 100.0}, "radius: unknown"),
    "a limit that is a number": (
        {"upperLimit": 100.0},
        "upperLimit: expected an object with value, unit and referenceDatum",
    ),
    "no value": ({"upperLimit": {"unit": 1, "referenceDatum": 1}}, "upperLimit.value: expected a number"),
    "a truth": ({"upperLimit": limit(True, 1, 1)}, "upperLimit.value: expected a number"),
    "a unit": ({"upperLimit": limit(5, 2, 1)}, "upperLimit.unit: allowed 0, M, 1, FT, 6, FL"),
    "a height of the FAA's": ({"LOWER_VAL": "SFC", "LOWER_UOM": "FT"}, "LOWER_VAL: expected a number"),
    "a list of units": ({"upperLimit": limit(5, [1], 1)}, "upperLimit.unit: allowed"),
    "a datum": ({"lowerLimit": limit(5, 1, "QFE")}, "lowerLimit.referenceDatum: allowed 0, GND, AGL, SFC, 1, MSL"),
    "a flight level of an inclusion": (
        {"kind": "inclusion", "upperLimit": limit(65, 6, 2)},
        "cannot bound an inclusion",
    ),
}


@pytest.mark.parametrize("case", FAULTS)
def test_what_is_refused(case: str) -> None:
    properties, wanted = FAULTS[case]
    with pytest.raises(ScenarioError) as caught:
        zone_entries(properties, "a file")
    assert str(caught.value).startswith("a file: ")
    assert wanted in str(caught.value)


# ----------------------------------------------------------------------
# GeoJSON: every geometry that is a zone, and what is none, by its name and in one line.

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
GEOJSON_FAULTS: dict[str, tuple[Any, str]] = {
    "not JSON": ("{", "not valid JSON"),
    "brackets without end": (DEEP, "not valid JSON"),
    "NaN": (json.dumps(feature("Polygon", [[[8.0, float("nan")], *RING]])), "NaN is not a JSON number"),
    "infinity": (json.dumps(feature("Point", [8.0, float("inf")], radius_m=9)), "Infinity is not a JSON number"),
    "a list": ("[]", "expected a GeoJSON object, got list"),
    "no features": ('{"type": "FeatureCollection"}', "features: expected a list"),
    "a feature that is none": ('{"type": "FeatureCollection", "features": [5]}', "features[0]: expected a Feature"),
    "a line": (json.dumps(feature("LineString", RING)), 'feature (lake): geometry "LineString": expected a Polygon'),
    "no geometry": ('{"type": "Feature", "geometry": null}', "geometry null: expected a Polygon"),
    "a geometry of no kind": ('{"type": ["Polygon"]}', 'geometry ["Polygon"]: expected a Polygon'),
    "a point alone": (json.dumps(feature("Point", [8.0, 46.0])), "feature (lake): radius_m: missing"),
    "a ring too deep": (json.dumps(feature("Polygon", [[RING]])), "feature (lake): coordinates: expected lists of"),
    "a ring too flat": (json.dumps(feature("Polygon", RING)), "coordinates: expected lists of [longitude, latitude]"),
    "a corner of one": (json.dumps(feature("Polygon", [[[8.0]]])), "coordinates: expected lists of"),
    "a corner of text": (json.dumps(feature("Polygon", [[["8", "46"]]])), "coordinates: expected lists of"),
    "no coordinates": ('{"type": "Polygon"}', "coordinates: expected lists of"),
    "a hole outside": (json.dumps(feature("Polygon", [RING, FAR])), "a hole lies outside its outline"),
    "a key misspelt": (json.dumps(feature("Polygon", [RING], ceiling_m=9)), "feature (lake): ceiling_m: unknown"),
    "another CRS": (
        json.dumps({**feature("Polygon", [RING]), "crs": {"properties": {"name": "urn:ogc:def:crs:EPSG::25832"}}}),
        "crs: coordinates are longitude and latitude on WGS84",
    ),
}


@pytest.mark.parametrize("case", GEOJSON_FAULTS)
def test_a_geometry_that_is_no_zone(case: str) -> None:
    text, wanted = GEOJSON_FAULTS[case]
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


# ----------------------------------------------------------------------
# KML: polygons as Google Earth writes them, points with a radius, and what is no zone, in one line.

NAMESPACE = 'xmlns="http://www.opengis.net/kml/2.2"'


def ring(*, side: str = "outer", up: float = 0.0, size: float = 0.1, last: float | None = None) -> str:
    corners = ((8.0, 46.0, up), (8.0 + size, 46.0, up), (8.0 + size, 46.0 + size, up if last is None else last))
    text = "\n  ".join(f"{lon:.3f},{lat:.3f},{height:g}" for lon, lat, height in corners)
    return f"<{side}BoundaryIs><LinearRing><coordinates>\n  {text}\n</coordinates></LinearRing></{side}BoundaryIs>"


def placemark(inside: str, name: str = "lake") -> str:
    return f"<Placemark><name>{name}</name>{inside}</Placemark>"


def document(*placemarks: str) -> str:
    head = '<?xml version="1.0" encoding="UTF-8"?>'
    return f"{head}<kml {NAMESPACE}><Document><Folder>{''.join(placemarks)}</Folder></Document></kml>"


def polygon(*, mode: str = "", extrude: bool = False, up: float = 0.0, holes: str = "") -> str:
    how = f"<extrude>1</extrude>{mode}" if extrude else mode
    return f"<Polygon>{how}{ring(up=up)}{holes}</Polygon>"


def data(**values: object) -> str:
    entries = "".join(f'<Data name="{key}"><value>{value}</value></Data>' for key, value in values.items())
    return f"<ExtendedData>{entries}</ExtendedData>"


OUTLINE = [[46.0, 8.0], [46.0, 8.1], [46.1, 8.1]]
ABSOLUTE, RELATIVE = "<altitudeMode>absolute</altitudeMode>", "<altitudeMode>relativeToGround</altitudeMode>"


def test_polygons_and_their_heights() -> None:
    text = document(
        placemark(polygon()),
        placemark(polygon(mode="<altitudeMode>clampToGround</altitudeMode>", up=300.0)),
        placemark(polygon(mode=ABSOLUTE, extrude=True, up=450.0)),
        placemark(polygon(mode=RELATIVE, extrude=True, up=120.0) + data(kind="inclusion", floor_agl_m=30)),
        placemark(polygon(mode=RELATIVE, extrude=True, up=120.0) + data(ceiling_amsl_m=900.0)),
    )
    found = [entries for _, entries in kml_zones(text, "z.kml")]
    assert all(entries.pop("name") == "lake" and entries.pop("rings_deg") == [OUTLINE] for entries in found)
    assert found == [
        {"kind": "exclusion"},
        {"kind": "exclusion"},
        {"kind": "exclusion", "ceiling_amsl_m": 450.0},
        {"kind": "inclusion", "floor_agl_m": 30.0, "ceiling_agl_m": 120.0},
        {"kind": "exclusion", "ceiling_amsl_m": 900.0},
    ]


def test_holes_and_parts() -> None:
    hole = [[46.0, 8.0], [46.0, 8.02], [46.02, 8.02]]
    text = document(
        placemark(f"<MultiGeometry>{polygon(holes=ring(side='inner', size=0.02))}{polygon()}</MultiGeometry>")
    )
    ((where, entries),) = kml_zones(text, "z.kml")
    assert where == "Placemark 1 (lake)"
    assert entries["rings_deg"] == [OUTLINE, hole, OUTLINE]


def test_a_point_with_a_radius_by_either_kind_of_data() -> None:
    point = "<Point><coordinates>8.5,46.5,0</coordinates></Point>"
    simple = '<ExtendedData><SchemaData><SimpleData name="radius_m">80</SimpleData></SchemaData></ExtendedData>'
    for stated in (data(radius_m=80), simple):
        ((_, entries),) = kml_zones(document(placemark(point + stated)), "z.kml")
        assert entries == {"name": "lake", "kind": "exclusion", "radius_m": 80.0, "lat_deg": 46.5, "lon_deg": 8.5}


KML_FAULTS = {
    "not XML": ("<kml>", "not valid XML"),
    "no KML": ("<gpx/>", "expected a <kml> element"),
    "an entity": (
        '<!DOCTYPE kml [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><kml>&b;</kml>',
        "declares a document type (DOCTYPE), which is not allowed",
    ),
    "a line": (document(placemark("<LineString/>", "road")), "Placemark 1 (road): expected a Polygon"),
    "a point alone": (document(placemark("<Point><coordinates>8,46</coordinates></Point>")), "expected a Polygon"),
    "a sheet in the air": (
        document(placemark(polygon(mode=ABSOLUTE, up=300.0))),
        "altitudeMode absolute without extrude: such a surface encloses no airspace",
    ),
    "a sloping roof": (
        document(placemark(f"<Polygon><extrude>1</extrude>{ABSOLUTE}{ring(up=300.0, last=301.0)}</Polygon>")),
        "its corners have different heights",
    ),
    "an altitude mode": (
        document(placemark(polygon(mode="<altitudeMode>sea</altitudeMode>", extrude=True))),
        "altitudeMode 'sea': allowed clampToGround, relativeToGround, absolute",
    ),
    "parts of different heights": (
        document(placemark(polygon(mode=ABSOLUTE, extrude=True, up=300.0) + polygon())),
        "its polygons have different heights",
    ),
    "a number that is none": (
        document(placemark(polygon() + data(floor_agl_m="low"))),
        "floor_agl_m: 'low': expected a number",
    ),
    "a key misspelt": (document(placemark(polygon() + data(ceiling="90"))), "ceiling: unknown; known are kind"),
    "coordinates of text": (
        document(placemark(polygon().replace("8.000,46.000,0", "8,north"))),
        "coordinates '8,north': expected lon,lat or lon,lat,up",
    ),
}


@pytest.mark.parametrize("case", KML_FAULTS)
def test_a_placemark_that_is_no_zone(case: str) -> None:
    text, wanted = KML_FAULTS[case]
    with pytest.raises(ScenarioError) as caught:
        list(kml_zones(text, "z.kml"))
    message = str(caught.value)
    assert message.startswith("z.kml: ")
    assert message.isprintable()
    assert wanted in message


# ----------------------------------------------------------------------
# Files of zones named by a scenario: read beside it, written down with it, refused by their names.

# Near 46 N 8 E, where the small scenario's map has its origin.
LAKE_RING = [[8.0, 46.01], [8.01, 46.01], [8.01, 46.02], [8.0, 46.01]]
LAKE = {
    "type": "Feature",
    "properties": {"name": "lake", "ceiling_agl_m": 90.0},
    "geometry": {"type": "Polygon", "coordinates": [LAKE_RING]},
}
MAST = """<kml><Placemark><name>mast</name><ExtendedData><Data name="radius_m"><value>80</value></Data></ExtendedData>
<Point><coordinates>8.0,46.02</coordinates></Point></Placemark></kml>"""
OWN = '[[zones]]\nname = "yard"\nkind = "exclusion"\neast_m = 0\nnorth_m = 900\nradius_m = 50\n'


def scenario_with(tmp_path: Path, files: str, more: str = "") -> Scenario:
    (tmp_path / "zones").mkdir(exist_ok=True)
    (tmp_path / "zones" / "lake.geojson").write_text(json.dumps(LAKE), encoding="utf-8")
    (tmp_path / "zones" / "mast.KML").write_text(MAST, encoding="utf-8")
    file = tmp_path / "small.toml"
    file.write_text(f"zones_file = {files}\n{SMALL}{more}", encoding="utf-8")
    return load_scenario(str(file))


def test_files_beside_the_scenario_are_read_after_its_own_zones(tmp_path: Path) -> None:
    scenario = scenario_with(tmp_path, '["zones/lake.geojson", "zones/mast.KML"]', OWN)
    assert [zone.name for zone in scenario.zones] == ["yard", "lake", "mast"]
    lake, mast = scenario.zones[1].shape, scenario.zones[2].shape
    assert isinstance(lake, Polygon)
    assert isinstance(mast, Cylinder)
    # 0.01 degrees of latitude there are 1,111.5 m, give or take a tenth.
    assert lake.rings[0][0] == pytest.approx((0.0, 1111.5), abs=0.1)
    assert (mast.east, mast.north, mast.radius) == pytest.approx((0.0, 2223.0, 80.0), abs=0.1)


def test_what_is_written_down_needs_no_file(tmp_path: Path) -> None:
    scenario = scenario_with(tmp_path, '"zones/lake.geojson"')
    written = scenario.to_json()
    assert "zones_file" not in written
    (tmp_path / "zones" / "lake.geojson").unlink()
    again = scenario_from_spec(written, "a log")
    assert again.zones == scenario.zones
    assert again.to_json() == written


BAD_FILES = {
    "missing.geojson": (None, "no such file"),
    "zones.kmz": (b"PK", "suffix '.kmz': a file of zones is .geojson, .json, .kml, .openair, .txt or .gpkg"),
    "empty.geojson": (b"", "not valid JSON"),
    "none.geojson": (b'{"type": "FeatureCollection", "features": []}', "contains no zone"),
    "none.kml": (b"<kml/>", "contains no zone"),
    "latin.geojson": (b'{"type": "\xe9"}', "not a text file in UTF-8 (byte 10)"),
    "large.kml": (b" " * (MAX_BYTES + 1), "50,331,649 bytes: a file of zones has at most 50,331,648 bytes"),
    "pole.geojson": (
        json.dumps(LAKE).replace("46.02", "89.5").encode(),
        "feature (lake): rings_deg.0.2: latitude 89.5: allowed -89..89",
    ),
    "kind.geojson": (
        json.dumps(LAKE).replace('"name"', '"kind": "prohibited", "name"').encode(),
        'feature (lake): kind: "prohibited"',
    ),
    "name.geojson": (json.dumps(LAKE).replace('"lake"', "7").encode(), "feature: name: 7: expected text"),
    "band.geojson": (
        json.dumps(LAKE).replace('"name"', '"floor_agl_m": 90, "name"').encode(),
        "feature (lake): ceiling_agl_m: 90: must be above floor_agl_m 90",
    ),
    "bow.geojson": (
        json.dumps(LAKE).replace("[8.01, 46.01], [8.01, 46.02]", "[8.01, 46.02], [8.01, 46.01], [8.0, 46.02]").encode(),
        "zones[0] (lake): crosses or touches itself",
    ),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_a_bad_file_is_refused_by_its_name(name: str, tmp_path: Path) -> None:
    content, wanted = BAD_FILES[name]
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(PlanflyError) as caught:
        scenario_with(tmp_path, f'"{name}"')
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'small.toml'}: ")
    assert message.isprintable()
    assert wanted in message


# ----------------------------------------------------------------------
# A million zones: no more are read than a scenario may have, in all its files.


@pytest.mark.parametrize("suffix", ["geojson", "kml"])
def test_no_more_zones_are_made_than_a_scenario_may_have(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = json.dumps(LAKE) if suffix == "geojson" else placemark(polygon())
    for name, count in (("a", 3), ("b", 2)):
        parts = [one] * count
        text = f'{{"type": "FeatureCollection", "features": [{",".join(parts)}]}}'
        (tmp_path / f"{name}.{suffix}").write_text(text if suffix == "geojson" else document(*parts))
    made: list[str] = []
    monkeypatch.setattr(zone_files, "MAX_ZONES", 4)
    monkeypatch.setattr(zone_files, "checked_table", lambda _, where: made.append(where))
    files = [f"{name}.{suffix}" for name in "ab"]
    with pytest.raises(ScenarioError) as caught:
        zone_files.read_zone_files(files, "s.toml", tmp_path)
    assert (
        str(caught.value)
        == f"s.toml: zones_file: b.{suffix}: too many zones: at most 4 are allowed in all files together"
    )
    assert len(made) == 4


def test_a_million_of_each_is_a_line_at_once(tmp_path: Path) -> None:
    """Threats and zones of a scenario, and a file of zones: beyond what is read, by their size alone."""
    threat = '[[threats]]\nname="t"\neast_m=0\nnorth_m=0\namsl_m=5\nkill_radius_m=1\nkill_scale_m=5\n'
    started = time.process_time()
    for name, text in (("t.toml", SMALL + threat * 10**6), ("z.toml", SMALL + OWN * 10**6)):
        (tmp_path / name).write_text(text)
        with pytest.raises(ScenarioError, match="bytes: a scenario file has at most 16,777,216"):
            load_scenario(str(tmp_path / name))
    for name in ("z.geojson", "z.kml"):
        (tmp_path / name).write_text(" " * 10**8)
        with pytest.raises(ScenarioError, match="bytes: a file of zones has at most 50,331,648"):
            zone_files.read_zone_file(tmp_path / name, name)
    assert time.process_time() - started < at_most(2.0)


@pytest.mark.parametrize("what", ["threats", "zones"])
def test_more_threats_and_zones_than_20000_are_a_line(what: str) -> None:
    spec = tomllib.loads(SMALL)
    spec[what] = [{}] * 20_001
    with pytest.raises(ScenarioError, match=rf"^s: {what}: .*20,?000") as caught:
        scenario_from_spec(spec, "s")
    assert "\n" not in str(caught.value)


# ----------------------------------------------------------------------
# Files in the styles of those that publish airspace, made here: openAIP's, the FAA's, EUROCAE's ED-269 of European
# authorities, OpenAir, and Google Earth's KML.


def openaip(upper: tuple[float, str, str], lower: tuple[float, str, str]) -> dict[str, Any]:
    keys = ("value", "unit", "referenceDatum")
    limits = {"upperCeiling": dict(zip(keys, upper, strict=True)), "lowerCeiling": dict(zip(keys, lower, strict=True))}
    return feature("Polygon", [RING], **{"class": "R", "name": "lake", **limits})


def faa(upper: tuple[object, str, str], lower: tuple[object, str, str]) -> dict[str, Any]:
    stated = {"UPPER": upper, "LOWER": lower}
    parts = {f"{side}_{part}": one[k] for side, one in stated.items() for k, part in enumerate(("VAL", "UOM", "CODE"))}
    return feature("Polygon", [RING], NAME="LAKE CLASS B", CLASS="B", **parts)


# A shelf from 1,500 to 10,000 ft; a range to 40,000 ft, above every flight; from the ground; one above every flight.
SHELF = {"floor_amsl_m": 457.2, "ceiling_amsl_m": 3048.0}
PUBLISHED: dict[str, tuple[dict[str, Any], dict[str, float]]] = {
    "openAIP, a shelf": (openaip((10000, "FT", "MSL"), (1500, "FT", "MSL")), SHELF),
    "openAIP, a firing range": (openaip((40000, "FT", "MSL"), (0, "FT", "GND")), {"ceiling_amsl_m": 9000.0}),
    "openAIP, upper airspace": (openaip((660, "FL", "STD"), (330, "FL", "STD")), {"floor_amsl_m": 9000.0}),
    "FAA, a shelf": (faa((10000, "FT", "MSL"), (1500, "FT", "MSL")), SHELF),
    "FAA, from the surface": (faa(("4000", "FT", "MSL"), ("0", "FT", "SFC")), {"ceiling_amsl_m": 1219.2}),
    "FAA, without an upper limit": (faa((-9998, "", ""), (700, "FT", "AGL")), {"floor_agl_m": 213.36}),
}


@pytest.mark.parametrize("case", PUBLISHED)
def test_limits_as_they_are_published(case: str, tmp_path: Path) -> None:
    published, limits = PUBLISHED[case]
    path = tmp_path / "z.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [published]}), encoding="utf-8")
    (zone,) = zone_files.read_zone_file(path, "z.geojson").zones
    found = {name: value for name, value in zone.model_dump().items() if "_m" in name and value is not None}
    assert found == pytest.approx(limits)


def test_an_upper_limit_at_the_ground_is_refused(tmp_path: Path) -> None:
    """It would keep nobody out, and nobody would be told."""
    path = tmp_path / "z.geojson"
    path.write_text(json.dumps(openaip((0, "FT", "GND"), (0, "FT", "GND"))), encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"upperCeiling: expected a value above 0: nothing lies below the ground$"):
        zone_files.read_zone_file(path, "z.geojson")


OPENAIR = "AC R\nAN LAKE\nAH 2200ft AMSL\nAL GND\nV X=46:00:00 N 008:00:00 E\nDC 1.10\n"


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        (
            "lake.shp",
            OPENAIR,
            "lake.shp: suffix '.shp': a file of zones is .geojson, .json, .kml, .openair, .txt or .gpkg",
        ),
        ("lake.geojson", OPENAIR, "lake.geojson: not valid JSON"),
        ("lake.kml", OPENAIR, "lake.kml: not valid XML"),
    ],
)
def test_forms_that_are_not_read_are_a_line(name: str, text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError) as caught:
        zone_files.read_zone_file(tmp_path / name, name)
    assert str(caught.value).startswith(said)


def test_a_placemark_of_google_earth_with_its_styles() -> None:
    """As it saves one: styles and their maps, an icon, and a ring that is closed, in one line of coordinates."""
    style = (
        '<Style id="pin"><IconStyle><Icon><href>http://maps.google.com/pin.png</href></Icon></IconStyle></Style>'
        '<StyleMap id="map"><Pair><key>normal</key><styleUrl>#pin</styleUrl></Pair></StyleMap>'
    )
    corners = "8,46,0 8.1,46,0 8.1,46.1,0 8,46,0 "
    around = f"<outerBoundaryIs><LinearRing><coordinates>{corners}</coordinates></LinearRing></outerBoundaryIs>"
    inside = f"<name>lake</name><styleUrl>#map</styleUrl><Polygon><tessellate>1</tessellate>{around}</Polygon>"
    text = f"<kml {NAMESPACE}><Document>{style}<Placemark>{inside}</Placemark></Document></kml>"
    ((_, entries),) = kml_zones(text, "z.kml")
    assert entries == {"name": "lake", "kind": "exclusion", "rings_deg": [[*OUTLINE, OUTLINE[0]]]}


# ----------------------------------------------------------------------
# Zones of a file of a whole country: those far from the area are left out, and what is not taken as it stands is said.


def test_every_suffix_that_help_names_has_a_reader() -> None:
    assert {*zone_files.FORMATS, ".gpkg"} == set(zone_files.SUFFIXES)


def square_at(name: str, lat: float, lon: float, **more: Any) -> dict[str, Any]:
    """A square of 0.01 degrees with its south-west corner here."""
    ring = [[lon, lat], [lon + 0.01, lat], [lon + 0.01, lat + 0.01], [lon, lat + 0.01], [lon, lat]]
    return feature("Polygon", [ring]) | {"properties": {"name": name, **more}}


def test_zones_far_from_the_area_are_left_out(tmp_path: Path) -> None:
    """The small area reaches some km from 46 N, 8 E: 0.2 degrees of latitude are 22.2 km, 0.15 are 16.7 km."""
    country = [
        square_at("near", 46.15, 8.0),
        square_at("far", 46.4, 8.0),
        square_at("farther", 46.0, 9.0),
        feature("Point", [9.0, 46.0], radius_m=60_000) | {"properties": {"name": "wide", "radius_m": 60_000}},
        square_at("antipode", -46.0, -171.0),
        # An inclusion of the whole country counts wherever it is.
        feature("Polygon", [[[5.0, 44.0], [11.0, 44.0], [11.0, 48.0], [5.0, 48.0]]], kind="inclusion", name="town"),
    ]
    (tmp_path / "all.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": country}))
    file = tmp_path / "small.toml"
    file.write_text(f'zones_file = "all.geojson"\n{SMALL}', encoding="utf-8")
    scenario = load_scenario(str(file))
    # The edge of "wide" is 17 km from the origin, its centre 77 km.
    assert [zone.name for zone in scenario.zones] == ["near", "wide", "town"]
    assert scenario.notes[0].endswith("3 of 6 zones lie more than 20 km from the area and are ignored")
    # A log of it is as large as what is near.
    assert len(scenario.to_json()["zones"]) == 3
    assert scenario_from_spec(scenario.to_json(), "a log").notes == scenario.notes


def test_an_inclusion_counts_however_far_it_is(tmp_path: Path) -> None:
    away = square_at("away", 46.4, 8.0, kind="inclusion")
    (tmp_path / "away.geojson").write_text(json.dumps(away), encoding="utf-8")
    (tmp_path / "small.toml").write_text(f'zones_file = "away.geojson"\n{SMALL}', encoding="utf-8")
    with pytest.raises(ScenarioError, match="start lies outside this inclusion zone"):
        load_scenario(str(tmp_path / "small.toml"))


def test_a_fence_of_openair_beside_a_scenario(tmp_path: Path) -> None:
    path = tmp_path / "fence.txt"
    ring = "AC D\nAN CTR\nAL GND\nAH 2200ft AMSL\nV X=46:01:00N 008:00:00E\nDC 0.1\n"
    path.write_text(f"{ring}AC G\nAN F\nDP 46:00:00N", encoding="utf-8")
    with pytest.raises(ScenarioError, match=f"^{path}: line 9: DP"):
        read_named_fences([str(path)])
    text = path.read_text(encoding="utf-8").replace("DP 46:00:00N", "V X=46:01:00N 008:00:00E\nDC 1")
    path.write_text(text, encoding="utf-8")
    (tmp_path / "small.toml").write_text(SMALL, encoding="utf-8")
    scenario = read_named_fences([str(path)]).add_to_scenario(load_scenario(str(tmp_path / "small.toml")))
    assert [zone.name for zone in scenario.zones] == ["CTR (D)"]
    assert scenario.notes == (f"{path}: 1 zone restricts no flight: class G, open to all",)


def test_a_large_geojson_file_takes_at_most_eight_times_its_size(tmp_path: Path) -> None:
    """Traced memory: 6.9 times its size, and 10.3 times if the text and the features read are not released."""
    ring = [[-84.0 + 1e-4 * k, 36.0 + 1e-8 * k * k] for k in range(400)]
    ring.append(ring[0])
    feature = {"type": "Feature", "properties": {"name": "Z"}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
    file = tmp_path / "large.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": [feature] * 100}), encoding="utf-8")
    tracemalloc.start()
    zones = read_zone_file(file, "large").zones
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(zones) == 100
    assert peak < 8.0 * file.stat().st_size
