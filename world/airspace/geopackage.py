"""Read the features of a GeoPackage (OGC 12-128r19).

Features are polygons and points of its tables, with their columns.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import shapely
from shapely.errors import ShapelyError

from world.errors import ScenarioError
from world.frames import crs_transformer, transform_points

# Size of the envelope, bytes, by its code in the flags of a geometry's header (clause 2.1.3.1.1).
_ENVELOPE_BYTES = {0: 0, 1: 32, 2: 48, 3: 48, 4: 64}
# EPSG code of longitude and latitude on WGS84.
_WGS84_CODE = 4326


def geopackage_features(path: Path, source: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield (location, feature) for each feature of a file, as GeoJSON in longitude and latitude.

    The location is the table and the row, for messages.

    Raises ScenarioError for a file that cannot be read as a GeoPackage, and for an invalid geometry.
    """
    try:
        # Read-only and immutable: the file is neither locked nor written, even if another program has it open.
        uri = f"file:{quote(str(path.resolve()))}?mode=ro&immutable=1"
        with closing(sqlite3.connect(uri, uri=True)) as database:
            tables = database.execute(
                "select c.table_name, g.column_name, g.srs_id from gpkg_contents c"
                " join gpkg_geometry_columns g on g.table_name = c.table_name where c.data_type = 'features'"
            ).fetchall()
            for table, column, system in tables:
                quoted = '"' + str(table).replace('"', '""') + '"'
                cursor = database.execute(f"select * from {quoted}")  # a table name from the file, quoted
                names = [entry[0] for entry in cursor.description]
                code = _crs_definition(database, system)
                for number, row in enumerate(cursor, 1):
                    location = f"{table} row {number}"
                    columns = dict(zip(names, row, strict=True))
                    shape = _decode_geometry(columns.pop(column, None), code, f"{source}: {location}")
                    # Only text and numbers; a column "identifier" or "title" is also added under the key
                    # "name".
                    plain = {key: value for key, value in columns.items() if isinstance(value, str | int | float)}
                    name = next(
                        (value for key, value in plain.items() if key.lower() in ("name", "identifier", "title")), None
                    )
                    yield (
                        location,
                        {
                            "type": "Feature",
                            "properties": plain if name is None else plain | {"name": str(name)},
                            "geometry": shape,
                        },
                    )
    except sqlite3.Error as error:
        raise ScenarioError(f"{source}: cannot be read as a GeoPackage: {error}", file=source) from error


def _crs_definition(database: sqlite3.Connection, system: int) -> str:
    """Return the coordinate reference system of a table as a text that PROJ reads; "" for WGS84 degrees.

    system: number of the reference system in the file. An unknown or undefined system is taken as WGS84 degrees.
    """
    system_row = database.execute(
        "select organization, organization_coordsys_id, definition from gpkg_spatial_ref_sys where srs_id = ?", [system]
    ).fetchone()
    if system_row is None or str(system_row[0]).upper() in ("NONE", ""):
        return ""
    organization, number, definition = system_row
    if str(organization).upper() == "EPSG":
        return "" if number == _WGS84_CODE else f"EPSG:{number}"
    return str(definition)


def _decode_geometry(blob: Any, code: str, source: str) -> dict[str, Any]:
    """Convert a GeoPackage geometry to GeoJSON in longitude and latitude.

    code: coordinate reference system as `_crs_definition` returns it.

    Raises ScenarioError if the geometry is invalid.
    """
    allowed = "expected a polygon, a multipolygon or a point"
    try:
        if blob[:2] != b"GP":
            raise ValueError
        flags = blob[3]
        shape = shapely.from_wkb(blob[8 + _ENVELOPE_BYTES[(flags >> 1) & 7] :])
    except (KeyError, IndexError, TypeError, ValueError, ShapelyError) as error:
        raise ScenarioError(f"{source}: geometry: {allowed}", file=source, field="geometry") from error
    if code:
        try:
            transformer = crs_transformer(code)
        except ValueError as error:
            raise ScenarioError(f"{source}: coordinate system: {error}", file=source) from error
        to_degrees = partial(transformer.transform, direction="INVERSE")
        shape = shapely.transform(shape, lambda xy: np.column_stack(transform_points(to_degrees, xy[:, 0], xy[:, 1])))
    geometry: dict[str, Any] = shapely.geometry.mapping(shape)

    def to_lists(value: Any) -> Any:
        """Return a value in which all tuples, at any depth, are lists."""
        return [to_lists(element) for element in value] if isinstance(value, tuple | list) else value

    return {"type": geometry["type"], "coordinates": to_lists(geometry.get("coordinates", []))}
