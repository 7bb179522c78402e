"""Convert a `FlightSetup` to attachments of a log (bytes by name), and back.

`setup.json` lists every other attachment with its SHA-256, so that a missing or altered attachment is noticed. Numbers
are written as Python's repr, which reads back to the same float; NaN and infinity as the strings "nan", "inf", "-inf".
"""

import contextlib
import functools
import hashlib
import json
import math
import platform
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import PurePath
from typing import Annotated, Any, Final, Literal

import numpy as np
import zstandard
from pydantic import ConfigDict, Field, ValidationError, field_validator

from flight.autopilots.autopilot import StoredAutopilot
from flight.autopilots.catalog import restore_autopilot, stored_name
from flight.mission_files.formats import mission_text
from flight.simulation.setup import FlightSetup, ImportedLog, make_limits
from logs.recording.setup_schema import (
    EnvelopeTable,
    Finite,
    MissionTable,
    ParametersTable,
    ProgramTable,
    RouteTable,
    SetupModel,
    parameters_table,
    read_parameters,
)
from planner.plan import Plan, parse_plan, plan_json
from world.errors import LogError, ParameterError, PlanflyError
from world.files import json_value
from world.forecast.forecast import ForecastFacts
from world.forecast.wind_field import MAX_FIELD_NUMBERS, WindField
from world.frames import MAX_TERMS, PolyMap
from world.raster import MAX_PIXELS
from world.scenario import scenario_from_spec
from world.scenario_file import JSON_OBJECT, first_fault
from world.scenario_tables import Guidance, Navigation
from world.terrain import Terrain
from world.wind import Wind

# ----------------------------------------------------------------------
# The attachments of a flight log: their names and media types.
#
# `setup.json` lists the attachments of the setup; results of reference flights, a verdict, a result and a recovery note
# are written after the flight.

SETUP_FILE: Final = "setup.json"
SCENARIO_FILE: Final = "scenario.json"
PLAN_FILE: Final = "plan.json"
MISSION_FILE: Final = "mission.waypoints"
TERRAIN_FILE: Final = "terrain.json"
FORECAST_FILE: Final = "forecast.json"
WIND_FILE: Final = "forecast.wind"
REFERENCE_FILE: Final = "beside.json"
VERDICT_FILE: Final = "verdict.json"
RESULT_FILE: Final = "result.json"
RECOVERY_FILE: Final = "recovery.json"

_MEDIA_TYPES: Final = {
    ".json": "application/json",
    ".waypoints": "text/plain",
    ".heights": "application/octet-stream",
    ".wind": "application/octet-stream",
}


def heights_name(part: int) -> str:
    """Return the attachment name of one part of the terrain's heights; parts are numbered from 0."""
    return f"terrain-{part:03d}.heights"


def media_type(name: str) -> str:
    """Return the media type that belongs to the suffix of an attachment's name."""
    return _MEDIA_TYPES[PurePath(name).suffix]


# ----------------------------------------------------------------------
# The terrain inside a log: exact heights with lossless compression, and their placement on the map.
#
# A height is stored as the difference between its float32 bits and the bits of its western neighbour.  The four bytes
# of the differences are stored in separate planes, compressed with zstd.

TERRAIN_SCHEMA = "planfly.terrain/1"
_ENCODING = "float32 bits, difference to the west modulo 2^32, byte planes (low first), zstd"
# Largest number of heights in one attachment.
_MAX_PART_HEIGHTS = 4 * 2**20


class _TerrainFile(SetupModel):
    """Content of `terrain.json`: size, source and position of the terrain, and its height parts."""

    model_config = ConfigDict(validate_by_name=True, validate_by_alias=True)
    file_schema: Annotated[str, Field(alias="schema", pattern=f"^{TERRAIN_SCHEMA}$")] = TERRAIN_SCHEMA
    encoding: Annotated[str, Field(max_length=200)] = _ENCODING
    rows: Annotated[int, Field(ge=2)]
    cols: Annotated[int, Field(ge=2, le=_MAX_PART_HEIGHTS)]
    spacing_m: Annotated[Finite, Field(gt=0.0)]
    source: str
    sha256: str
    datum: str
    vertical_error_m: float | None
    map_to_pixel: Annotated[list[list[Finite]], Field(min_length=4, max_length=2 + 2 * MAX_TERMS)]
    map_residual_pixels: float
    parts: list[str]


def pack_terrain(terrain: Terrain) -> dict[str, bytes]:
    """Encode the terrain as attachments, and return their bytes by name.

    They are `TERRAIN_FILE`, and the heights in one or more parts, compressed without loss.
    """
    rows, cols = terrain.heights.shape
    parts = {}
    compressor = zstandard.ZstdCompressor(level=3)
    # Compress the heights without loss, with the encoding `_ENCODING`.
    for k, (first, last) in enumerate(_row_blocks(rows, cols)):
        bits = np.ascontiguousarray(terrain.heights[first:last], dtype="<f4").view("<u4")
        bits = np.diff(bits, axis=1, prepend=np.zeros((len(bits), 1), dtype="<u4"))
        planes = np.ascontiguousarray(bits.reshape(-1, 1).view(np.uint8).T)
        parts[heights_name(k)] = bytes(compressor.compress(planes.tobytes()))
    file = _TerrainFile(
        rows=rows,
        cols=cols,
        spacing_m=terrain.spacing,
        source=terrain.source,
        sha256=terrain.sha256,
        datum=terrain.datum,
        vertical_error_m=terrain.vertical_error,
        map_to_pixel=terrain.to_pixel.to_rows().tolist(),
        map_residual_pixels=terrain.to_pixel.residual,
        parts=list(parts),
    )
    text = json.dumps(file.model_dump(by_alias=True), indent=1)
    return {TERRAIN_FILE: text.encode(), **parts}


def unpack_terrain(attachments: dict[str, bytes], source: str) -> Terrain:
    """Rebuild the terrain from its attachments, bit for bit.

    Raises LogError for missing, damaged or wrongly sized heights, and for an invalid conversion from map to pixels.

    attachments: bytes of all attachments of the log by name, including the attachments from `pack_terrain`.
    source: name of the log for messages.
    """
    try:
        file = _TerrainFile.model_validate_json(attachments[TERRAIN_FILE])
    except ValidationError as error:
        raise LogError(**first_fault(error, container=JSON_OBJECT).at(source, TERRAIN_FILE)) from error
    if file.rows * file.cols > MAX_PIXELS:
        raise LogError(
            f"{source}: {TERRAIN_FILE}: {file.rows} x {file.cols} pixels: at most {MAX_PIXELS:,} are read", file=source
        )
    blocks = _row_blocks(file.rows, file.cols)
    if len(blocks) != len(file.parts) or any(name not in attachments for name in file.parts):
        message = f"{source}: {TERRAIN_FILE}: parts: expected {len(blocks)}, each in the log"
        raise LogError(message, file=source, field="parts", value=len(file.parts))
    heights = np.empty((file.rows, file.cols), dtype=np.float32)
    for name, (first, last) in zip(file.parts, blocks, strict=True):
        part_name = f"{source}: {name}"
        rows = last - first
        size = rows * file.cols * 4
        try:
            # The reader limits the size; decompress() would trust the size that the data declare.
            reader = zstandard.ZstdDecompressor(max_window_size=2**27).stream_reader(attachments[name])
            raw = reader.read(size + 1)
        except zstandard.ZstdError as error:
            raise LogError(f"{part_name}: cannot be decompressed: {error}", file=part_name) from error
        if len(raw) != size:
            raise LogError(f"{part_name}: expected {rows} x {file.cols} heights: the size differs", file=part_name)
        bits = np.ascontiguousarray(np.frombuffer(raw, np.uint8).reshape(4, -1).T).view("<u4").reshape(rows, file.cols)
        heights[first:last] = np.cumsum(bits, axis=1, dtype=np.uint32).astype("<u4").view("<f4")
    map_rows = file.map_to_pixel
    terms = len(map_rows[0])
    if len(map_rows) != 2 + 2 * terms or any(len(row) != terms for row in map_rows) or terms < 2:
        shape_text = f"{len(map_rows)} rows of {terms}"
        raise LogError.at(f"{source}: {TERRAIN_FILE}", "map_to_pixel", shape_text, "expected 2 + 2n rows of n")
    half_widths = map_rows[1][:2]
    if not (math.fabs(half_widths[0]) > 0.0 and math.fabs(half_widths[1]) > 0.0):
        shown_value = f"half-widths {half_widths}"
        raise LogError.at(f"{source}: {TERRAIN_FILE}", "map_to_pixel", half_widths, "not above 0", shown=shown_value)
    return Terrain(
        heights=heights,
        to_pixel=PolyMap.from_rows(np.array(map_rows), file.map_residual_pixels),
        spacing=file.spacing_m,
        source=file.source,
        sha256=file.sha256,
        datum=file.datum,
        vertical_error=file.vertical_error_m,
    )


def _row_blocks(rows: int, cols: int) -> list[tuple[int, int]]:
    """Divide the rows of the terrain's heights into one block per attachment.

    Return the range of rows of each block, as the first row and the row after the last.
    """
    step = max(1, _MAX_PART_HEIGHTS // cols)
    return [(first, min(rows, first + step)) for first in range(0, rows, step)]


# ----------------------------------------------------------------------
# The setup itself.

LOG_SCHEMA = "planfly.log/1"
_PACKAGES = (
    "planfly",
    "jsbsim",
    "numpy",
    "numba",
    "scipy",
    "pydantic",
    "pymavlink",
    "pyproj",
    "rasterio",
    "shapely",
    "mcap",
    "zstandard",
    "protobuf",
    "foxglove-schemas-protobuf",
)


# ----------------------------------------------------------------------
# The wind of a forecast inside a log.

FORECAST_SCHEMA = "planfly.forecast/1"
_FIELD_ENCODING = "float64, little endian, zstd: counts (t, y, x, k), axes, and altitude, east, north of each node"


class _ForecastFile(SetupModel):
    """Content of `forecast.json`: facts about the forecast, and the number of values of its wind field."""

    model_config = ConfigDict(validate_by_name=True, validate_by_alias=True)
    file_schema: Annotated[str, Field(alias="schema", pattern=f"^{FORECAST_SCHEMA}$")] = FORECAST_SCHEMA
    encoding: Annotated[str, Field(max_length=200)] = _FIELD_ENCODING
    facts: ForecastFacts
    numbers: Annotated[int, Field(ge=0, le=MAX_FIELD_NUMBERS)]

    @field_validator("facts")
    @classmethod
    def _check_facts(cls, facts: ForecastFacts) -> ForecastFacts:
        """Refuse control characters, times without an offset from UTC, and numbers that are not finite."""
        if not (facts.source + facts.ground).isprintable():
            raise ValueError("control characters are not allowed")
        if any(time is not None and time.tzinfo is None for time in (facts.issued, facts.departure, facts.last_time)):
            raise ValueError("a time has no offset from UTC")
        if not np.isfinite((facts.grid_km, facts.lowest_amsl, facts.highest_amsl, *facts.box)).all():
            raise ValueError("a number is not finite")
        return facts


def pack_forecast(wind: Wind) -> dict[str, bytes]:
    """Encode a wind's forecast as attachments, bytes by name; return {} for a wind without one."""
    if wind.forecast is None:
        return {}
    numbers = np.empty(0) if wind.field is None else wind.field.packed()
    file = _ForecastFile(facts=wind.forecast, numbers=numbers.size)
    attachments = {FORECAST_FILE: json.dumps(file.model_dump(by_alias=True, mode="json"), indent=1).encode()}
    if numbers.size:
        attachments[WIND_FILE] = zstandard.ZstdCompressor(level=6).compress(numbers.astype("<f8").tobytes())
    return attachments


def unpack_forecast(attachments: dict[str, bytes], source: str, wind: Wind, *, is_in_forecast: bool) -> Wind:
    """Add the forecast in a log's attachments to a wind; return the wind unchanged if they contain none.

    Raises LogError for an attachment that is missing or has the wrong content.

    source: name of the log for messages.
    is_in_forecast: True if the scenario names a forecast, so that the attachments must contain it.
    """
    if FORECAST_FILE not in attachments:
        if is_in_forecast:
            raise LogError(f"{source}: {FORECAST_FILE}: missing", file=source, field=FORECAST_FILE)
        return wind
    try:
        file = _ForecastFile.model_validate_json(attachments[FORECAST_FILE])
    except ValidationError as error:
        raise LogError(**first_fault(error, container=JSON_OBJECT).at(source, FORECAST_FILE)) from error
    if not file.numbers:
        return replace(wind, forecast=file.facts)
    try:
        data = zstandard.ZstdDecompressor(max_window_size=2**27).stream_reader(attachments[WIND_FILE])
        raw = data.read(8 * file.numbers + 1)
        field = WindField.unpacked(np.frombuffer(raw, "<f8").astype(np.float64), file.numbers)
    except (KeyError, ValueError, zstandard.ZstdError) as error:
        message = f"{source}: {WIND_FILE}: not the {file.numbers:,} numbers that {FORECAST_FILE} states"
        raise LogError(message, file=source, field=WIND_FILE) from error
    return replace(wind, field=field, forecast=file.facts)


class _SetupFile(SetupModel):
    """Content of `setup.json`: all of a setup that has no attachment of its own."""

    model_config = ConfigDict(validate_by_name=True, validate_by_alias=True)
    file_schema: Annotated[str, Field(alias="schema", pattern=f"^{LOG_SCHEMA}$")] = LOG_SCHEMA
    aircraft: str
    airspeed_mps: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    max_bank_rad: Annotated[float, Field(gt=0.0, lt=math.pi / 2)]
    battery_wh: Finite
    seed: Annotated[int, Field(ge=0)]
    external: Annotated[bool, Field(alias="foreign")]
    guidance: Guidance
    nav: Navigation
    guidance_hz: Literal[30, 60]
    fdm_hz: Literal[60, 120] = 120  # default for logs from before it could be chosen
    parameters: ParametersTable | None = None  # older logs have none: they were flown by planfly's guidance
    program: ProgramTable | None = None
    autopilot: str | None = None  # left out if guidance, parameters and program identify the autopilot
    autopilot_version: str | None = None  # left out if all its releases fly alike
    source: ImportedLog | None = None
    mission: MissionTable
    route: RouteTable
    envelope: EnvelopeTable
    versions: dict[str, str]
    sha256: dict[str, str]


@dataclass(frozen=True, slots=True)
class StoredSetup:
    """Setup from a log, with the versions of the packages with which it was flown."""

    setup: FlightSetup
    versions: dict[str, str]


@functools.cache
def _cached_versions() -> tuple[tuple[str, str], ...]:
    """Look up the versions of Python and of the installed packages of `_PACKAGES`; the result is cached."""
    versions = [("python", platform.python_version())]
    for name in _PACKAGES:
        with contextlib.suppress(metadata.PackageNotFoundError):
            versions.append((name, metadata.version(name)))
    return tuple(versions)


def package_versions() -> dict[str, str]:
    """Return the versions of Python and of the packages whose arithmetic or formats affect a log.

    Packages that are not installed are left out.

    >>> versions = package_versions()
    >>> versions["numpy"] == metadata.version("numpy")
    True
    """
    return dict(_cached_versions())


def pack_setup(setup: FlightSetup) -> dict[str, bytes]:
    """Encode a setup as attachments for a log, and return their bytes by name, `SETUP_FILE` first.

    The same setup and packages give the same bytes.
    """
    attachments = {
        SCENARIO_FILE: _json_bytes(setup.scenario.to_json()),
        MISSION_FILE: mission_text(setup.mission, "waypoints").encode(),
    }
    if setup.plan is not None:
        attachments[PLAN_FILE] = plan_json(setup.plan).encode()
    if setup.scenario.terrain is not None:
        attachments |= pack_terrain(setup.scenario.terrain)
    attachments |= pack_forecast(setup.scenario.wind)
    stored_autopilot = setup.autopilot.store()
    file = _SetupFile(
        aircraft=setup.aircraft,
        airspeed_mps=setup.airspeed,
        max_bank_rad=setup.max_bank,
        battery_wh=setup.battery,
        seed=setup.seed,
        external=setup.scenario.external,
        guidance=stored_autopilot.guidance,
        nav=setup.nav,
        guidance_hz=setup.guidance_hz,
        fdm_hz=setup.fdm_hz,
        parameters=None if stored_autopilot.parameters is None else parameters_table(stored_autopilot.parameters),
        program=None if stored_autopilot.program is None else ProgramTable.from_dataclass(stored_autopilot.program),
        autopilot=stored_name(setup.autopilot),
        autopilot_version=stored_autopilot.version or None,
        source=setup.imported_log,
        mission=MissionTable.from_dataclass(setup.mission),
        route=RouteTable.from_dataclass(setup.route),
        envelope=EnvelopeTable.from_dataclass(setup.envelope),
        versions=package_versions(),
        sha256={name: hashlib.sha256(data).hexdigest() for name, data in attachments.items()},
    )
    omitted_fields: dict[str, Any] = {
        name: True for name in ("autopilot", "autopilot_version") if getattr(file, name) is None
    }
    if not file.mission.survey_plans:
        omitted_fields["mission"] = {"survey_plans"}
    return {SETUP_FILE: _json_bytes(file.model_dump(by_alias=True, exclude=omitted_fields)), **attachments}


def unpack_setup(attachments: dict[str, bytes], source: str) -> StoredSetup:
    """Rebuild a setup from its attachments; no file is opened.

    Raises LogError, in one line, for an attachment that is missing, altered or inconsistent.

    attachments: bytes by name.
    source: name of the log for messages.
    """
    if SETUP_FILE not in attachments:
        raise LogError(f"{source}: not a planfly log: an MCAP file without {SETUP_FILE}", file=source)
    try:
        file = _SetupFile.model_validate_json(attachments[SETUP_FILE])
    except ValidationError as error:
        raise LogError(**first_fault(error, container=JSON_OBJECT).at(source, SETUP_FILE)) from error
    for name, digest in file.sha256.items():
        if name not in attachments:
            raise LogError(
                f"{source}: {name}: missing, although {SETUP_FILE} lists this attachment", file=source, field=name
            )
        if hashlib.sha256(attachments[name]).hexdigest() != digest:
            message = f"{source}: {name}: altered: its SHA-256 is not the one in {SETUP_FILE}"
            raise LogError(message, file=source, field=name)
    listed_attachments = {name: attachments[name] for name in file.sha256}
    terrain = unpack_terrain(listed_attachments, source) if TERRAIN_FILE in listed_attachments else None
    plan: Plan | None = None
    plan_text = ""
    _, spec = _read_json(listed_attachments, SCENARIO_FILE, source, terrain)
    if PLAN_FILE in listed_attachments:
        plan_text, _ = _read_json(listed_attachments, PLAN_FILE, source, terrain)
    try:
        scenario = scenario_from_spec(
            spec, f"{source}: {SCENARIO_FILE}", ground=terrain, external=file.external, is_stored=True
        )
        if PLAN_FILE in listed_attachments:
            plan = parse_plan(plan_text, f"{source}: {PLAN_FILE}", ground=terrain, is_stored=True)
    except PlanflyError as error:
        raise LogError.from_error(error) from error
    is_in_forecast = None not in (scenario.spec.wind.forecast, scenario.spec.at)
    wind = unpack_forecast(listed_attachments, source, scenario.wind, is_in_forecast=is_in_forecast)
    scenario = replace(scenario, wind=wind)
    file_name = f"{source}: {SETUP_FILE}"
    stored_autopilot = StoredAutopilot(
        file.guidance,
        None if file.parameters is None else read_parameters(file.parameters),
        None if file.program is None else file.program.to_program(),
        file.autopilot_version or "",
    )
    try:
        autopilot = restore_autopilot(file.autopilot, stored_autopilot)
    except ParameterError as error:
        raise LogError(f"{file_name}: parameters.values: {error}", file=file_name, field="parameters.values") from error
    except KeyError as error:
        raise LogError.at(file_name, "autopilot", file.autopilot, "not an autopilot of this version") from error
    envelope = file.envelope.to_envelope(file_name)
    setup = FlightSetup(
        scenario=scenario,
        mission=file.mission.to_mission(),
        route=file.route.to_route(file_name),
        limits=make_limits(scenario, envelope, file.airspeed_mps, file.max_bank_rad),
        aircraft=file.aircraft,
        battery=file.battery_wh,
        seed=file.seed,
        plan=plan,
        autopilot=autopilot,
        nav=file.nav,
        guidance_hz=file.guidance_hz,
        fdm_hz=file.fdm_hz,
        imported_log=file.source,
    )
    return StoredSetup(setup, file.versions)


def _json_bytes(data: Any) -> bytes:
    """Encode data as JSON; non-finite numbers become strings."""
    return (json.dumps(_finite_or_text(data), indent=1, allow_nan=False) + "\n").encode()


def _finite_or_text(data: Any) -> Any:
    """Return a copy of nested data with strings in place of non-finite numbers.

    JSON has no such numbers.
    """
    if isinstance(data, float) and not math.isfinite(data):
        return str(float(data))
    if isinstance(data, dict):
        return {key: _finite_or_text(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite_or_text(value) for value in data]
    return data


def _read_json(attachments: dict[str, bytes], name: str, source: str, terrain: Terrain | None) -> tuple[str, Any]:
    """Return the JSON text and the parsed value of the attachment with the scenario or the plan.

    Raises LogError if it is missing, not JSON, or needs terrain although the log has none.

    source: name of the log for messages.
    terrain: the log's terrain; None if it has none.
    """
    file_name = f"{source}: {name}"
    try:
        text = attachments[name].decode()
        data = json_value(text)
    except KeyError:
        raise LogError(f"{file_name}: missing", file=source, field=name) from None
    except UnicodeDecodeError as error:
        raise LogError(f"{file_name}: not UTF-8 text (byte {error.start})", file=source, field=name) from error
    except ValueError as error:
        raise LogError(f"{file_name}: not valid JSON: {error}", file=file_name) from error
    scenario_table = data.get("scenario") if name == PLAN_FILE and isinstance(data, dict) else data
    terrain_table = scenario_table.get("terrain") if isinstance(scenario_table, dict) else None
    kind = terrain_table.get("kind") if isinstance(terrain_table, dict) else None
    if terrain is None and kind != "none":
        raise LogError.at(file_name, "terrain.kind", kind, f"the log contains no {TERRAIN_FILE}", shown=repr(kind))
    return text, data
