"""A scenario: where to fly from and to, over which terrain, past which threats, within which limits."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from world.errors import ScenarioError, TerrainError
from world.frames import GeoOrigin, to_geo, to_map
from world.raster import EMBEDDED, RasterFile, open_raster, read_terrain, tile_bounds
from world.scenario_file import (
    AreaTable,
    FlightTable,
    LimitsTable,
    OriginTable,
    PlannerTable,
    PointTable,
    ScenarioFile,
    TerrainTable,
    ThreatTable,
    check_scenario,
    first_error,
    names_folder,
    parse_scenario,
    read_scenario_text,
)
from world.terrain import Terrain, flat_terrain, peaks_terrain
from world.threats import Threats
from world.wind import Wind

Floats = NDArray[np.float64]
Table = TypeVar("Table", bound=BaseModel)

# Ground beyond the area that is kept, m: a flight may overshoot a corner at the map's edge.
MARGIN = 1000.0


@dataclass(frozen=True, slots=True)
class Scenario:
    """One mission's world, in map axes (m) and radians.

    bounds: (2, 2) [[east0, east1], [north0, north1]].  floor, ceiling: m AMSL.  start, destination: (3,).
    start_course, destination_course: rad or None.  terrain: None where none was given (an external mission).
    external: made around a mission file that came without a scenario: its bounds are no limit and its empty
    threats say nothing.  spec: the checked file it came from, with which `from_spec` makes it again.
    """

    name: str
    spec: ScenarioFile
    origin: GeoOrigin
    bounds: Floats
    floor: float
    ceiling: float
    start: Floats
    destination: Floats
    start_course: float | None
    destination_course: float | None
    terrain: Terrain | None
    threats: Threats
    limits: LimitsTable
    planner: PlannerTable
    flight: FlightTable
    wind: Wind
    external: bool = False

    def __post_init__(self) -> None:
        """Lock the arrays."""
        for name in ("bounds", "start", "destination"):
            array = np.array(getattr(self, name), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def to_json(self) -> dict[str, Any]:
        """Give the scenario as plain JSON data; `from_spec` reads it back."""
        return self.spec.model_dump(mode="json", exclude_none=True)


@cache
def embedded_scenarios() -> dict[str, ScenarioFile]:
    """Read the scenarios that ship with planfly, by name, in a fixed order."""
    folder = resources.files("world") / "scenarios"
    found = {}
    for entry in sorted(folder.iterdir(), key=lambda item: (item.name != "jacksboro.toml", item.name)):
        if entry.name.endswith(".toml"):
            found[entry.name.removesuffix(".toml")] = parse_scenario(entry.read_text(encoding="utf-8"), entry.name)
    return found


def load_scenario(name_or_path: str, terrain: str | None = None) -> Scenario:
    """Read a scenario: an embedded name or a TOML file.  ``terrain`` replaces its terrain by a file.

    Raises ScenarioError or TerrainError.
    """
    known = embedded_names()
    if name_or_path in known:
        entry = resources.files("world") / "scenarios" / f"{name_or_path}.toml"
        return from_spec(parse_scenario(entry.read_text(encoding="utf-8"), name_or_path), name_or_path, terrain=terrain)
    path = Path(name_or_path)
    try:
        missing = not path.exists()
    except OSError:  # a name that is too long
        missing = True
    if missing:
        raise ScenarioError(f"{name_or_path}: no such file, and not an embedded scenario ({', '.join(known)})")
    spec = parse_scenario(read_scenario_text(path), str(path))
    return from_spec(spec, str(path), base=path.parent, terrain=terrain)


def embedded_names() -> list[str]:
    """Names of the scenarios that ship with planfly, the default first."""
    folder = resources.files("world") / "scenarios"
    names = sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml"))
    return sorted(names, key=lambda name: name != "jacksboro")


def from_spec(
    spec: ScenarioFile | dict[str, Any],
    source: str,
    *,
    base: Path | None = None,
    terrain: str | None = None,
    ground: Terrain | None = None,
    external: bool = False,
) -> Scenario:
    """Make a scenario of a checked file, or of what `Scenario.to_json` gave.

    source: names the file in messages.  base: folder that relative paths count from.  terrain: an
    elevation file that replaces the scenario's own.  ground: terrain already at hand (from a log).
    """
    spec = spec if isinstance(spec, ScenarioFile) else check_scenario(spec, source)
    if terrain is not None:
        spec, base = _with_terrain(spec, terrain, source, base), None
    raster = None
    if spec.terrain.kind == "dem" and ground is None:
        raster, table = _open_terrain(spec.terrain, source if terrain is None else "--terrain", base)
        spec = spec.model_copy(update={"terrain": table})
    if spec.origin is not None:
        origin = GeoOrigin(spec.origin.lat_deg, spec.origin.lon_deg)
    else:
        origin = raster.centre if raster is not None else GeoOrigin(46.0, 8.0)
    if spec.area is not None:
        bounds = np.array([spec.area.east_m, spec.area.north_m])
    elif raster is not None:
        bounds = tile_bounds(raster, origin)
    else:
        raise ScenarioError(f"{source}: area: missing, and there is no tile to take it from")
    if ground is None:
        if raster is not None:
            ground = read_terrain(raster, origin, bounds, MARGIN)
        else:
            ground = _made_terrain(spec.terrain, bounds)
    if ground is not None and spec.terrain.vertical_error_m is not None:
        ground = replace(ground, vertical_error=spec.terrain.vertical_error_m)
    if names_folder(spec.flight.aircraft):
        folder = str(Path(base or "", spec.flight.aircraft).resolve())
        spec = spec.model_copy(update={"flight": spec.flight.model_copy(update={"aircraft": folder})})
    # What was taken from the tile is written down, so that a log without the tile makes the same scenario.
    place = checked_table(lambda: OriginTable(lat_deg=origin.lat_deg, lon_deg=origin.lon_deg), f"{source}: origin")
    area = spec.area or checked_table(
        lambda: AreaTable(east_m=bounds[0].tolist(), north_m=bounds[1].tolist()), f"{source}: area"
    )
    spec = spec.model_copy(update={"origin": place, "area": area})
    return _assemble(spec, source, origin, bounds, ground, external=external, replaced=terrain is not None)


def checked_table(make: Callable[[], Table], source: str) -> Table:
    """Make a table of values that no file was checked for.  Raises ScenarioError."""
    try:
        return make()
    except ValidationError as error:
        raise ScenarioError(f"{source}: {first_error(error)}") from error


def _with_terrain(spec: ScenarioFile, terrain: str, source: str, base: Path | None) -> ScenarioFile:
    """Replace the terrain by a file, and keep the map where it is: its origin may be the old tile's centre."""
    changes: dict[str, Any] = {
        "terrain": checked_table(lambda: TerrainTable(kind="dem", path=terrain), "--terrain"),
    }
    if spec.origin is None and spec.terrain.kind == "dem":
        centre = _open_terrain(spec.terrain, source, base)[0].centre
        changes["origin"] = checked_table(
            lambda: OriginTable(lat_deg=centre.lat_deg, lon_deg=centre.lon_deg), f"{source}: origin"
        )
    return spec.model_copy(update=changes)


def _open_terrain(table: TerrainTable, source: str, base: Path | None) -> tuple[RasterFile, TerrainTable]:
    """Open a scenario's elevation file, and say where it was found and what its hash is."""
    path = str(table.path)
    try:
        raster = open_raster(path, base)
    except TerrainError as error:
        raise TerrainError(f"{source}: terrain.path: {error}") from error
    if table.sha256 not in (None, raster.sha256):
        raise ScenarioError(f"{source}: terrain.path: {path}: the file has changed since (its SHA-256 differs)")
    if path not in EMBEDDED:
        path = str(Path(base or "", path).resolve())
    return raster, TerrainTable(kind="dem", path=path, vertical_error_m=table.vertical_error_m, sha256=raster.sha256)


def _assemble(
    spec: ScenarioFile,
    source: str,
    origin: GeoOrigin,
    bounds: Floats,
    ground: Terrain | None,
    *,
    external: bool,
    replaced: bool,
) -> Scenario:
    area = spec.area
    floor = area.floor_amsl_m if area and area.floor_amsl_m is not None else -500.0
    top = float(np.nanmax(ground.heights)) if ground is not None else 3000.0
    ceiling = area.ceiling_amsl_m if area and area.ceiling_amsl_m is not None else top + 1000.0
    start = _position(spec.start, "start", source, origin, ground)
    destination = _position(spec.destination, "destination", source, origin, ground)
    # Ends that another terrain buries are for the verdict to find.
    for name, point in () if replaced else (("start", start), ("destination", destination)):
        _check_inside(name, point, source, bounds, floor, ceiling, ground)
    if not external and math.dist(start[:2], destination[:2]) < 10.0:
        raise ScenarioError(f"{source}: destination: less than 10 m from start")
    wind = Wind(
        spec.wind.speed_mps,
        math.radians(spec.wind.from_deg),
        spec.wind.gradient,
        spec.wind.turbulence,
        spec.wind.seed,
        float(start[2]),
    )
    return Scenario(
        name=spec.name,
        spec=spec,
        origin=origin,
        bounds=bounds,
        floor=floor,
        ceiling=ceiling,
        start=start,
        destination=destination,
        start_course=None if spec.start.course_deg is None else math.radians(spec.start.course_deg),
        destination_course=None if spec.destination.course_deg is None else math.radians(spec.destination.course_deg),
        terrain=ground,
        threats=make_threats(spec.threats, source, origin, ground),
        limits=spec.limits,
        planner=spec.planner,
        flight=spec.flight,
        wind=wind,
        external=external,
    )


def _made_terrain(table: TerrainTable, bounds: Floats) -> Terrain | None:
    if table.kind == "flat":
        return flat_terrain(bounds, float(table.amsl_m or 0.0), 5 * MARGIN)
    if table.kind == "peaks":
        peaks = np.array([[p.east_m, p.north_m, p.height_m, p.sigma_m] for p in table.peak or []]).reshape(-1, 4)
        return peaks_terrain(bounds, peaks, MARGIN)
    return None


def _position(table: PointTable, key: str, source: str, origin: GeoOrigin, ground: Terrain | None) -> Floats:
    if table.east_m is not None and table.north_m is not None:
        east, north = table.east_m, table.north_m
    else:
        point = to_map(origin, float(table.lat_deg or 0.0), float(table.lon_deg or 0.0))
        east, north = float(point[0]), float(point[1])
    if table.amsl_m is not None:
        return np.array([east, north, table.amsl_m])
    under = float(ground.height(east, north)) if ground is not None else math.nan
    if math.isnan(under):
        raise ScenarioError(
            f"{source}: {key}: east {east:.0f} m, north {north:.0f} m:"
            " no terrain there to count a height from; give amsl_m"
        )
    return np.array([east, north, under + (table.height_m or 0.0)])


def _check_inside(
    key: str, point: Floats, source: str, bounds: Floats, floor: float, ceiling: float, ground: Terrain | None
) -> None:
    for axis, name in enumerate(("east", "north")):
        low, high = bounds[axis]
        if not low <= point[axis] <= high:
            raise ScenarioError(f"{source}: {key}: {name} {point[axis]:.0f} m: outside the area {low:.0f}..{high:.0f}")
    if not floor <= point[2] <= ceiling:
        raise ScenarioError(
            f"{source}: {key}: {point[2]:.0f} m AMSL: outside floor..ceiling {floor:.0f}..{ceiling:.0f}"
        )
    if ground is not None:
        under = float(ground.height(point[0], point[1]))
        if point[2] <= under:
            raise ScenarioError(
                f"{source}: {key}: {point[2]:.0f} m AMSL: not above the terrain, which is at {under:.0f} m"
            )


def make_threats(tables: list[ThreatTable], source: str, origin: GeoOrigin, ground: Terrain | None) -> Threats:
    """Stand threats on the ground, or at their own heights.  Raises ScenarioError."""
    positions = np.zeros((len(tables), 3))
    for k, table in enumerate(tables):
        on_ground = table if table.amsl_m is not None else table.model_copy(update={"height_m": table.height_m or 0.0})
        positions[k] = _position(on_ground, f"threats[{k}]", source, origin, ground)
    return Threats(
        names=tuple(table.name or f"threat {k + 1}" for k, table in enumerate(tables)),
        position=positions,
        kill_radius=np.array([table.kill_radius_m or 0.0 for table in tables]),
        detection_radius=np.array([table.detection_radius_m or 0.0 for table in tables]),
        kill_scale=np.array([table.kill_scale_m or 0.0 for table in tables]),
        detection_scale=np.array([table.detection_scale_m or 0.0 for table in tables]),
    )


def geographic(scenario: Scenario, points: Floats) -> tuple[Floats, Floats]:
    """Latitude and longitude in degrees of map positions (..., 3)."""
    return to_geo(scenario.origin, points[..., 0], points[..., 1])
