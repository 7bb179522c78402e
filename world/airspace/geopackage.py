"""Zones of a GeoPackage (OGC 12-128r19): the polygons and points of its feature tables, with their columns."""

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

# Bytes of the envelope by its code in the flags of a geometry's header (clause 2.1.3.1.1).
_ENVELOPES = {0: 0, 1: 32, 2: 48, 3: 48, 4: 64}
_DEGREES = 4326


def geopackage_features(path: Path, source: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Where each feature stands, and the feature as GeoJSON has it: in longitude and latitude, with its columns.

    Raises ScenarioError for a file that cannot be read as a GeoPackage, and for a geometry that is none.
    """
    try:
        # Neither locked nor written to, whatever else has it open.
        uri = f"file:{quote(str(path.resolve()))}?mode=ro&immutable=1"
        with closing(sqlite3.connect(uri, uri=True)) as database:
            tables = database.execute(
                "select c.table_name, g.column_name, g.srs_id from gpkg_contents c"
                " join gpkg_geometry_columns g on g.table_name = c.table_name where c.data_type = 'features'"
            ).fetchall()
            for table, column, system in tables:
                quoted = '"' + str(table).replace('"', '""') + '"'
                cursor = database.execute(f"select * from {quoted}")  # a name of the file's own, quoted
                names = [one[0] for one in cursor.description]
                code = _code_of(database, system)
                for number, row in enumerate(cursor, 1):
                    where = f"{table} row {number}"
                    columns = dict(zip(names, row, strict=True))
                    shape = _shape(columns.pop(column, None), code, f"{source}: {where}")
                    yield where, {"type": "Feature", "properties": _plain(columns), "geometry": shape}
    except sqlite3.Error as error:
        raise ScenarioError(f"{source}: cannot be read as a GeoPackage: {error}", file=source) from error


def _code_of(database: sqlite3.Connection, system: int) -> str:
    """The coordinate reference system of a table, as PROJ names it; "" for longitude and latitude on WGS84."""
    found = database.execute(
        "select organization, organization_coordsys_id, definition from gpkg_spatial_ref_sys where srs_id = ?", [system]
    ).fetchone()
    if found is None or str(found[0]).upper() in ("NONE", ""):
        return ""
    organization, number, definition = found
    if str(organization).upper() == "EPSG":
        return "" if number == _DEGREES else f"EPSG:{number}"
    return str(definition)


def _plain(columns: dict[str, Any]) -> dict[str, Any]:
    """Columns that a zone can state something with, by the names that the other formats have."""
    kept = {key: value for key, value in columns.items() if isinstance(value, str | int | float)}
    name = next((value for key, value in kept.items() if key.lower() in ("name", "identifier", "title")), None)
    return kept if name is None else kept | {"name": str(name)}


def _shape(blob: Any, code: str, source: str) -> dict[str, Any]:
    allowed = "a polygon, a multipolygon or a point is expected"
    try:
        if blob[:2] != b"GP":
            raise ValueError
        flags = blob[3]
        shape = shapely.from_wkb(blob[8 + _ENVELOPES[(flags >> 1) & 7] :])
    except (KeyError, IndexError, TypeError, ValueError, ShapelyError) as error:
        raise ScenarioError(f"{source}: geometry: {allowed}", file=source, field="geometry") from error
    if code:
        try:
            transformer = crs_transformer(code)
        except ValueError as error:
            raise ScenarioError(f"{source}: coordinate system: {error}", file=source) from error
        to_degrees = partial(transformer.transform, direction="INVERSE")
        shape = shapely.transform(shape, lambda xy: np.column_stack(transform_points(to_degrees, xy[:, 0], xy[:, 1])))
    found: dict[str, Any] = shapely.geometry.mapping(shape)
    return _listed(found)


def _listed(found: dict[str, Any]) -> dict[str, Any]:
    """A mapping of shapely's with lists in the place of tuples, as JSON has them."""

    def lists(value: Any) -> Any:
        return [lists(one) for one in value] if isinstance(value, tuple | list) else value

    return {"type": found["type"], "coordinates": lists(found.get("coordinates", []))}
