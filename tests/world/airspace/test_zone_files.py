"""Files of zones named by a scenario: read beside it, written down with it, refused by their names."""

import json
from pathlib import Path

import pytest

from tests.world.made.made_scenario import SMALL
from world.airspace.zone_files import MOST_BYTES
from world.airspace.zones import Cylinder, Polygon
from world.errors import PlanflyError
from world.scenario import Scenario, from_spec, load_scenario

# Near 46 N 8 E, where the small scenario's map has its origin.
RING = [[8.0, 46.01], [8.01, 46.01], [8.01, 46.02], [8.0, 46.01]]
LAKE = {
    "type": "Feature",
    "properties": {"name": "lake", "ceiling_agl_m": 90.0},
    "geometry": {"type": "Polygon", "coordinates": [RING]},
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
    again = from_spec(written, "a log")
    assert again.zones == scenario.zones
    assert again.to_json() == written


FAULTS = {
    "missing.geojson": (None, "no such file"),
    "zones.kmz": (b"PK", "suffix '.kmz': a file of zones is .geojson, .json or .kml"),
    "empty.geojson": (b"", "not valid JSON"),
    "none.geojson": (b'{"type": "FeatureCollection", "features": []}', "there is no zone in it"),
    "none.kml": (b"<kml/>", "there is no zone in it"),
    "latin.geojson": (b'{"type": "\xe9"}', "not a text file in UTF-8 (byte 10)"),
    "large.kml": (b" " * (MOST_BYTES + 1), "16,777,217 bytes: a file of zones has at most 16,777,216"),
    "pole.geojson": (
        json.dumps(LAKE).replace("46.02", "89.5").encode(),
        "feature (lake): rings_deg.0.2: latitude 89.5: allowed -89..89",
    ),
    "kind.geojson": (
        json.dumps(LAKE).replace('"name"', '"kind": "prohibited", "name"').encode(),
        'feature (lake): kind: "prohibited"',
    ),
    "name.geojson": (json.dumps(LAKE).replace('"lake"', "7").encode(), "feature: name: 7: Input should be a valid str"),
    "band.geojson": (
        json.dumps(LAKE).replace('"name"', '"floor_agl_m": 90, "name"').encode(),
        "feature (lake): file: ceiling_agl_m: 90: must be above floor_agl_m 90",
    ),
    "bow.geojson": (
        json.dumps(LAKE).replace("[8.01, 46.01], [8.01, 46.02]", "[8.01, 46.02], [8.01, 46.01], [8.0, 46.02]").encode(),
        "zones[0] (lake): crosses or touches itself",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_bad_file_is_refused_by_its_name(name: str, tmp_path: Path) -> None:
    content, wanted = FAULTS[name]
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(PlanflyError) as caught:
        scenario_with(tmp_path, f'"{name}"')
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'small.toml'}: ")
    assert message.isprintable()
    assert wanted in message
