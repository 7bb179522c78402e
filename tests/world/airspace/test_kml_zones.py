"""KML: polygons as Google Earth writes them, points with a radius, and what is no zone, in one line."""

import pytest

from world.airspace.kml_zones import kml_zones
from world.errors import ScenarioError

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


FAULTS = {
    "not XML": ("<kml>", "not valid XML"),
    "no KML": ("<gpx/>", "a <kml> element is expected"),
    "an entity": (
        '<!DOCTYPE kml [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><kml>&b;</kml>',
        "a document type is declared: not allowed",
    ),
    "a line": (document(placemark("<LineString/>", "road")), "Placemark 1 (road): a Polygon is expected"),
    "a point alone": (document(placemark("<Point><coordinates>8,46</coordinates></Point>")), "a Polygon is expected"),
    "a sheet in the air": (
        document(placemark(polygon(mode=ABSOLUTE, up=300.0))),
        "altitudeMode absolute without extrude: a sheet in the air holds no airspace",
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
    "a number that is none": (document(placemark(polygon() + data(floor_agl_m="low"))), "floor_agl_m: 'low': a number"),
    "a key misspelt": (document(placemark(polygon() + data(ceiling="90"))), "ceiling: unknown; known are kind"),
    "coordinates of text": (
        document(placemark(polygon().replace("8.000,46.000,0", "8,north"))),
        "coordinates '8,north': lon,lat or lon,lat,up is expected",
    ),
}


@pytest.mark.parametrize("case", FAULTS)
def test_what_is_no_zone(case: str) -> None:
    text, wanted = FAULTS[case]
    with pytest.raises(ScenarioError) as caught:
        list(kml_zones(text, "z.kml"))
    message = str(caught.value)
    assert message.startswith("z.kml: ")
    assert message.isprintable()
    assert wanted in message
