"""GeoPackages as OGC 12-128r19 lays them out: made here with the standard's tables, and damaged."""

import sqlite3
import struct
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
import shapely

from world.airspace.zone_files import read_zone_file
from world.errors import ScenarioError

SQUARE = shapely.Polygon([(8.0, 46.0), (8.1, 46.0), (8.1, 46.1), (8.0, 46.1)])


def blob(shape: Any, envelope: int = 0, system: int = 4326) -> bytes:
    """A geometry as clause 2.1.3 has it, little-endian, with an envelope of this code."""
    size = {0: 0, 1: 4, 2: 6, 3: 6, 4: 8}[envelope]
    return (
        b"GP"
        + bytes([0, 1 | envelope << 1])
        + struct.pack("<i", system)
        + struct.pack(f"<{size}d", *[0.0] * size)
        + shape.wkb
    )


def package(path: Path, rows: list[tuple[Any, ...]], system: int = 4326, code: int | None = None) -> Path:
    with closing(sqlite3.connect(path)) as database:
        database.executescript(
            "create table gpkg_contents (table_name text, data_type text);"
            "create table gpkg_geometry_columns (table_name text, column_name text, srs_id integer);"
            "create table gpkg_spatial_ref_sys (srs_id integer, organization text, organization_coordsys_id integer,"
            " definition text);"
            "insert into gpkg_contents values ('my zones', 'features'), ('pictures', 'tiles');"
            'create table "my zones" (fid integer, geom blob, Name text, kind text, ceiling_agl_m real, radius_m real);'
        )
        database.execute("insert into gpkg_geometry_columns values ('my zones', 'geom', ?)", [system])
        database.execute("insert into gpkg_spatial_ref_sys values (?, 'EPSG', ?, '')", [system, code or system])
        database.executemany('insert into "my zones" values (?, ?, ?, ?, ?, ?)', rows)
        database.commit()
    return path


def test_polygons_and_points_with_their_columns(tmp_path: Path) -> None:
    rows = [
        (1, blob(SQUARE), "lake", "inclusion", 120.0, None),
        (2, blob(shapely.MultiPolygon([SQUARE]), 4), None, None, None, None),
        (3, blob(shapely.Point(8.0, 46.0), 1), "mast", "exclusion", None, 80.0),
    ]
    path = package(tmp_path / "z.gpkg", rows)
    before = path.read_bytes()
    lake, second, mast = read_zone_file(path, "z.gpkg").zones
    assert (lake.name, lake.kind, lake.ceiling_agl_m) == ("lake", "inclusion", 120.0)
    assert lake.rings_deg == [[[46.0, 8.0], [46.0, 8.1], [46.1, 8.1], [46.1, 8.0], [46.0, 8.0]]]
    assert (second.name, second.kind, second.rings_deg) == ("zone 2", "exclusion", lake.rings_deg)
    assert (mast.lat_deg, mast.lon_deg, mast.radius_m) == (46.0, 8.0, 80.0)
    assert path.read_bytes() == before
    assert [one.name for one in tmp_path.iterdir()] == ["z.gpkg"]


def test_a_map_in_metres_is_put_into_degrees(tmp_path: Path) -> None:
    """UTM 32 N: its central meridian is 9 degrees east, where easting is 500 km, and the equator is at 0 m."""
    shape = shapely.Polygon([(500_000.0, 0.0), (600_000.0, 0.0), (500_000.0, 1000.0)])
    (zone,) = read_zone_file(package(tmp_path / "z.gpkg", [(1, blob(shape), "a", None, None, None)], 32632), "z").zones
    assert zone.rings_deg is not None
    assert zone.rings_deg[0][0] == pytest.approx([0.0, 9.0], abs=1e-9)
    # 100 km on the map are some 0.9 degrees of longitude at the equator, 1 / 0.9996 of it on the ground.
    assert zone.rings_deg[0][1] == pytest.approx([0.0, 9.0 + 100.0 / 0.9996 / 111.3195], abs=1e-4)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"not a database, but as long as one " * 10, "z.gpkg: cannot be read as a GeoPackage: file is not a database"),
        (b"", "z.gpkg: cannot be read as a GeoPackage: no such table: gpkg_contents"),
        (None, "z.gpkg: no such file"),
    ],
)
def test_what_is_no_geopackage(content: bytes | None, said: str, tmp_path: Path) -> None:
    if content is not None:
        (tmp_path / "z.gpkg").write_bytes(content)
    with pytest.raises(ScenarioError) as caught:
        read_zone_file(tmp_path / "z.gpkg", "z.gpkg")
    assert str(caught.value) == said


@pytest.mark.parametrize(
    "geometry",
    [
        None,
        b"",
        b"GP",
        b"XX" + blob(SQUARE)[2:],
        blob(SQUARE)[:20],
        blob(SQUARE).replace(b"\x03\x00\x00\x00", b"\x63\0\0\0", 1),
    ],
)
def test_a_geometry_that_is_none_is_named_by_its_row(geometry: bytes | None, tmp_path: Path) -> None:
    rows = [(1, blob(SQUARE), "lake", None, None, None), (2, geometry, "mast", None, None, None)]
    with pytest.raises(
        ScenarioError, match=r"^z.gpkg: my zones row 2: geometry: expected a polygon, a multipolygon or a point$"
    ):
        read_zone_file(package(tmp_path / "z.gpkg", rows), "z.gpkg")


def test_lines_are_no_zones(tmp_path: Path) -> None:
    path = package(tmp_path / "z.gpkg", [(1, blob(shapely.LineString([(8, 46), (9, 46)])), "way", None, None, None)])
    with pytest.raises(ScenarioError, match=r'z.gpkg: my zones row 1 \(way\): geometry "LineString"'):
        read_zone_file(path, "z.gpkg")
