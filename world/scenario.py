"""A scenario: where to fly from and to, over which terrain, past which threats, within which limits."""

import math
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world.airspace.zone_files import read_zone_files
from world.airspace.zones import Zone
from world.airspace.zones_on_map import check_ends, make_zones
from world.errors import ScenarioError, TerrainError
from world.frames import GeoOrigin, to_geo
from world.raster import EMBEDDED, RasterFile, open_raster, read_terrain, tile_bounds
from world.scenario_file import check_scenario, checked_table, parse_scenario, read_scenario_text
from world.scenario_positions import check_inside, make_threats, map_position
from world.scenario_tables import (
    AreaTable,
    FlightTable,
    LimitsTable,
    OriginTable,
    PlannerTable,
    ScenarioFile,
    TerrainTable,
    names_folder,
)
from world.terrain import Peak, Terrain, flat_terrain, peaks_terrain
from world.text_files import did_you_mean, whole_path
from world.threats import Threats
from world.wind import Wind

Floats = NDArray[np.float64]

# Ground beyond the area that is kept, m: a flight may overshoot a corner at the map's edge.
GROUND_BUFFER = 1000.0


@dataclass(frozen=True, slots=True)
class Scenario:
    """One mission's world, in map axes (m) and radians.

    spec: the checked file it came from, with which `from_spec` makes it again.
    origin: where east = north = 0.
    bounds: (2, 2) [[east0, east1], [north0, north1]].
    floor, ceiling: m AMSL.
    start, destination: (3,).
    start_course, destination_course: rad or None.
    terrain: None where none was given (an external mission).
    limits, planner, flight: the file's tables of these names.
    zones: of airspace, to keep out of or to stay in.
    external: made around a mission file that came without a scenario: its bounds are no limit and its empty
    threats say nothing.
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
    zones: tuple[Zone, ...] = ()

    def __post_init__(self) -> None:
        """Lock the arrays."""
        for name in ("bounds", "start", "destination"):
            array = np.array(getattr(self, name), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def to_json(self) -> dict[str, Any]:
        """The scenario as plain JSON data; `from_spec` reads it back."""
        stated = self.spec.model_copy(update={"flight": self.spec.flight.stated()})
        return stated.model_dump(mode="json", exclude_none=True)


@cache
def embedded_scenarios() -> dict[str, ScenarioFile]:
    """The checked files of the scenarios that ship with planfly, by name, in a fixed order.

    >>> embedded_scenarios()["tight"].limits.min_clearance_m
    60.0
    """
    folder = resources.files("world") / "scenarios"
    found = {}
    for entry in sorted(folder.iterdir(), key=lambda item: (item.name != "jacksboro.toml", item.name)):
        if entry.name.endswith(".toml"):
            found[entry.name.removesuffix(".toml")] = parse_scenario(entry.read_text(encoding="utf-8"), entry.name)
    return found


def load_scenario(name_or_path: str, terrain: str | None = None) -> Scenario:
    """Read a scenario: an embedded name or a TOML file.  ``terrain`` replaces its terrain by a file.

    Raises ScenarioError for a file that is missing or has a fault, and TerrainError for its elevation file.

    >>> scenario = load_scenario("tight")
    >>> scenario.start.tolist(), scenario.destination.tolist(), len(scenario.threats)
    ([0.0, 0.0, 75.0], [2600.0, 0.0, 75.0], 28)
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
        near = did_you_mean(name_or_path, [*known, *_files_beside(path)])
        said = f"{name_or_path}: no such file, and not an embedded scenario ({', '.join(known)}){near}"
        raise ScenarioError(said, file=name_or_path)
    spec = parse_scenario(read_scenario_text(path), str(path))
    return from_spec(spec, str(path), base=path.parent, terrain=terrain)


def _files_beside(path: Path) -> list[str]:
    """Scenario files where one was looked for, as it was named."""
    try:
        return [str(file) for file in sorted(path.parent.glob("*.toml"))]
    except OSError:
        return []


def embedded_names() -> list[str]:
    """Names of the scenarios that ship with planfly, the default first.

    >>> embedded_names()[0]
    'jacksboro'
    """
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

    source: names the file in messages.
    base: folder that relative paths count from.
    terrain: an elevation file that replaces the scenario's own.
    ground: terrain already at hand (from a log).
    external: see `Scenario`.
    Raises ScenarioError and TerrainError as `load_scenario` does.

    >>> again = from_spec(load_scenario("tight").to_json(), "a plan")
    >>> again.name, again.bounds.tolist()
    ('tight', [[-300.0, 2900.0], [-150.0, 150.0]])
    """
    spec = spec if isinstance(spec, ScenarioFile) else check_scenario(spec, source)
    if spec.zones_file is not None:
        # Written down with the scenario's own, so that a log without the files makes the same scenario.
        zones = [*(spec.zones or ()), *read_zone_files(spec.zones_file, source, base)]
        spec = spec.model_copy(update={"zones": zones, "zones_file": None})
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
        raise ScenarioError(f"{source}: area: missing, and there is no tile to take it from", file=source, field="area")
    if ground is None:
        if raster is not None:
            ground = read_terrain(raster, origin, bounds, GROUND_BUFFER)
        else:
            ground = _made_terrain(spec.terrain, bounds)
    if ground is not None and spec.terrain.vertical_error_m is not None:
        ground = replace(ground, vertical_error=spec.terrain.vertical_error_m)
    spec = spec.model_copy(update={"flight": _with_whole_paths(spec.flight, base)})
    # What was taken from the tile is written down, so that a log without the tile makes the same scenario.
    place = checked_table(lambda: OriginTable(lat_deg=origin.lat_deg, lon_deg=origin.lon_deg), f"{source}: origin")
    area = spec.area or checked_table(
        lambda: AreaTable(east_m=bounds[0].tolist(), north_m=bounds[1].tolist()), f"{source}: area"
    )
    spec = spec.model_copy(update={"origin": place, "area": area})
    return _assemble(spec, source, origin, bounds, ground, external=external, replaced=terrain is not None)


def _with_whole_paths(flight: FlightTable, base: Path | None) -> FlightTable:
    """The table with the folder of its aircraft and its file of parameters as absolute paths."""
    changes = {}
    if names_folder(flight.aircraft):
        changes["aircraft"] = whole_path(Path(base or "", flight.aircraft))
    if flight.params is not None:
        changes["params"] = whole_path(Path(base or "", flight.params))
    return flight.model_copy(update=changes)


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
        raise TerrainError.from_error(error, source, "terrain.path", path) from error
    if table.sha256 not in (None, raster.sha256):
        raise ScenarioError.at(source, "terrain.path", path, "the file has changed since (its SHA-256 differs)")
    if path not in EMBEDDED:
        path = whole_path(Path(base or "", path))
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
    start = map_position(spec.start, "start", source, origin, ground)
    destination = map_position(spec.destination, "destination", source, origin, ground)
    # Ends that another terrain buries are for the verdict to find.
    ends = () if replaced else (("start", start), ("destination", destination))
    for name, point in ends:
        check_inside(name, point, source, bounds, floor, ceiling, ground)
    zones = make_zones(spec.zones or (), source, origin, ground)
    # Of a mission that came without a scenario they are where it goes: for the verdict to find, too.
    check_ends(zones, source, ends if zones and not external else (), ground)
    if not external and math.dist(start[:2], destination[:2]) < 10.0:
        raise ScenarioError(f"{source}: destination: less than 10 m from start", file=source, field="destination")
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
        zones=zones,
    )


def _made_terrain(table: TerrainTable, bounds: Floats) -> Terrain | None:
    if table.kind == "flat":
        return flat_terrain(bounds, float(table.amsl_m or 0.0), 5 * GROUND_BUFFER)
    if table.kind == "peaks":
        peaks = [Peak(p.east_m, p.north_m, p.height_m, p.sigma_m) for p in table.peak or []]
        return peaks_terrain(bounds, peaks, GROUND_BUFFER)
    return None


def geographic(scenario: Scenario, points: Floats) -> tuple[Floats, Floats]:
    """Latitude and longitude in degrees of map positions (..., 3).

    >>> scenario = load_scenario("tight")
    >>> lat, lon = geographic(scenario, scenario.destination)
    >>> float(lat.round(5)), float(lon.round(5))
    (46.0, 8.03356)
    """
    return to_geo(scenario.origin, points[..., 0], points[..., 1])
