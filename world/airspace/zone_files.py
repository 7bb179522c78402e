"""Files of zones, GeoJSON and KML, as the tables that a scenario file would have them in."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from world.airspace.geojson_zones import geojson_zones
from world.airspace.kml_zones import kml_zones
from world.airspace.zone_tables import MOST_ZONES, ZoneTable
from world.errors import ScenarioError
from world.scenario_file import checked_table

_READERS = {".geojson": geojson_zones, ".json": geojson_zones, ".kml": kml_zones}
SUFFIXES = tuple(_READERS)
# Bytes of a file at most.
MOST_BYTES = 16 * 2**20


def read_zone_files(files: str | Sequence[str], source: str, base: Path | None) -> list[ZoneTable]:
    """Read the zones of a scenario's files, one or several.

    source: names the scenario in messages.  base: folder that relative paths count from.  Raises ScenarioError as
    `read_zone_file` does, and for more zones than a scenario may have.
    """
    tables = []
    for file in [files] if isinstance(files, str) else files:
        tables += read_zone_file(Path(base or "", file), f"{source}: zones_file: {file}")
    if len(tables) > MOST_ZONES:
        raise ScenarioError(
            f"{source}: zones_file: {len(tables):,} zones in all: at most {MOST_ZONES:,}",
            file=source,
            field="zones_file",
        )
    return tables


def read_zone_file(path: Path, source: str) -> list[ZoneTable]:
    """Read the zones of a file, GeoJSON or KML by its suffix.

    source: names it in messages.  Raises ScenarioError for a file that cannot be read, and for a zone that is none.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "lake.geojson"
    ...     _ = path.write_text(
    ...         '{"type": "Polygon", "coordinates": [[[8, 46], [8.01, 46], [8.01, 46.01], [8, 46]]]}', encoding="ascii"
    ...     )
    ...     [(zone.name, zone.kind) for zone in read_zone_file(path, "a file")]
    [('zone 1', 'exclusion')]
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        allowed = "a file of zones is .geojson, .json or .kml"
        message = f"{source}: suffix {path.suffix!r}: {allowed}"
        raise ScenarioError(message, file=source, field="suffix", value=path.suffix, allowed=allowed)
    tables = []
    for where, entries in reader(_text(path, source), source):
        tables.append(_table(entries, f"{source}: {where}"))
    if not tables:
        raise ScenarioError(f"{source}: there is no zone in it", file=source)
    return tables


def _text(path: Path, source: str) -> str:
    try:
        if not path.is_file():
            raise ScenarioError(f"{source}: no such file", file=source)
        if path.stat().st_size > MOST_BYTES:
            raise ScenarioError(
                f"{source}: {path.stat().st_size:,} bytes: a file of zones has at most {MOST_BYTES:,}", file=source
            )
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ScenarioError(f"{source}: cannot be read: {error.strerror}", file=source) from error
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{source}: not a text file in UTF-8 (byte {error.start})", file=source) from error


def _table(entries: dict[str, Any], source: str) -> ZoneTable:
    return checked_table(lambda: ZoneTable.model_validate(entries), source)
