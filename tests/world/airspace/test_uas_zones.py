"""UAS geographical zones of authorities, in the forms of ED-269 and ED-318, made here as the standards have them."""

import json
from pathlib import Path
from typing import Any

import pytest
import shapely

from world.airspace.zone_files import FileZones, geojson_zones, read_zone_file
from world.errors import ScenarioError

RING = [[8.0, 46.0], [8.1, 46.0], [8.1, 46.1], [8.0, 46.0]]
OUTLINE = [[46.0, 8.0], [46.0, 8.1], [46.1, 8.1], [46.0, 8.0]]
POLYGON = {"type": "Polygon", "coordinates": [RING]}
WGS84 = "WGS84"
CIRCLE = {"type": "Circle", "center": [8.0, 46.0], "radius": 3000}


def volume(shape: Any = POLYGON, low: Any = 0, high: Any = 120, unit: str = "M", **more: Any) -> dict[str, Any]:
    references = {"lowerVerticalReference": "AGL", "upperVerticalReference": "AGL"}
    return (
        {"uomDimensions": unit, "lowerLimit": low, "upperLimit": high, "horizontalProjection": shape}
        | references
        | more
    )


def ed269(*volumes: Any, key: str = "features", **more: Any) -> dict[str, Any]:
    zone = {"identifier": "LS001", "name": "lake", "type": "COMMON", "restriction": "PROHIBITED", "geometry": volumes}
    return {"title": "zones", key: [zone | {"applicability": [{"permanent": "YES"}]} | more]}


def ed318(geometry: Any, **more: Any) -> dict[str, Any]:
    names = [{"text": "See", "lang": "de-CH"}, {"text": "lake", "lang": "en-GB"}]
    stated = {"identifier": "LS001", "name": names, "type": "PROHIBITED", "variant": "COMMON"} | more
    return {"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": geometry, "properties": stated}]}


def layer(low: float, high: float, datum: str = "AGL", unit: str = "m") -> dict[str, Any]:
    return {"lower": low, "upper": high, "lowerReference": datum, "upperReference": datum, "uom": unit}


def read(data: Any, tmp_path: Path) -> FileZones:
    (tmp_path / "z.json").write_text(json.dumps(data), encoding="utf-8")
    return read_zone_file(tmp_path / "z.json", "z.json")


def limits_of(zone: Any) -> dict[str, float]:
    return {key: value for key, value in zone.model_dump().items() if key[:4] in ("floo", "ceil") and value is not None}


@pytest.mark.parametrize("key", ["features", "UASZoneList"])
def test_a_polygon_and_a_circle_of_ed_269(key: str, tmp_path: Path) -> None:
    one, two = read(ed269(volume(), volume(CIRCLE, 50, 400, "FT"), key=key), tmp_path).zones
    assert (one.name, one.kind, one.rings_deg, one.times) == ("lake 1/2", "exclusion", [OUTLINE], None)
    assert limits_of(one) == {"ceiling_agl_m": 120.0}
    assert (two.name, two.lat_deg, two.lon_deg, two.radius_m) == ("lake 2/2", 46.0, 8.0, 3000.0)
    assert limits_of(two) == pytest.approx({"floor_agl_m": 15.24, "ceiling_agl_m": 121.92})


@pytest.mark.parametrize(
    ("limits", "wanted"),
    [
        ({"lowerLimit": "0", "upperLimit": None}, {}),
        ({"upperLimit": 99999}, {}),
        ({"upperLimit": 6259, "upperVerticalReference": "AMSL"}, {"ceiling_amsl_m": 6259.0}),
        # The sea lies between 107 m below and 86 m above the ellipsoid.
        (
            {
                "lowerLimit": 500,
                "lowerVerticalReference": "WGS84",
                "upperLimit": 900,
                "upperVerticalReference": "WGS84",
            },
            {"floor_amsl_m": 414.0, "ceiling_amsl_m": 1007.0},
        ),
    ],
)
def test_limits_of_ed_269(limits: dict[str, Any], wanted: dict[str, float], tmp_path: Path) -> None:
    (zone,) = read(ed269(volume(**limits)), tmp_path).zones
    assert limits_of(zone) == wanted


def test_a_zone_without_a_restriction_keeps_nobody_out(tmp_path: Path) -> None:
    for data in (ed269(volume(), restriction="NO_RESTRICTION"), ed318(POLYGON, type="NO_RESTRICTION")):
        found = read(data, tmp_path)
        assert (found.zones, found.notes) == ([], ["z.json: 1 zone restricts no flight: NO_RESTRICTION"])
    for restriction in ("REQ_AUTHORISATION", "CONDITIONAL", "PROHIBITED"):
        assert len(read(ed269(volume(), restriction=restriction), tmp_path).zones) == 1


# What follows in its zones begins with this.
MAY = "2026-05-01T00:00Z/.."


def daily(days: list[str], **hours: str) -> list[dict[str, Any]]:
    return [{"startDateTime": "2026-05-01T00:00:00Z", "permanent": "NO", "schedule": [{"day": days, **hours}]}]


@pytest.mark.parametrize(
    ("applicability", "wanted"),
    [
        ([{"permanent": "YES", "startDateTime": "2026-01-01T00:00:00Z"}], None),
        ([{"startDateTime": "2026-05-01T02:00:00+02:00", "endDateTime": None}], ["2026-05-01T00:00Z/.."]),
        # Of any zone of time: from 14 hours before to 12 hours after.
        (
            [{"startDateTime": "2026-05-01T14:00:00", "endDateTime": "2026-05-02T12:00:00"}],
            ["2026-05-01T00:00Z/2026-05-03T00:00Z"],
        ),
        (
            daily(["SAT", "SUN"], startTime="17:00:00.00Z", endTime="23:59:59.00Z"),
            ["2026-05-01T00:00Z/.. SAT,SUN 17:00/24:00"],
        ),
        # One in the morning in Zurich's summer is the day before in UTC.
        (
            daily(["MON"], startTime="01:00:00+02:00", endTime="05:00:00+02:00"),
            [f"{MAY} SUN 23:00/03:00"],
        ),
        (
            daily(["MON"], startTime="23:00:00+02:00", endTime="01:00:00+02:00"),
            [f"{MAY} MON 21:00/23:00"],
        ),
        (daily(["ANY"], startTime="08:00:00Z", endTime="18:00:00Z"), ["2026-05-01T00:00Z/.. 08:00/18:00"]),
        # By the sun, and by a clock that is not named: the whole day, and of the latter the days beside it.
        (daily(["MON"], startEvent="SR", endEvent="SS"), ["2026-05-01T00:00Z/.. MON"]),
        (daily(["MON"], startTime="08:00:00", endTime="18:00:00"), ["2026-05-01T00:00Z/.. MON,TUE,SUN"]),
    ],
)
def test_times_of_activity(applicability: list[Any], wanted: list[str] | None, tmp_path: Path) -> None:
    (zone,) = read(ed269(volume(), applicability=applicability), tmp_path).zones
    assert zone.times == wanted
    (zone,) = read(ed318(POLYGON, limitedApplicability=applicability), tmp_path).zones
    assert zone.times == wanted


def test_geometries_and_layers_of_ed_318(tmp_path: Path) -> None:
    circle = {"type": "Point", "coordinates": [8.0, 46.0], "extent": {"subType": "Circle", "radius": 3500}}
    inner = [
        POLYGON | {"layer": layer(50, 150)},
        circle | {"layer": layer(0, 500, "AMSL", "ft")},
        {"type": "MultiPolygon", "coordinates": [[RING], [[[9.0, 46.0], [9.1, 46.0], [9.1, 46.1], [9.0, 46.0]]]]},
    ]
    found = read(ed318({"type": "GeometryCollection", "geometries": inner}), tmp_path).zones
    assert [zone.name for zone in found] == ["lake 1/3", "lake 2/3", "lake 3/3", "lake 3/3"]
    assert [limits_of(zone) for zone in found] == [
        {"floor_agl_m": 50.0, "ceiling_agl_m": 150.0},
        {"floor_amsl_m": 0.0, "ceiling_amsl_m": 152.4},
        {},
        {},
    ]
    assert (found[1].lat_deg, found[1].radius_m) == (46.0, 3500.0)
    assert [len(zone.rings_deg or []) for zone in found] == [1, 0, 1, 1]


FAULTS: dict[str, tuple[Any, str]] = {
    "no volume": (ed269(), "features[0]: geometry: expected a list of volumes"),
    "a number": (ed269(5), "features[0] (lake): horizontalProjection: expected a polygon or a circle"),
    "no shape": (ed269(volume(None)), "features[0] (lake): horizontalProjection: expected a polygon or a circle"),
    "a line": (
        ed269(volume({"type": "Line"})),
        "features[0] (lake): horizontalProjection.type: allowed",
    ),
    "no radius": (
        ed269(volume({"type": "Circle", "center": [8, 46]})),
        "features[0] (lake): circle: expected a centre",
    ),
    "a unit": (ed269(volume(unit="FL")), "features[0] (lake): unit of its limits: allowed M, FT"),
    "a height": (ed269(volume(high="high")), "features[0] (lake): upper limit: expected a number"),
    "a datum": (
        ed269(volume(upperVerticalReference="QFE")),
        "features[0] (lake): vertical reference of its upper",
    ),
    "a corner": (
        ed269(volume({"type": "Polygon", "coordinates": [[[8.0]]]})),
        "features[0] (lake): coordinates: expected lists",
    ),
    "no ring": (
        ed269(volume({"type": "Polygon", "coordinates": []})),
        "features[0] (lake): coordinates: expected at least one",
    ),
    "a day": (
        ed269(volume(), applicability=daily(["LUN"])),
        "features[0] (lake): applicability: expected dates and times",
    ),
    "a date": (
        ed269(volume(), applicability=[{"startDateTime": "May"}]),
        "features[0] (lake): applicability: expected dates",
    ),
    "a text": (
        ed269(volume(), applicability="always"),
        "features[0] (lake): applicability: expected a list of periods",
    ),
    "NaN": (ed269(volume({"type": "Polygon", "coordinates": [[[1e999, 46.0], *RING]]})), "not valid JSON"),
    "no geometry": (ed318(None), "features[0] (lake): geometry.type: allowed Polygon, MultiPolygon, Point"),
    "a point": (ed318({"type": "Point", "coordinates": [8, 46]}), "features[0] (lake): geometry.extent: a point is"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_what_is_no_zone_is_a_line(case: str, tmp_path: Path) -> None:
    data, wanted = FAULTS[case]
    with pytest.raises(ScenarioError) as caught:
        read(data, tmp_path)
    assert str(caught.value).startswith(f"z.json: {wanted}")
    assert str(caught.value).isprintable()


ANYTIME = {"startDateTime": "", "endDateTime": ""}
ANY_DAY = {"day": "ANY", "startTime": "", "startEvent": "", "endTime": "", "endEvent": ""}
IN_MAY = {"startDateTime": "2026-05-01T00:00:00Z", "endDateTime": "2026-06-01T00:00:00Z"}


def spanish(form: str, applies: dict[str, str], daily: dict[str, str]) -> dict[str, Any]:
    """A feature as Spain has it: with tables of its own, or all among its properties."""
    zone = {"identifier": "LEBZ45", "name": "", "type": "REQ_AUTHORIZATION", "variant": "COMMON", "reasons": "OTHER"}
    limits = {"upper": 900, "upperReference": "AGL", "lower": 45, "lowerReference": "AGL"}
    tables = {
        "UASZone": zone,
        "verticalLayer": limits | {"UOM": "M"},
        "limitedApplicability": [{**applies, "schedule": [daily]}],
    }
    flat = zone | limits | {"uom": "M"} | applies | daily
    return {"type": "Feature", "geometry": POLYGON, "properties": tables if form == "tables" else flat}


@pytest.mark.parametrize("form", ["tables", "flat"])
def test_zones_as_spain_publishes_them(form: str, tmp_path: Path) -> None:
    """In a collection and alone; limits and times do not stand where ED-318 has them."""
    feature = spanish(form, ANYTIME, ANY_DAY)
    for data in (feature, {"type": "FeatureCollection", "features": [feature]}):
        (zone,) = read(data, tmp_path).zones
        assert (zone.name, zone.kind, zone.rings_deg, zone.times) == ("LEBZ45", "exclusion", [OUTLINE], None)
        assert limits_of(zone) == {"floor_agl_m": 45.0, "ceiling_agl_m": 900.0}
    (zone,) = read(spanish(form, IN_MAY, ANY_DAY | {"day": "SAT"}), tmp_path).zones
    assert zone.times == ["2026-05-01T00:00Z/2026-06-01T00:00Z SAT"]
    free = spanish(form, ANYTIME, ANY_DAY)
    (free["properties"]["UASZone"] if form == "tables" else free["properties"])["type"] = "NO_RESTRICTION"
    assert read(free, tmp_path).zones == []


def test_other_geojson_with_a_type_of_its_own_stays_what_it_was() -> None:
    feature = {
        "type": "Feature",
        "geometry": POLYGON,
        "properties": {"type": "park", "name": "lake", "ceiling_agl_m": 90},
    }
    ((where, entries),) = geojson_zones(json.dumps(feature), "z.json")
    assert where == "feature (lake)"
    assert isinstance(entries, dict)
    assert entries["ceiling_agl_m"] == 90


def test_limits_the_wrong_way_round_are_swapped_and_said(tmp_path: Path) -> None:
    found = read(ed269(volume(CIRCLE, 120, 50), volume(low=10)), tmp_path)
    assert [limits_of(zone) for zone in found.zones] == [
        {"floor_agl_m": 50.0, "ceiling_agl_m": 120.0},
        {"floor_agl_m": 10.0, "ceiling_agl_m": 120.0},
    ]
    assert found.notes == ["z.json: lower and upper limits in the wrong order are swapped: lake 1/2"]


@pytest.mark.parametrize(
    ("low", "high", "datum", "wanted"),
    [
        (0, 0, "AGL", {}),
        (0, 0, "AMSL", {}),
        (-10, 0, "AMSL", {}),
        # An upper limit that there is not, or 0 to 150 m the wrong way round: neither side may be opened.
        (150, 0, "AGL", {}),
        (150, 150, "AGL", {"floor_agl_m": 150.0}),
        (150, 150, "AMSL", {"floor_amsl_m": 150.0}),
    ],
)
def test_limits_that_leave_no_height_lose_the_upper_one(
    low: float, high: float, datum: str, wanted: dict[str, float], tmp_path: Path
) -> None:
    references = {"lowerVerticalReference": datum, "upperVerticalReference": datum}
    said = ["z.json: upper limits of 0, or equal to the lower one, mean no ceiling: lake"]
    for data in (
        ed269(volume(low=low, high=high, **references)),
        ed318(POLYGON | {"layer": layer(low, high, datum)}),
    ):
        found = read(data, tmp_path)
        assert [limits_of(zone) for zone in found.zones] == [wanted]
        assert found.notes == said
    # A metre of height is one.
    assert read(ed269(volume(low=low, high=max(low, 0) + 1, **references)), tmp_path).notes == []


@pytest.mark.parametrize("limit", ["nan", "-inf"])
def test_a_limit_that_is_no_number_is_refused(limit: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="expected a number"):
        read(ed269(volume(high=limit)), tmp_path)


SQUARES = {
    # Beside the square from 46.0, 8.0 to 46.1, 8.1: the corner and the size of another, and the area of both.
    "sharing a corner": ((46.1, 8.1), 0.1, 0.02),
    "sharing an edge": ((46.0, 8.1), 0.1, 0.02),
    "overlapping": ((46.05, 8.05), 0.1, 0.0175),
    "apart": ((46.3, 8.3), 0.1, 0.02),
    "the same twice": ((46.0, 8.0), 0.1, 0.01),
    "around it": ((45.9, 7.9), 0.3, 0.08),
    "inside, along an edge": ((46.02, 8.0), 0.05, 0.0075),
}


def square(lat: float, lon: float, side: float) -> list[list[float]]:
    """Corners as [longitude, latitude], the first again at the end."""
    return [[lon + side * x, lat + side * y] for x, y in ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))]


@pytest.mark.parametrize("case", SQUARES)
def test_a_second_ring_that_is_no_hole_is_a_part_of_the_area(case: str, tmp_path: Path) -> None:
    """Areas in square degrees, by hand; the rings are laid over each other by shapely."""
    corner, side, area = SQUARES[case]
    rings = [square(46.0, 8.0, 0.1), square(*corner, side)]
    found = read(ed269(volume({"type": "Polygon", "coordinates": rings})), tmp_path)
    (zone,) = found.zones
    made = shapely.Polygon()
    for ring in zone.rings_deg or []:
        made = made.symmetric_difference(shapely.Polygon(ring))
    assert made.area == pytest.approx(area, rel=1e-3)
    assert found.notes == ["z.json: an outline that crosses itself is taken as the area it encloses: lake"]


def test_holes_of_a_mended_outline_stay_holes_and_islands_in_them_stay_land(tmp_path: Path) -> None:
    """100 less 36 more 4 hundredths of a square degree, beside a square of 4; a hole that crosses itself is one too."""
    rings = [square(46, 8, 1.0), square(46.2, 8.2, 0.6), square(46.4, 8.4, 0.2), square(47.0, 9.0, 0.2)]
    (zone,) = read(ed269(volume({"type": "Polygon", "coordinates": rings})), tmp_path).zones
    made = shapely.Polygon()
    for ring in zone.rings_deg or []:
        made = made.symmetric_difference(shapely.Polygon(ring))
    assert made.area == pytest.approx(1.0 - 0.36 + 0.04 + 0.04, rel=1e-3)
    # A bow tie in the square: two triangles of 0.6 by 0.3.
    bow = [[8.2, 46.2], [8.8, 46.8], [8.8, 46.2], [8.2, 46.8], [8.2, 46.2]]
    (zone,) = read(ed269(volume({"type": "Polygon", "coordinates": [rings[0], bow]})), tmp_path).zones
    outline, *holes = sorted((shapely.Polygon(ring) for ring in zone.rings_deg or []), key=lambda one: -one.area)
    assert outline.area - sum(hole.area for hole in holes) == pytest.approx(1.0 - 0.18, rel=1e-3)
