"""A scenario: start and destination of a flight, terrain, threats, zones, wind and limits."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial, wraps
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from world.airfield import (
    LandingStrip,
    Launch,
    ReturnRequirements,
    make_home,
    make_landing,
    make_launch,
    make_return_requirements,
)
from world.airspace.zone_files import FileZones, read_zone_files
from world.airspace.zone_times import is_active, parse_span
from world.airspace.zones import Zone
from world.airspace.zones_on_map import MAX_ZONE_DISTANCE, check_ends, make_zones, select_near_zones
from world.arrays import Floats
from world.elevation_formats import EMBEDDED
from world.errors import ArgumentError, ScenarioError, TerrainError
from world.files import absolute_path, did_you_mean, toml_text, write_atomically
from world.forecast.forecast import Forecast
from world.forecast.scenario_wind import ForecastSite, forecast_wind, read_table_forecast
from world.forecast.wind_field import PROFILE_HEIGHTS_M, fit_profile_line
from world.frames import GeoOrigin, PolyMap, fit_polymap, to_geo
from world.html_table import html_table
from world.map_positions import check_altitude, check_in_area, make_threats, map_coordinates, map_position
from world.radio import RadioLink, make_link, station_position
from world.raster import open_tiles, read_terrain, require_covered, tile_bounds
from world.raster_file import RasterFile
from world.scenario_file import check_scenario, checked_table, parse_scenario, read_scenario_text
from world.scenario_tables import (
    MAX_ZONES,
    OWN_GUIDANCE,
    SCALE_RATIOS,
    AreaTable,
    FlightTable,
    LimitsTable,
    LinkTable,
    OriginTable,
    PlannerTable,
    ScenarioFile,
    TerrainTable,
    ThreatTable,
    WindTable,
    ZoneTable,
    names_folder,
)
from world.terrain import Peak, Terrain, make_flat_terrain, make_peaks_terrain
from world.threats import Threats
from world.wind import Wind
from world.wording import count_text

# ----------------------------------------------------------------------
# The scenario, from a built-in name, a file, a plan or a log.

# Radius of a threat below which a note asks for its unit, m; no missile or radar has one as small.
MIN_PLAUSIBLE_RADIUS_M = 10.0
# Tolerance of positions in a forecast, deg: 1 m.
_GEO_TOLERANCE_DEG = 1e-5
# Width of terrain that is kept around the area, m: a flight may overshoot a corner at the map's edge.
GROUND_BUFFER = 1000.0


# Classes of the fields of a scenario that are neither numbers nor tables.
_FIELD_CLASSES = {"spec": ScenarioFile, "origin": GeoOrigin, "terrain": Terrain, "threats": Threats, "wind": Wind}

_Class = TypeVar("_Class")


def _with_clear_errors(scenario_class: type[_Class]) -> type[_Class]:
    """Decorate `Scenario` so that wrong constructor arguments raise a clear ArgumentError.

    The error names `make_scenario`.
    """
    initialise = scenario_class.__init__

    @wraps(initialise)
    def initialise_or_refuse(self: _Class, *args: object, **values: object) -> None:
        """Initialise an instance; raise an ArgumentError for wrong arguments."""
        try:
            initialise(self, *args, **values)
        except (TypeError, ValueError) as error:
            reason = str(error).removeprefix("Scenario.__init__() ")
            allowed = "planfly.make_scenario makes a scenario from another one, with other threats and tables"
            raise ArgumentError(f"Scenario: {reason}: {allowed}", field="Scenario", allowed=allowed) from error

    scenario_class.__init__ = initialise_or_refuse  # type: ignore[assignment]
    return scenario_class


@_with_clear_errors
@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Scenario:
    """Environment of one mission, in map axes (m) and radians.

    spec: the checked file, from which `scenario_from_spec` makes the same scenario again.
    origin: geographic position of east = north = 0.
    bounds: area, (2, 2) [[west, east], [south, north]].
    floor, ceiling: lowest and highest altitude, m AMSL.
    start, destination: (3,) east, north, altitude AMSL.
    start_course, destination_course: rad clockwise from north; None for any course.
    terrain: ground heights; None if no terrain was given (an external mission).
    limits, planner, flight: the file's tables of these names.
    zones: airspace zones to keep out of or to stay in.
    external: True if made around a mission file without a scenario: the bounds are then not a limit, and an empty list
    of threats means that threats are unknown.
    home: (3,) position of the aircraft on the ground before the flight; None if not stated.
    launch, landing: launch at home and landing strip; None for a flight that begins, or ends, in the air.
    returns: requirements on returns to launch, and RTL settings; None if the scenario states none.
    link: radio link to judge; None if the scenario states none.
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
    home: Floats | None = None
    launch: Launch | None = None
    landing: LandingStrip | None = None
    returns: ReturnRequirements | None = None
    link: RadioLink | None = None

    def __post_init__(self) -> None:
        """Check the types of the fields, and replace the arrays by read-only copies."""
        for name, field_class in _FIELD_CLASSES.items():
            value = getattr(self, name)
            if not isinstance(value, field_class) and (value is not None or name != "terrain"):
                raise TypeError(f"{name}: {type(value).__name__}: expected a {field_class.__name__}")
        for name in ("bounds", "start", "destination", *(("home",) if self.home is not None else ())):
            array, shape = np.array(getattr(self, name)), (2, 2) if name == "bounds" else (3,)
            if array.shape != shape or array.dtype.kind not in "fiu" or np.isnan(array).any():
                text = f"{array.dtype} of shape {array.shape}" if array.shape != shape else str(array.tolist())
                raise ValueError(f"{name}: {text}: expected an array {shape} of numbers")
            array = array.astype(np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def wind_velocity(self, position: Sequence[float], seconds: float = 0.0) -> tuple[float, float]:
        """Return the mean wind at a position and a time, m/s, east and north.

        position: east, north, up, m.
        seconds: time after take-off, s.

        The components of a forecast's wind are along true east and north, those of a stated wind along the axes of the
        map.

        >>> windy = with_wind(load_scenario("tight"), 5.0, math.radians(270.0), None)
        >>> windy.wind_velocity((0.0, 0.0, 75.0))
        (5.0, ...)
        """
        east, north = self.wind_velocities(np.array([position], dtype=np.float64), np.array([seconds]))[0].tolist()
        return east, north

    def wind_velocities(self, positions: Floats, seconds: Floats) -> Floats:
        """Return the mean wind at n positions and times, m/s, (n, 2) east and north; see `wind_velocity`.

        positions: east, north, up, m, (n, 3).
        seconds: times after take-off, s, (n,).
        """
        altitudes, field = np.ascontiguousarray(positions[:, 2], dtype=np.float64), self.wind.field
        if field is None:
            return self.wind.velocities_at(altitudes)
        # Two components of the deviation from the mean profile, and the altitude at which it applies.
        deviations = field.interpolate(seconds, *to_geo(self.origin, positions[:, 0], positions[:, 1]), altitudes)
        return self.wind.velocities_at(np.ascontiguousarray(deviations[:, 2])) + deviations[:, :2]

    @property
    def geo_map(self) -> PolyMap | None:
        """Polynomial map from east and north (m) to longitude and latitude (deg); None without a forecast."""
        if self.wind.field is None:
            return None

        def to_near_geo(east: Floats, north: Floats) -> tuple[Floats, Floats]:
            """Return longitude and latitude (deg); the longitude does not jump at 180 degrees."""
            latitudes, longitudes = to_geo(self.origin, east, north)
            return self.origin.lon_deg + (longitudes - self.origin.lon_deg + 180.0) % 360.0 - 180.0, latitudes

        return fit_polymap(to_near_geo, self.bounds, _GEO_TOLERANCE_DEG)

    def local_wind(self, position: Sequence[float], seconds: float) -> Wind:
        """Return the mean profile of the wind around a position at a time.

        position: east, north, up, m.
        seconds: time after take-off, s.

        Without a forecast, the result is the scenario's wind.
        """
        if self.wind.field is None:
            return self.wind
        up = float(position[2])
        column = np.array([(*position[:2], up + height) for height in PROFILE_HEIGHTS_M])
        winds = self.wind_velocities(column, np.full(len(column), seconds))
        profile = fit_profile_line(PROFILE_HEIGHTS_M, winds)
        return replace(
            self.wind,
            speed=profile.speed,
            from_course=profile.from_course,
            gradient=profile.gradient,
            reference_amsl=up,
            field=None,
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on zones that were changed or omitted, on inactive zones, and on implausibly small threats."""
        # One note on threats whose radius is so small that it may be in kilometres.
        threats = self.threats
        small_radii = [
            f"the {kind} radius of {name} is {radius:g} m"
            for kind, radii in (("kill", threats.kill_radius), ("detection", threats.detection_radius))
            for name, radius in zip(threats.names, radii.tolist(), strict=True)
            if 0.0 < radius < MIN_PLAUSIBLE_RADIUS_M
        ]
        small_threat_notes = []
        if small_radii:
            others = f" (and {count_text(len(small_radii) - 1, 'more threat')})" if len(small_radii) > 1 else ""
            small_threat_notes = [f"{small_radii[0]}{others}: radii are in metres, not kilometres"]
        notes = [*(self.spec.zone_notes or ()), *small_threat_notes]
        timed_tables = [table for table in self.spec.zones or () if table.times]
        if timed_tables and self.spec.at is None:
            count = "1 zone has times of activity, but is treated as active"
            if len(timed_tables) > 1:
                count = f"{len(timed_tables):,} zones have times of activity, but are treated as active"
            notes.append(f"{count} at all times, because no time of flight is given (--at)")
        elif timed_tables:
            span = " to ".join(f"{time:%Y-%m-%d %H:%M}" for time in parse_span(str(self.spec.at)))
            inactive_count = len(self.spec.zones or ()) - len(self.zones)
            verb = "is" if inactive_count == 1 else "are"
            notes.append(
                f"{inactive_count:,} of {count_text(len(timed_tables), 'zone')} with times of activity {verb} "
                f"not active from {span} UTC and {verb} ignored"
            )
        return tuple(notes)

    def __repr__(self) -> str:
        """Return a short description: name, distance, and numbers of threats and zones."""
        distance = math.dist(self.start, self.destination) / 1000.0
        counts = f"{count_text(len(self.threats), 'threat')}, {count_text(len(self.zones), 'zone')}"
        return f"<Scenario {self.name}: {distance:.1f} km, {counts}>"

    def _repr_html_(self) -> str:
        """Return an HTML table for notebooks."""
        ground, wind, limits = self.terrain, self.wind, self.limits
        flight, steering = self.flight, self.flight.steering
        corridor = self.limits.corridor_m
        airspeed = "the aircraft's" if flight.airspeed_mps is None else f"{flight.airspeed_mps:g} m/s"
        autopilot = f"planfly, {steering.guidance}" if steering.autopilot == OWN_GUIDANCE else steering.autopilot
        rows = [
            ("origin", f"{self.origin.lat_deg:.5f}, {self.origin.lon_deg:.5f}"),
            *(
                (name, f"east {point[0]:.0f} m, north {point[1]:.0f} m, {point[2]:.0f} m AMSL")
                for name, point in (("start", self.start), ("destination", self.destination))
            ),
            ("terrain", "none" if ground is None else self.spec.terrain.kind),
            ("threats, zones", f"{len(self.threats)}, {len(self.zones)}"),
            ("wind", f"{wind.speed:g} m/s from {math.degrees(wind.from_course):.0f}°, turbulence {wind.turbulence}"),
            ("clearance", f"at least {limits.min_clearance_m:g} m above ground"),
            ("aircraft", flight.aircraft),
            ("airspeed", airspeed),
            ("autopilot", autopilot if flight.params is None else f"{autopilot}, {flight.params}"),
            ("navigation", steering.nav),
            ("corridor", "as wide as the autopilot needs" if corridor is None else f"{corridor:g} m to each side"),
            *(("note", note) for note in self.notes),
        ]
        return html_table(f"Scenario {self.name}", rows)

    def to_toml(self, path: str | Path) -> None:
        """Write the scenario as a TOML file, from which `planfly.plan` and other functions make it again.

        path: the file, replaced if it exists.

        Elevation files, an aircraft's folder and a parameter file are named by their absolute paths. Raises
        ScenarioError for a scenario that was made around a mission, and OSError for a file that cannot be written.

        >>> from tempfile import TemporaryDirectory
        >>> scenario = load_scenario("hard-07")
        >>> with TemporaryDirectory() as folder:
        ...     scenario.to_toml(folder + "/mine.toml")
        ...     load_scenario(folder + "/mine.toml").to_json() == scenario.to_json()
        True
        """
        if self.external:
            reason = "made around a mission, so it has no file; planfly.make_scenario makes a scenario with an area"
            raise ScenarioError(f"{self.name}: {reason}", file=self.name)
        write_atomically(Path(path), toml_text(self.to_json()))

    def to_json(self) -> dict[str, Any]:
        """Return the scenario as plain JSON data, from which `scenario_from_spec` makes it again."""
        stated_spec = self.spec.model_copy(update={"flight": self.spec.flight.with_stated_defaults()})
        return stated_spec.model_dump(mode="json", exclude_none=True)


@cache
def embedded_scenarios() -> dict[str, ScenarioFile]:
    """Return the checked files of the scenarios that planfly ships, by name, in a fixed order.

    >>> embedded_scenarios()["tight"].limits.min_clearance_m
    60.0
    """
    folder = resources.files("world") / "scenarios"
    specs = {}
    for entry in sorted(folder.iterdir(), key=lambda file: (file.name != "jacksboro.toml", file.name)):
        if entry.name.endswith(".toml"):
            specs[entry.name.removesuffix(".toml")] = parse_scenario(entry.read_text(encoding="utf-8"), entry.name)
    return specs


def load_scenario(name_or_path: str, terrain: str | None = None) -> Scenario:
    """Read a scenario by its built-in name or from a TOML file.

    terrain: elevation file that replaces the scenario's terrain; None to keep the scenario's terrain.

    Raises ScenarioError for a file that is missing or has a fault, and TerrainError for a fault of its elevation file.

    >>> scenario = load_scenario("tight")
    >>> scenario.start.tolist(), scenario.destination.tolist(), len(scenario.threats)
    ([0.0, 0.0, 75.0], [2600.0, 0.0, 75.0], 28)
    """
    names = embedded_names()
    if name_or_path in names:
        entry = resources.files("world") / "scenarios" / f"{name_or_path}.toml"
        return scenario_from_spec(
            parse_scenario(entry.read_text(encoding="utf-8"), name_or_path), name_or_path, terrain=terrain
        )
    path = Path(name_or_path)
    try:
        is_missing = not path.exists()
    except OSError:  # a name that is too long
        is_missing = True
    if is_missing:
        # Files for a suggestion; relative if the path is relative.
        try:
            sibling_files = [str(file) for file in sorted(path.parent.glob("*.toml"))]
        except OSError:
            sibling_files = []
        suggestion = did_you_mean(name_or_path, [*names, *sibling_files])
        message = f"{name_or_path}: no such file, and not a built-in scenario ({', '.join(names)}){suggestion}"
        raise ScenarioError(message, file=name_or_path)
    spec = parse_scenario(read_scenario_text(path), str(path))
    return scenario_from_spec(spec, str(path), base=path.parent, terrain=terrain)


def embedded_names() -> list[str]:
    """Return the names of the scenarios that planfly ships; the default is first.

    >>> embedded_names()[0]
    'jacksboro'
    """
    folder = resources.files("world") / "scenarios"
    names = sorted(file.name.removesuffix(".toml") for file in folder.iterdir() if file.name.endswith(".toml"))
    return sorted(names, key=lambda name: name != "jacksboro")


def scenario_from_spec(
    spec: ScenarioFile | dict[str, Any],
    source: str,
    *,
    base: Path | None = None,
    terrain: str | None = None,
    ground: Terrain | None = None,
    external: bool = False,
    is_stored: bool = False,
) -> Scenario:
    """Make a scenario from a checked scenario file, or from the data of `Scenario.to_json`.

    source: name of the file in messages.
    base: folder of relative paths.
    terrain: an elevation file that replaces the scenario's terrain; None to keep the scenario's terrain.
    ground: terrain that is already loaded (from a log); None to read it.
    external: see `Scenario`.
    is_stored: True for the scenario of a log, which has the wind and the ground of its flight; no forecast is read.
    Raises ScenarioError, TerrainError and ForecastError for a file that is missing or has a fault.

    >>> again = scenario_from_spec(load_scenario("tight").to_json(), "a plan")
    >>> again.name, again.bounds.tolist()
    ('tight', [[-300.0, 2900.0], [-150.0, 150.0]])
    """
    spec = spec if isinstance(spec, ScenarioFile) else check_scenario(spec, source)
    # Zones of files are stored with the other zones, so that a log without the files makes the same scenario.
    file_zones = FileZones() if spec.zones_file is None else read_zone_files(spec.zones_file, source, base)
    spec = spec.model_copy(update={"zones_file": None})
    if terrain is not None:
        spec, base = _replace_terrain(spec, terrain, source, base), None
    raster = None
    if spec.terrain.kind == "dem" and ground is None:
        raster, terrain_table = _open_terrain(spec.terrain, source if terrain is None else "terrain", base)
        spec = spec.model_copy(update={"terrain": terrain_table})
    if spec.origin is not None:
        origin = GeoOrigin(spec.origin.lat_deg, spec.origin.lon_deg)
    else:
        origin = raster.centre if raster is not None else GeoOrigin(46.0, 8.0)
    if spec.area is not None:
        bounds = np.array([spec.area.east_m, spec.area.north_m])
    elif raster is not None:
        bounds = tile_bounds(raster, origin)
    else:
        raise ScenarioError(f"{source}: area: missing, and no elevation file implies it", file=source, field="area")
    if raster is not None:
        # The terrain extends to the ground station of the link if the station lies outside the area.
        require_covered(raster, origin, bounds)
        box = _extend_box(raster, origin, bounds, station_position(spec.link, origin))
        ground = read_terrain(raster, origin, box, GROUND_BUFFER)
    elif ground is None and spec.terrain.kind == "flat":
        ground = make_flat_terrain(bounds, float(spec.terrain.amsl_m or 0.0), 5 * GROUND_BUFFER)
    elif ground is None and spec.terrain.kind == "peaks":
        peaks = [Peak(peak.east_m, peak.north_m, peak.height_m, peak.sigma_m) for peak in spec.terrain.peak or []]
        ground = make_peaks_terrain(bounds, peaks, GROUND_BUFFER)
    if ground is not None and spec.terrain.vertical_error_m is not None:
        ground = replace(ground, vertical_error=spec.terrain.vertical_error_m)
    # The paths of the aircraft's folder, the parameter file and the forecast become absolute.
    flight, wind, flight_paths = spec.flight, spec.wind, {}
    if names_folder(flight.aircraft):
        flight_paths["aircraft"] = absolute_path(Path(base or "", flight.aircraft))
    if flight.params is not None:
        flight_paths["params"] = absolute_path(Path(base or "", flight.params))
    if wind.forecast is not None:
        wind = wind.model_copy(update={"forecast": absolute_path(Path(base or "", wind.forecast))})
    spec = spec.model_copy(update={"flight": flight.model_copy(update=flight_paths), "wind": wind})
    # Origin and area from the elevation file are stored, so that a log without the file makes the same scenario.
    origin_table = checked_table(
        lambda: OriginTable(lat_deg=origin.lat_deg, lon_deg=origin.lon_deg), f"{source}: origin"
    )
    area_table = spec.area or checked_table(
        lambda: AreaTable(east_m=bounds[0].tolist(), north_m=bounds[1].tolist()), f"{source}: area"
    )
    spec = _with_file_zones(
        spec.model_copy(update={"origin": origin_table, "area": area_table}), file_zones, source, origin, bounds
    )
    replaced = terrain is not None or is_stored
    scenario = _assemble_scenario(spec, source, origin, bounds, ground, external=external, replaced=replaced)
    return scenario if is_stored else _with_forecast_wind(scenario)


def _replace_terrain(spec: ScenarioFile, terrain: str, source: str, base: Path | None) -> ScenarioFile:
    """Return a scenario file's data with another terrain and the same map origin.

    terrain: path of the new elevation file.
    base: folder of the scenario's relative paths.

    If the data states no origin, the origin is the centre of the old elevation file; the result then states it.
    """
    changes: dict[str, Any] = {
        "terrain": checked_table(lambda: TerrainTable(kind="dem", path=terrain), "terrain"),
    }
    if spec.origin is None and spec.terrain.kind == "dem":
        centre = _open_terrain(spec.terrain, source, base)[0].centre
        changes["origin"] = checked_table(
            lambda: OriginTable(lat_deg=centre.lat_deg, lon_deg=centre.lon_deg), f"{source}: origin"
        )
    return spec.model_copy(update=changes)


def _with_file_zones(
    spec: ScenarioFile, file_zones: FileZones, source: str, origin: GeoOrigin, bounds: Floats
) -> ScenarioFile:
    """Return a scenario file's data with the zones of its zone files.

    file_zones: zones of the files, and notes on reading them.
    source: name of the files in messages.
    bounds: [[west, east], [south, north]] of the scenario's area, (2, 2) m.

    Zones that are not near the scenario's area are omitted; a note states their number.
    """
    if not file_zones.zones and not file_zones.notes:
        return spec
    zones_nearby = select_near_zones(file_zones.zones, source, origin, bounds)
    notes = [*(spec.zone_notes or ()), *file_zones.notes]
    if far_count := len(file_zones.zones) - len(zones_nearby):
        notes.append(
            f"{source}: {far_count:,} of {count_text(len(file_zones.zones), 'zone')} lie more than "
            f"{MAX_ZONE_DISTANCE / 1000.0:g} km from the area and are ignored"
        )
    changes = {"zones": [*(spec.zones or ()), *zones_nearby] or None, "zone_notes": notes or None}
    return spec.model_copy(update=changes)


def _active_zones(spec: ScenarioFile) -> list[ZoneTable]:
    """Return the zones that may be active during the flight; all zones if the scenario states no time."""
    if spec.at is None:
        return list(spec.zones or ())
    span = parse_span(spec.at)
    return [table for table in spec.zones or () if is_active(table.times or (), *span)]


def _open_terrain(table: TerrainTable, source: str, base: Path | None) -> tuple[RasterFile, TerrainTable]:
    """Open a scenario's elevation file or files as one raster.

    Also return a [terrain] table that identifies them.

    base: folder of relative paths.

    The returned table has absolute paths and the SHA-256. Raises ScenarioError if the stated SHA-256 differs.
    """
    paths = [str(table.path)] if not isinstance(table.path, list) else table.path
    path_text = ", ".join(paths)
    try:
        raster = open_tiles(paths, base, table.height_datum)
    except TerrainError as error:
        raise TerrainError.from_error(error, source, "terrain.path", path_text) from error
    if table.sha256 not in (None, raster.sha256):
        raise ScenarioError.at(source, "terrain.path", path_text, "the file has changed: its SHA-256 differs")
    absolute_paths = [path if path in EMBEDDED else absolute_path(Path(base or "", path)) for path in paths]
    stored_path = absolute_paths if isinstance(table.path, list) else absolute_paths[0]
    return raster, table.model_copy(update={"path": stored_path, "sha256": raster.sha256})


def _assemble_scenario(
    spec: ScenarioFile,
    source: str,
    origin: GeoOrigin,
    bounds: Floats,
    ground: Terrain | None,
    *,
    external: bool,
    replaced: bool,
) -> Scenario:
    """Make a scenario from the data of its file, its map and its terrain.

    bounds: [[west, east], [south, north]] of the area, (2, 2) m.
    replaced: True if the ground may differ from the ground for which the scenario was made.
    """
    area = spec.area
    floor = area.floor_amsl_m if area and area.floor_amsl_m is not None else -500.0
    max_ground = float(np.nanmax(ground.heights)) if ground is not None else 3000.0
    ceiling = area.ceiling_amsl_m if area and area.ceiling_amsl_m is not None else max_ground + 1000.0
    if not replaced:
        for name, end in (("start", spec.start), ("destination", spec.destination)):
            check_in_area(name, np.array(map_coordinates(end, origin)), source, bounds, origin)
    start = map_position(spec.start, "start", source, origin, ground)
    destination = map_position(spec.destination, "destination", source, origin, ground)
    # If the terrain was replaced, the verdict reports ends below the new ground.
    ends = () if replaced else (("start", start), ("destination", destination))
    for name, point in ends:
        check_altitude(name, point, source, floor, ceiling, ground)
    zones = make_zones(_active_zones(spec), source, origin, ground)
    # The ends of an external mission are its own waypoints: the verdict reports zones that they violate.
    check_ends(zones, source, ends if zones and not external else (), ground)
    if not external and math.dist(start[:2], destination[:2]) < 10.0:
        text = f"{source}: destination: less than 10 m horizontally from the start"
        raise ScenarioError(text, file=source, field="destination")
    table, direction = spec.wind, math.radians(spec.wind.from_deg)
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
        wind=Wind(table.speed_mps, direction, table.gradient, table.turbulence, table.seed, float(start[2])),
        external=external,
        zones=zones,
        home=make_home(spec.home, source, origin, ground, bounds, start),
        launch=make_launch(spec.launch),
        landing=make_landing(spec.landing, source, origin, ground, bounds),
        returns=make_return_requirements(spec.returns, source, origin, ground, allows_underground=replaced),
        link=make_link(spec.link, source, origin, ground),
    )


def _extend_box(raster: RasterFile, origin: GeoOrigin, bounds: Floats, position: tuple[float, float] | None) -> Floats:
    """Return an area extended to contain a position.

    The area is unchanged if the elevation file does not cover the position.

    bounds: [[west, east], [south, north]] of the area, (2, 2) m.
    position: east and north, m; None to return the area unchanged.
    """
    if position is None:
        return bounds
    point = np.array(position)
    lat, lon = to_geo(origin, point[:1], point[1:])
    (col, row), (rows, cols) = raster.to_pixels(lon, lat), raster.shape
    # False for a position that the file's coordinate system cannot express (NaN or inf).
    if not ((col >= 0.0) & (col <= cols - 1.0) & (row >= 0.0) & (row <= rows - 1.0)).all():
        return bounds
    return np.stack([np.minimum(bounds[:, 0], point), np.maximum(bounds[:, 1], point)], axis=1)


def with_ground_at(scenario: Scenario, position: tuple[float, float]) -> Scenario:
    """Return a scenario whose terrain extends to a position (east, north, m).

    The elevation file must have data there; otherwise the terrain is unchanged.

    The scenario itself is returned if its terrain already covers the position, or if its terrain is not from an
    elevation file. Raises TerrainError or ScenarioError for a file that cannot be read or that has changed.
    """
    terrain, table = scenario.terrain, scenario.spec.terrain
    if terrain is None or table.kind != "dem" or math.isfinite(float(terrain.height(*position))):
        return scenario
    raster, _ = _open_terrain(table, scenario.name, None)
    box = _extend_box(raster, scenario.origin, scenario.bounds, position)
    if box is scenario.bounds:
        return scenario
    extended_terrain = read_terrain(raster, scenario.origin, box, GROUND_BUFFER)
    return replace(scenario, terrain=replace(extended_terrain, vertical_error=terrain.vertical_error))


def lat_lon_of_points(scenario: Scenario, points: Floats) -> tuple[Floats, Floats]:
    """Convert map positions (..., 3), m, to latitudes and longitudes, degrees.

    >>> scenario = load_scenario("tight")
    >>> lat, lon = lat_lon_of_points(scenario, scenario.destination)
    >>> float(lat.round(5)), float(lon.round(5))
    (46.0, 8.03356)
    """
    return to_geo(scenario.origin, points[..., 0], points[..., 1])


# ----------------------------------------------------------------------
# Variants of a scenario: another terrain, wind, flight or planner, or more threats.


def with_terrain(scenario: Scenario, terrain: str) -> Scenario:
    """Return a scenario with the terrain of another elevation file.

    terrain: path of the elevation file.

    Start and destination keep their altitudes AMSL; threats on the ground are placed on the new ground. Raises
    TerrainError for a file that cannot be read or does not cover the area.

    >>> with_terrain(load_scenario("jacksboro"), "jacksboro").terrain.source
    'jacksboro'
    """
    spec = with_amsl_endpoints(scenario.to_json(), scenario.start, scenario.destination)
    return scenario_from_spec(spec, scenario.name, terrain=terrain, external=scenario.external)


def with_amsl_endpoints(spec: dict[str, Any], start: Floats, destination: Floats) -> dict[str, Any]:
    """Return a scenario's JSON data in which start and destination have altitudes AMSL.

    start, destination: (3,) m, altitude AMSL. An altitude AMSL replaces a height above ground (`height_m`).

    >>> data = {"start": {"east_m": 0.0, "north_m": 0.0, "height_m": 50.0}, "destination": {"amsl_m": 300.0}}
    >>> with_amsl_endpoints(data, np.array([0.0, 0.0, 250.0]), np.array([900.0, 0.0, 300.0]))["start"]
    {'east_m': 0.0, 'north_m': 0.0, 'amsl_m': 250.0}
    """
    changed_spec = dict(spec)
    for key, point in (("start", start), ("destination", destination)):
        if isinstance(spec.get(key), dict):
            other_entries = {name: value for name, value in spec[key].items() if name != "height_m"}
            changed_spec[key] = other_entries | {"amsl_m": float(point[2])}
    return changed_spec


def with_ground(scenario: Scenario, ground: Terrain) -> Scenario:
    """Return a scenario with another ground, such as the real ground that differs from the map's terrain.

    ground: the other ground.

    Objects on the ground move with it: home, and threats and rally points without an altitude AMSL. Heights above
    ground of zones and of the link's station are measured from the new `Scenario.terrain`. Start, destination and
    ceiling keep their altitudes; the scenario then states them AMSL.

    >>> scenario = load_scenario("jacksboro")
    >>> raised = with_ground(scenario, replace(scenario.terrain, heights=scenario.terrain.heights + 8))
    >>> (raised.threats.position - scenario.threats.position)[0].round(3).tolist()
    [0.0, 0.0, 8.0]
    """
    spec, source = scenario.spec, scenario.name
    changes: dict[str, Any] = {
        "start": spec.start.model_copy(update={"height_m": None, "amsl_m": float(scenario.start[2])}),
        "destination": spec.destination.model_copy(update={"height_m": None, "amsl_m": float(scenario.destination[2])}),
    }
    if spec.area is not None:
        changes["area"] = spec.area.model_copy(update={"ceiling_amsl_m": scenario.ceiling})
    return replace(
        scenario,
        spec=spec.model_copy(update=changes),
        terrain=ground,
        threats=make_threats(spec.threats, source, scenario.origin, ground),
        home=make_home(spec.home, source, scenario.origin, ground, scenario.bounds, scenario.start),
        returns=make_return_requirements(spec.returns, source, scenario.origin, ground, allows_underground=True),
    )


def with_wind(scenario: Scenario, speed: float | None, from_course: float | None, turbulence: str | None) -> Scenario:
    """Return a scenario with another wind; an argument of None keeps the present value.

    speed, from_course: speed, m/s, and direction that the wind blows from, rad; either both or neither is given. They
        replace a forecast.
    turbulence: "none", "light" or "moderate".

    Raises ScenarioError for a wind that is not allowed in a scenario file.

    >>> with_wind(load_scenario("tight"), 5.0, math.radians(270.0), "light").wind.velocity_at(75.0)
    (5.0, ...)
    """
    table = scenario.spec.wind
    changes: dict[str, Any] = {}
    if speed is not None and from_course is not None:
        changes |= {"speed_mps": speed, "from_deg": math.degrees(from_course), "forecast": None}
        if table.forecast is not None:
            changes["gradient"] = 0.0
    if turbulence is not None:
        changes["turbulence"] = turbulence
    changed_table = checked_table(lambda: WindTable(**(table.model_dump() | changes)), f"{scenario.name}: wind")
    spec = scenario.spec.model_copy(update={"wind": changed_table})
    wind = replace(
        scenario.wind,
        speed=spec.wind.speed_mps,
        from_course=math.radians(spec.wind.from_deg),
        gradient=spec.wind.gradient,
        turbulence=spec.wind.turbulence,
    )
    changed_scenario = replace(scenario, spec=spec, wind=wind)
    if speed is None:
        return changed_scenario
    return replace(changed_scenario, wind=replace(wind, field=None, forecast=None))


def with_forecast(scenario: Scenario, forecast: str, source: str = "") -> Scenario:
    """Return a scenario with the wind of a weather forecast, from its time of flight onwards.

    forecast: file that `world.forecast.read_forecast` reads.
    source: beginning of messages about the file.

    Without a time of flight, the scenario has no wind until `with_flight_time` states one. Raises ForecastError for a
    file that cannot be used, or that does not cover the start and the destination.
    """
    changes = {"forecast": absolute_path(Path(forecast)), "speed_mps": 0.0, "from_deg": 0.0, "gradient": 0.0}
    table = checked_table(
        lambda: WindTable(**(scenario.spec.wind.model_dump() | changes)), f"{source or scenario.name}: wind"
    )
    return _with_forecast_wind(replace(scenario, spec=scenario.spec.model_copy(update={"wind": table})))


def without_forecast(scenario: Scenario) -> Scenario:
    """Return a scenario whose wind is the mean profile of its forecast, without the forecast itself.

    A scenario without a forecast is returned unchanged.
    """
    table = scenario.spec.wind
    if table.forecast is None:
        return scenario
    spec = scenario.spec.model_copy(update={"wind": table.model_copy(update={"forecast": None})})
    return replace(scenario, spec=spec, wind=replace(scenario.wind, field=None, forecast=None))


def read_scenario_forecast(scenario: Scenario) -> Forecast:
    """Read the forecast that a scenario's [wind] table names, for the area of the scenario.

    Raises ForecastError for a file that cannot be used.
    """
    ground = math.nan
    if scenario.terrain is not None:
        ground = float(scenario.terrain.height(scenario.start[0], scenario.start[1]))
    start_ground = float(scenario.start[2]) if math.isnan(ground) else ground
    return read_table_forecast(scenario.spec.wind, scenario.origin, scenario.bounds, start_ground)


def _with_forecast_wind(scenario: Scenario) -> Scenario:
    """Return the scenario with the wind of its forecast.

    The scenario must name a forecast, and the date and time of the flight.

    Of an ensemble, member 0 is used. Any other scenario is returned unchanged. Raises ForecastError if the forecast
    cannot be used.
    """
    if scenario.spec.wind.forecast is None or scenario.spec.at is None:
        return scenario
    return with_forecast_member(scenario, read_scenario_forecast(scenario), 0)


def with_forecast_member(scenario: Scenario, forecast: Forecast, member: int) -> Scenario:
    """Return a scenario with the wind of one member of its forecast, from its time of flight onwards.

    member: index of the member, from 0.

    Raises ForecastError if the forecast does not cover the start and the destination at this time.
    """
    max_ground = -math.inf if scenario.terrain is None else float(np.nanmax(scenario.terrain.heights))
    site = ForecastSite(scenario.origin, (scenario.start, scenario.destination), max_ground)
    wind, table = forecast_wind(scenario.spec.wind, forecast, str(scenario.spec.at), site, member)
    return replace(scenario, spec=scenario.spec.model_copy(update={"wind": table}), wind=wind)


def with_link(scenario: Scenario, **entries: Any) -> Scenario:
    """Return a scenario with a changed radio link; a value of None keeps the present value.

    entries: values by the keys of the scenario's [link] table.

    A position in degrees replaces a position in metres. If the ground station is outside the terrain that was read from
    an elevation file, the terrain is read again so that it includes the station.
    Raises ScenarioError for an entry that is not allowed in a scenario file, and for a link without frequency, power or
    sensitivity. Raises TerrainError for an elevation file that cannot be read.

    >>> linked = with_link(load_scenario("tight"), frequency_mhz=1000.0, power_dbm=20.0, sensitivity_dbm=-90.0)
    >>> linked.link.allowed_loss
    100.0
    """
    table = scenario.spec.link
    changes = {name: value for name, value in entries.items() if value is not None}
    stated = {} if table is None else table.model_dump(exclude_none=True)
    if "lat_deg" in changes:
        stated = {name: value for name, value in stated.items() if name not in ("east_m", "north_m")}
    new_table = checked_table(lambda: LinkTable(**(stated | changes)), f"{scenario.name}: link")
    station = station_position(new_table, scenario.origin)
    scenario = scenario if station is None else with_ground_at(scenario, station)
    link = make_link(new_table, scenario.name, scenario.origin, scenario.terrain)
    return replace(scenario, spec=scenario.spec.model_copy(update={"link": new_table}), link=link)


def with_flight(scenario: Scenario, **changes: Any) -> Scenario:
    """Return a scenario with changed entries of [flight]; a value of None keeps the present value.

    changes: values by the keys of [flight].

    A given guidance law replaces the autopilot and its parameters. A given autopilot, or given parameters, replace the
    guidance law. Raises ScenarioError for a value that is not allowed in a scenario file.

    >>> with_flight(load_scenario("tight"), airspeed_mps=28.0, nav=None).flight.airspeed_mps
    28.0
    """
    new_entries = {key: value for key, value in changes.items() if value is not None}
    entries = scenario.flight.model_dump() | ({"aircraft_by_default": None} if "aircraft" in new_entries else {})
    if "guidance" in new_entries or "params" in new_entries or "autopilot" in new_entries:
        # Parameters without an autopilot belong to the autopilot that the scenario names, if that has parameters.
        has_parameters = entries["autopilot_from"] is not None or entries["autopilot"] in (None, OWN_GUIDANCE)
        names_autopilot = bool(set(new_entries) & {"guidance", "autopilot"}) or has_parameters
        entries |= {"guidance": None, "params": None, "autopilot_from": None}
        entries |= {"autopilot": None, "arduplane_version": None, "px4_version": None} if names_autopilot else {}
    table = checked_table(lambda: FlightTable(**(entries | new_entries)), f"{scenario.name}: flight")
    return replace(scenario, spec=scenario.spec.model_copy(update={"flight": table}), flight=table)


def without_ground_phases(scenario: Scenario) -> Scenario:
    """Return a scenario without launch and landing, whose flights begin and end in the air.

    >>> field = without_ground_phases(load_scenario("jacksboro-field"))
    >>> field.launch, field.landing, "landing" in field.to_json()
    (None, None, False)
    """
    if scenario.launch is None and scenario.landing is None:
        return scenario
    spec = scenario.spec.model_copy(update={"launch": None, "landing": None})
    return replace(scenario, spec=spec, launch=None, landing=None)


def with_zones(scenario: Scenario, tables: Sequence[ZoneTable], source: str, notes: Sequence[str] = ()) -> Scenario:
    """Return a scenario with additional zones; zones far from its area are left out.

    tables: the additional zones.
    source: name of the zones in messages.
    notes: notes on reading their file, which the scenario keeps.

    Raises ScenarioError for an invalid shape, for a level above ground without terrain, and for more zones than a
    scenario may have. Also raises ScenarioError if the start or the destination violates a zone, except in an external
    scenario.

    >>> mast = ZoneTable(name="mast", kind="exclusion", east_m=1300.0, north_m=400.0, radius_m=200.0)
    >>> [zone.name for zone in with_zones(load_scenario("tight"), [mast], "masts.geojson").zones]
    ['mast']
    """
    previous_count = len(scenario.spec.zones or ())
    file_zones = FileZones(list(tables), list(notes))
    spec = _with_file_zones(scenario.spec, file_zones, source, scenario.origin, scenario.bounds)
    added_tables = (spec.zones or [])[previous_count:]
    if previous_count + len(added_tables) > MAX_ZONES:
        added_text = count_text(len(added_tables), "zone")
        raise ScenarioError(
            f"{source}: {added_text} cannot be added: a scenario has at most {MAX_ZONES:,} zones", file=source
        )
    active_tables = _active_zones(spec.model_copy(update={"zones": added_tables}))
    zones = make_zones(active_tables, source, scenario.origin, scenario.terrain)
    ends = (("start", scenario.start), ("destination", scenario.destination))
    check_ends(zones, source, () if scenario.external else ends, scenario.terrain)
    return replace(scenario, spec=spec, zones=(*scenario.zones, *zones))


def with_flight_time(scenario: Scenario, at: str | None) -> Scenario:
    """Return a scenario with another time of flight.

    The time selects its active zones and the wind of its forecast.

    at: time span as `world.airspace.zone_times.parse_span` reads it; None to return the scenario unchanged.

    Raises ScenarioError for an invalid time.

    >>> with_flight_time(load_scenario("tight"), "2026-05-01T10:00Z").spec.at
    '2026-05-01T10:00Z'
    """
    if at is None:
        return scenario
    try:
        parse_span(at)
    except ValueError as error:
        raise ScenarioError.of_argument("at", at, str(error)) from error
    spec = scenario.spec.model_copy(update={"at": at})
    zones = make_zones(_active_zones(spec), scenario.name, scenario.origin, scenario.terrain)
    return _with_forecast_wind(replace(scenario, spec=spec, zones=zones))


def with_threats(
    scenario: Scenario,
    added_threats: Sequence[Mapping[str, Any]],
    source: str,
    preceding: Sequence[ThreatTable] = (),
) -> Scenario:
    """Return a scenario with additional threats.

    added_threats: values of each threat, by the keys of [[threats]].
    source: origin of the threats in messages, such as "--threat".
    preceding: tables of threats to insert before the added threats.

    A scale that is not given follows from its radius. The ratio of scale to radius is then the median ratio of the
    scenario's threats, or by default a quarter for kill and a third for detection. Raises ScenarioError for a threat
    that is not allowed in a scenario file, and for a threat on the ground outside the terrain data.

    >>> threat = {"east_m": 1300.0, "north_m": 90.0, "kill_radius_m": 20.0}
    >>> more = with_threats(load_scenario("tight"), [threat], "--threat")
    >>> more.threats.names[-1], float(more.threats.kill_radius[-1])
    ('pop-up 1', 20.0)
    """

    def scale_ratio(radius: Floats, scale: Floats, default: float) -> float:
        """Return the median ratio of scale to radius; the default if there is no radius."""
        has_radius = radius > 0.0
        return float(np.median(scale[has_radius] / radius[has_radius])) if has_radius.any() else default

    threats = scenario.threats
    ratios = {
        "kill": scale_ratio(threats.kill_radius, threats.kill_scale, SCALE_RATIOS["kill"]),
        "detection": scale_ratio(threats.detection_radius, threats.detection_scale, SCALE_RATIOS["detection"]),
    }
    tables = [*scenario.spec.threats, *preceding]
    for index, threat in enumerate(added_threats):
        data: dict[str, Any] = {"name": f"pop-up {len(preceding) + index + 1}", **threat}
        for kind, ratio in ratios.items():
            radius = data.get(f"{kind}_radius_m")
            if isinstance(radius, int | float):
                data.setdefault(f"{kind}_scale_m", radius * ratio)
        row = f"{source}.{index}" if len(added_threats) > 1 else source
        tables.append(checked_table(partial(ThreatTable, **data), row))
        east, north = map_coordinates(tables[-1], scenario.origin)
        if scenario.terrain is not None and math.isnan(scenario.terrain.height(east, north)):
            reason = f"east {east:g} m, north {north:g} m: outside the terrain data"
            raise ScenarioError.of_argument(row, (east, north), reason, shown="")
    spec = scenario.spec.model_copy(update={"threats": tables})
    return replace(scenario, spec=spec, threats=make_threats(tables, source, scenario.origin, scenario.terrain))


def with_planner(scenario: Scenario, source: str, **changes: Any) -> Scenario:
    """Return a scenario with changed keys of [planner].

    source: origin of the values in messages, such as "--seed".
    changes: values by key.

    Raises ScenarioError for a value that is not allowed in a scenario file.

    >>> with_planner(load_scenario("tight"), "--seed", seed=7).planner.seed
    7
    """
    table = scenario.planner.model_dump() | changes
    changed_table = checked_table(lambda: PlannerTable(**table), source)
    return replace(scenario, spec=scenario.spec.model_copy(update={"planner": changed_table}), planner=changed_table)
