"""Tables of a scenario file as pydantic models.

They reject unknown keys, NaN and out-of-range values.

The models mirror the TOML key for key.  `world.scenario_file` reads a file into them, and `world.scenario` turns them
into a `Scenario`.
"""

from collections.abc import Callable
from typing import Annotated, Any, Literal, NamedTuple, get_args

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, field_validator, model_validator

from world.airspace.zone_times import parse_period, parse_span
from world.elevation_formats import MAX_TILES
from world.height_datum import MAX_SEA_LEVEL, NamedDatum, StatedDatum

# ----------------------------------------------------------------------
# Numbers, names and choices of a scenario file with their allowed ranges, shared by its tables.

# Largest distance of a position from the map's origin along either axis, m.
MAP_EXTENT = 500_000.0


def check_no_line_break(text: str) -> str:
    """Return the text; raise ValueError if it is not a single printable line."""
    if not text.isprintable():
        raise ValueError("control characters are not allowed")
    return text


def in_range(
    min_value: float, max_value: float, *, exclude_min: bool = False, exclude_max: bool = False, also: str = ""
) -> AfterValidator:
    """Make a pydantic validator that allows ``min_value``..``max_value``.

    Its error names this range.

    exclude_min, exclude_max: True to exclude ``min_value`` or ``max_value``.
    also: text for the message about other values that the field allows.
    """

    def check(value: float) -> float:
        """Return the value; raise ValueError outside the range."""
        # The comparisons are written so that NaN fails.
        if (min_value < value if exclude_min else min_value <= value) and (
            value < max_value if exclude_max else value <= max_value
        ):
            return value
        low_text, high_text = (bound if isinstance(bound, int) else f"{bound:.12g}" for bound in (min_value, max_value))
        if exclude_min or exclude_max:
            low_prefix, high_prefix = ("above" if exclude_min else "from"), ("below" if exclude_max else "up to")
            raise ValueError(f"allowed {low_prefix} {low_text}, {high_prefix} {high_text}{also}")
        raise ValueError(f"allowed {low_text}..{high_text}{also}")

    return AfterValidator(check)


Metres = Annotated[float, in_range(-MAP_EXTENT, MAP_EXTENT)]
Amsl = Annotated[float, in_range(-500.0, 9000.0)]
Height = Annotated[float, in_range(0.0, 9000.0)]
Latitude = Annotated[float, in_range(-89.0, 89.0)]
Longitude = Annotated[float, in_range(-180.0, 180.0)]
Course = Annotated[float, in_range(-360.0, 360.0)]
Radius = Annotated[float, in_range(0.0, 200_000.0, exclude_min=True)]
Name = Annotated[str, Field(min_length=1, max_length=100), AfterValidator(check_no_line_break)]
FilePath = Annotated[str, Field(min_length=1, max_length=4096), AfterValidator(check_no_line_break)]
Guidance = Literal["path", "l1", "vector-field"]
Navigation = Literal["perfect", "rtk", "gnss"]
# ArduPlane releases with different control laws.
ArduPlaneVersion = Literal["4.6", "4.7"]
NEWEST_ARDUPLANE: ArduPlaneVersion = "4.7"
# PX4 releases with different control laws.
Px4Version = Literal["1.16", "1.17"]
NEWEST_PX4: Px4Version = "1.17"
Seed = Annotated[int, in_range(0, 2**63 - 1)]
Span = Annotated[list[Metres], Field(min_length=2, max_length=2)]
Angle = (
    Annotated[float, in_range(0.0, 90.0, exclude_min=True, exclude_max=True, also=', or "aircraft"')]
    | Literal["aircraft"]
)


class ScenarioTable(BaseModel):
    """A table of a scenario file; unknown keys are rejected."""

    # Strict mode: otherwise pydantic accepts true, "5" and "yes" as numbers and booleans.  Each number has its own
    # range, which excludes NaN and the infinities.  A validator is built when its table is first read.
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, defer_build=True)


# ----------------------------------------------------------------------
# [[zones]] of a scenario file as a pydantic model.

# Maximum number of corners of a zone.
MAX_CORNERS = 100_000
# Maximum number of rings of a zone.
MAX_RINGS = 1_000
# Maximum number of zones of a scenario, including the zones of its files.
MAX_ZONES = 20_000


def _check_latitude(corner: list[float]) -> list[float]:
    """Return the corner; raise ValueError if its first number cannot be a latitude."""
    if not -89.0 <= corner[0] <= 89.0:
        raise ValueError(f"latitude {corner[0]:g}: allowed -89..89; a corner is [latitude, longitude]")
    return corner


def _make_text_check(parse: Callable[[str], object]) -> Callable[[str], str]:
    """Make a validator that returns a text unchanged.

    It raises the ValueError with which a parser rejects a text.
    """

    def check(text: str) -> str:
        """Return the text; raise ValueError if the parser does not accept it."""
        parse(text)
        return text

    return check


_ZoneTime = Annotated[str, Field(min_length=1, max_length=100), AfterValidator(_make_text_check(parse_period))]
_MetreCorner = Annotated[list[Metres], Field(min_length=2, max_length=2)]
_Degrees = Annotated[float, in_range(-180.0, 180.0)]
_DegreeCorner = Annotated[list[_Degrees], Field(min_length=2, max_length=2), AfterValidator(_check_latitude)]
_MetreRing = Annotated[list[_MetreCorner], Field(max_length=MAX_CORNERS)]
_DegreeRing = Annotated[list[_DegreeCorner], Field(max_length=MAX_CORNERS)]


def _check_one_position(table: "PositionTable | ZoneTable") -> None:
    """Raise ValueError unless the position is stated exactly once, in metres or in degrees."""
    pairs = [{key: getattr(table, key) for key in keys} for keys in (("east_m", "north_m"), ("lat_deg", "lon_deg"))]
    given_pairs = [pair for pair in pairs if any(value is not None for value in pair.values())]
    if len(given_pairs) > 1:
        raise ValueError("position: give east_m and north_m, or lat_deg and lon_deg, not both")
    if not given_pairs:
        raise ValueError("position: missing; give east_m and north_m, or lat_deg and lon_deg")
    for key, value in given_pairs[0].items():
        if value is None:
            raise ValueError(f"{key}: missing; a position needs {' and '.join(given_pairs[0])}")


class ZoneTable(ScenarioTable):
    """[[zones]]: a polygon by its corners, or a cylinder by its centre and radius, with a vertical band.

    polygon_m: corners as [east, north]; polygon_deg: as [latitude, longitude].
    rings_m, rings_deg: several rings, for a zone with holes or several parts: a point is inside the zone if an odd
    number of rings contain it.
    east_m, north_m or lat_deg, lon_deg, with radius_m: a cylinder.
    floor_..., ceiling_...: heights above mean sea level or above ground; unbounded if neither is given.
    times: periods in which the zone is active, as `world.airspace.zone_times` reads them; None for always.
    """

    name: Name
    kind: Literal["inclusion", "exclusion"]
    polygon_m: _MetreRing | None = None
    polygon_deg: _DegreeRing | None = None
    rings_m: Annotated[list[_MetreRing], Field(max_length=MAX_RINGS)] | None = None
    rings_deg: Annotated[list[_DegreeRing], Field(max_length=MAX_RINGS)] | None = None
    east_m: Metres | None = None
    north_m: Metres | None = None
    lat_deg: Latitude | None = None
    lon_deg: Longitude | None = None
    radius_m: Radius | None = None
    floor_amsl_m: Amsl | None = None
    floor_agl_m: Height | None = None
    ceiling_amsl_m: Amsl | None = None
    ceiling_agl_m: Height | None = None
    times: Annotated[list[_ZoneTime], Field(min_length=1, max_length=1000)] | None = None

    @model_validator(mode="after")
    def _check_shape(self) -> "ZoneTable":
        """Raise ValueError unless exactly one complete shape is stated.

        The shape has at most `MAX_CORNERS` corners.
        """
        shapes = ("polygon_m", "polygon_deg", "rings_m", "rings_deg", "radius_m")
        stated_keys = [key for key in shapes if getattr(self, key) is not None]
        if len(stated_keys) != 1:
            given_text = " and ".join(stated_keys) if stated_keys else "none of them"
            raise ValueError(f"polygon_m: a zone needs exactly one of {', '.join(shapes)}; it has {given_text}")
        corners = sum(map(len, self.rings_m or self.rings_deg or ()))
        if corners > MAX_CORNERS:
            raise ValueError(f"{stated_keys[0]}: {corners:,} corners: at most {MAX_CORNERS:,} are allowed in one zone")
        if self.radius_m is not None:
            _check_one_position(self)
        elif any(value is not None for value in (self.east_m, self.north_m, self.lat_deg, self.lon_deg)):
            raise ValueError("radius_m: missing; a zone with a centre is a cylinder and needs a radius")
        return self

    @model_validator(mode="after")
    def _check_band(self) -> "ZoneTable":
        """Raise ValueError if a floor or ceiling is stated twice, or if the band is empty."""
        for limit_name in ("floor", "ceiling"):
            if getattr(self, f"{limit_name}_amsl_m") is not None and getattr(self, f"{limit_name}_agl_m") is not None:
                raise ValueError(f"{limit_name}_agl_m: give {limit_name}_amsl_m or {limit_name}_agl_m, not both")
        for datum in ("amsl", "agl"):
            floor, ceiling = getattr(self, f"floor_{datum}_m"), getattr(self, f"ceiling_{datum}_m")
            if floor is not None and ceiling is not None and ceiling <= floor:
                raise ValueError(f"ceiling_{datum}_m: {ceiling:g}: must be above floor_{datum}_m {floor:g}")
        return self


class OriginTable(ScenarioTable):
    """[origin]: the point where east_m = north_m = 0."""

    lat_deg: Latitude
    lon_deg: Longitude


class PeakTable(ScenarioTable):
    """[[terrain.peak]]: a Gaussian hill."""

    east_m: Metres
    north_m: Metres
    height_m: Annotated[float, in_range(0.0, 9000.0, exclude_min=True)]
    sigma_m: Annotated[float, in_range(10.0, 100_000.0)]


def _check_datum(datum: StatedDatum) -> StatedDatum:
    """Return the vertical datum; raise ValueError unless it is a known name or a plausible height.

    A number is the height of mean sea level in the file, m.
    """
    names = get_args(NamedDatum)
    if datum in names or (not isinstance(datum, str) and abs(datum) <= MAX_SEA_LEVEL):
        return datum
    allowed_names = ", ".join(f'"{name}"' for name in names)
    raise ValueError(f"allowed {allowed_names} or {-MAX_SEA_LEVEL:g}..{MAX_SEA_LEVEL:g} m")


def _check_paths(path: object) -> object:
    """Return the path; raise ValueError unless it is a file name, a list of file names, or None.

    This check gives one message, where the union of types would report an error for each type.
    """
    paths = path if isinstance(path, list) else [path]
    if path is None or (1 <= len(paths) <= MAX_TILES and all(isinstance(name, str) and name for name in paths)):
        return path
    raise ValueError(f"expected a file's name, or a list of 1 to {MAX_TILES} names")


class TerrainTable(ScenarioTable):
    """[terrain].  Planfly sets kind "none" for a mission without terrain; a file cannot state it.

    path: an elevation file, a folder or .vrt of tiles, the name of a built-in terrain, or a list of these on one grid.
    vertical_error_m: error of the heights as their source states it; None if not stated (elevation files do not
    contain it).
    height_datum: datum of the file's heights, or the height of mean sea level in the file, m; None for the datum that
    the file states.
    """

    kind: Literal["dem", "peaks", "flat", "none"]
    path: Annotated[FilePath | list[FilePath] | None, BeforeValidator(_check_paths)] = None
    peak: Annotated[list[PeakTable], Field(max_length=1000)] | None = None
    amsl_m: Amsl | None = None
    vertical_error_m: Annotated[float, in_range(0.0, 1000.0)] | None = None
    height_datum: Annotated[str | float, AfterValidator(_check_datum)] | None = None
    sha256: str | None = None

    @model_validator(mode="after")
    def _check_kind_keys(self) -> "TerrainTable":
        """Raise ValueError for a key that does not belong to the kind of terrain, or is missing for it."""
        needed_key = {"dem": "path", "peaks": "peak", "flat": "amsl_m", "none": ""}[self.kind]
        for key in ("path", "peak", "amsl_m"):
            is_given = getattr(self, key) is not None
            if key == needed_key and not is_given:
                raise ValueError(f'{key}: missing; kind = "{self.kind}" requires it')
            if key != needed_key and is_given:
                raise ValueError(f'{key}: not a key of kind = "{self.kind}"')
        if self.height_datum is not None and self.kind != "dem":
            raise ValueError(f'height_datum: not a key of kind = "{self.kind}"')
        return self


class AreaTable(ScenarioTable):
    """[area]: the map box and its ceiling."""

    east_m: Span
    north_m: Span
    ceiling_amsl_m: Amsl | None = None
    floor_amsl_m: Amsl | None = None

    @model_validator(mode="after")
    def _check_order(self) -> "AreaTable":
        """Raise ValueError for an area that is too narrow or whose limits are in the wrong order."""
        for key in ("east_m", "north_m"):
            min_value, max_value = getattr(self, key)
            if not max_value - min_value >= 100.0:
                raise ValueError(
                    f"{key}: [{min_value:g}, {max_value:g}]: the second value must exceed the first by at least 100 m"
                )
        if (
            self.ceiling_amsl_m is not None
            and self.floor_amsl_m is not None
            and self.ceiling_amsl_m <= self.floor_amsl_m
        ):
            raise ValueError(
                f"ceiling_amsl_m: {self.ceiling_amsl_m:g}: must be above floor_amsl_m {self.floor_amsl_m:g}"
            )
        return self


class PositionTable(ScenarioTable):
    """A position on the map: east_m, north_m or lat_deg, lon_deg."""

    east_m: Metres | None = None
    north_m: Metres | None = None
    lat_deg: Latitude | None = None
    lon_deg: Longitude | None = None


class PointTable(PositionTable):
    """A position: east_m, north_m or lat_deg, lon_deg; amsl_m or height_m above ground."""

    amsl_m: Amsl | None = None
    height_m: Height | None = None

    @model_validator(mode="after")
    def _check_form(self) -> "PointTable":
        """Raise ValueError unless position and height are each stated in one form."""
        _check_one_position(self)
        if self.amsl_m is not None and self.height_m is not None:
            raise ValueError("height_m: give amsl_m or height_m, not both")
        return self


class EndTable(PointTable):
    """[start] and [destination]."""

    course_deg: Course | None = None

    @model_validator(mode="after")
    def _check_height(self) -> "EndTable":
        """Raise ValueError unless an altitude or a height is stated."""
        if self.amsl_m is None and self.height_m is None:
            raise ValueError("amsl_m: missing; give amsl_m or height_m")
        return self


# Scale of a threat whose scale is not stated, as a ratio of its kill or detection radius.
SCALE_RATIOS = {"kill": 1.0 / 4.0, "detection": 1.0 / 3.0}


class ThreatTable(PointTable):
    """[[threats]]: missile only, radar only, or both; on the ground unless a height is given.

    A scale that is not stated is a quarter of the kill radius, or a third of the detection radius.
    """

    name: Name | None = None
    kill_radius_m: Radius | None = None
    kill_scale_m: Radius | None = None
    detection_radius_m: Radius | None = None
    detection_scale_m: Radius | None = None

    @model_validator(mode="before")
    @classmethod
    def _fill_scales(cls, data: Any) -> Any:
        """Return the data with the default scale for each radius whose scale is missing."""
        if not isinstance(data, dict):
            return data
        values = dict(data)
        for kind, ratio in SCALE_RATIOS.items():
            radius = values.get(f"{kind}_radius_m")
            if isinstance(radius, int | float) and radius > 0.0:
                values.setdefault(f"{kind}_scale_m", ratio * radius)
        return values

    @model_validator(mode="after")
    def _check_pairs(self) -> "ThreatTable":
        """Raise ValueError for a radius without a scale or a scale without a radius."""
        for kind in ("kill", "detection"):
            radius, scale = getattr(self, f"{kind}_radius_m"), getattr(self, f"{kind}_scale_m")
            if (radius is None) != (scale is None):
                raise ValueError(f"{kind}_scale_m: needs {kind}_radius_m")
        if self.kill_radius_m is None and self.detection_radius_m is None:
            raise ValueError("kill_radius_m: missing; a threat has a missile, a radar, or both")
        return self


class LimitsTable(ScenarioTable):
    """[limits]: a number, or "aircraft" for the limit of the flight envelope.

    corridor_m: half width of the corridor about the legs; None for the width that the autopilot needs.
    surveys: how parallel lines are judged. "lines" judges them as the photo lines of a survey, and leaves the
    turn-arounds to the autopilot; "path" judges them as any other path. None means "lines" where the mission triggers
    its camera on them.
    max_height_m: largest height above ground; None for no limit.
    """

    max_turn_deg: (
        Annotated[float, in_range(0.0, 180.0, exclude_min=True, also=', or "aircraft"')] | Literal["aircraft"]
    ) = "aircraft"
    max_climb_deg: Angle = "aircraft"
    max_dive_deg: Angle = "aircraft"
    min_clearance_m: Annotated[float, in_range(0.0, 5000.0)] = 30.0
    max_height_m: Annotated[float, in_range(0.0, 9000.0, exclude_min=True)] | None = None
    corridor_m: Annotated[float, in_range(1.0, 5000.0)] | None = None
    surveys: Literal["lines", "path"] | None = None

    @model_validator(mode="after")
    def _check_height_band(self) -> "LimitsTable":
        """Raise ValueError if the maximum height is not above the clearance."""
        if self.max_height_m is not None and self.max_height_m <= self.min_clearance_m:
            raise ValueError(
                f"max_height_m: {self.max_height_m:g}: must be above min_clearance_m {self.min_clearance_m:g}"
            )
        return self


class GoalsTable(ScenarioTable):
    """[planner.goals]: goals of the second preference level."""

    length_ratio: Annotated[float, in_range(1.0, 100.0)] | None = None
    kill_exposure: Annotated[float, in_range(0.0, 1e9)] | None = None


class PlannerTable(ScenarioTable):
    """[planner].

    zone_margin_m: distance that a plan keeps from zones, in addition to the autopilot's tracking error; None for the
    planner's default.
    objective: quantity that a plan minimises; None for its length.
    """

    algorithm: Name | None = None
    objective: Literal["length", "time", "energy"] | None = None
    waypoints: Annotated[int, in_range(3, 500)] = 12
    population: Annotated[int, in_range(4, 100_000)] = 200
    generations: Annotated[int, in_range(0, 100_000)] = 100
    across_m: Annotated[float, in_range(0.0, MAP_EXTENT, exclude_min=True)] | None = None
    zone_margin_m: Annotated[float, in_range(0.0, 5000.0)] | None = None
    goals: GoalsTable = GoalsTable()
    budget: Annotated[int, in_range(4, 10**10)] | None = None
    seed: Seed | None = None


def names_folder(aircraft: str) -> bool:
    """Return True if a scenario's aircraft is a folder (a name with a slash), not a built-in aircraft.

    >>> names_folder("aerosonde"), names_folder("models/mine")
    (False, True)
    """
    return "/" in aircraft or "\\" in aircraft


# Autopilot of a scenario that names neither an autopilot nor an autopilot's settings.
DEFAULT_AUTOPILOT = "ardupilot"
# Planfly's own guidance: the only one with a choice of laws, and the only one without parameters.
OWN_GUIDANCE = "planfly"
# Name of planfly's own guidance in scenarios, plans and logs written before version 0.2.
_OLD_OWN_GUIDANCE = "ideal"
# Autopilots with a choice of release.
_ARDUPILOT = "ardupilot"
_PX4 = "px4"


class Steering(NamedTuple):
    """Autopilot, guidance law and navigation accuracy of a flight.

    autopilot: "ardupilot" for ArduPlane's laws, "planfly" for planfly's guidance, or another autopilot of
        `flight.autopilots.catalog`.
    guidance: the guidance law of "planfly"; other autopilots ignore it.
    nav: navigation accuracy, a key of `flight.guidance.navigation_error.ERRORS`.
    """

    autopilot: str
    guidance: Guidance
    nav: Navigation


class FlightTable(ScenarioTable):
    """[flight].  None means not stated; `steering` gives the default.

    autopilot: name of the autopilot; if it is not stated, guidance implies "planfly", and params "ardupilot".
    autopilot_from: file that the autopilot was inferred from, see `planfly.flight_options.with_file_autopilot`.
    params: file with the autopilot's parameters.
    arduplane_version: release of autopilot = "ardupilot", as releases fly differently; None for the release of the
        parameter file, or otherwise for the newest.
    px4_version: release of autopilot = "px4"; None for the release of the parameter file, or otherwise for the newest.
    max_bank_deg: bank limit in turns; None for the lower limit of aircraft and autopilot.
    guidance: guidance law of "planfly".
    nav: navigation accuracy, see `flight.guidance.navigation_error`.
    """

    aircraft: FilePath = "aerosonde"  # the name of a built-in aircraft, or a folder if it has a slash
    aircraft_by_default: Literal[True] | None = None  # set if no aircraft was named for a mission
    airspeed_mps: Annotated[float, in_range(3.0, 150.0)] | None = None
    max_bank_deg: Annotated[float, in_range(5.0, 60.0)] | None = None
    autopilot: Name | None = None
    autopilot_from: FilePath | None = None  # set if the autopilot was inferred from a file
    params: FilePath | None = None
    arduplane_version: ArduPlaneVersion | None = None
    px4_version: Px4Version | None = None
    guidance: Guidance | None = None
    guidance_hz: Literal[30, 60] = 60
    nav: Navigation | None = None
    fly_over: bool = False
    motor_braking: bool = False
    battery_wh: Annotated[float, in_range(0.0, 100_000.0, exclude_min=True)] | None = None

    @field_validator("autopilot")
    @classmethod
    def _replace_old_name(cls, name: str | None) -> str | None:
        """Return the present name of an autopilot in place of its old name."""
        return OWN_GUIDANCE if name == _OLD_OWN_GUIDANCE else name

    @model_validator(mode="after")
    def _check_autopilot(self) -> "FlightTable":
        """Raise ValueError for entries that do not belong to the autopilot."""
        autopilot = self.steering.autopilot
        if self.guidance is not None and autopilot != OWN_GUIDANCE:
            raise ValueError(f'guidance: not allowed with autopilot = "{autopilot}", only with "planfly"')
        if self.params is not None and autopilot == OWN_GUIDANCE:
            raise ValueError(
                'params: not allowed with autopilot = "planfly", which guidance selects if no autopilot is named'
            )
        if self.arduplane_version is not None and autopilot != _ARDUPILOT:
            raise ValueError(f'arduplane_version: only a key of autopilot = "ardupilot", not of "{autopilot}"')
        if self.px4_version is not None and autopilot != _PX4:
            raise ValueError(f'px4_version: only a key of autopilot = "px4", not of "{autopilot}"')
        return self

    @property
    def steering(self) -> Steering:
        """Autopilot, guidance law and navigation accuracy, with defaults for values that are not stated.

        The autopilot is planfly's guidance if only a guidance law is stated, and otherwise ArduPlane. The default
        accuracy is "perfect" for planfly's guidance, and "gnss" for other autopilots.
        """
        implied_autopilot = DEFAULT_AUTOPILOT
        if self.guidance is not None:
            implied_autopilot = OWN_GUIDANCE
        elif self.params is not None:
            implied_autopilot = "ardupilot"
        autopilot = self.autopilot or implied_autopilot
        default_nav: Navigation = "perfect" if autopilot == OWN_GUIDANCE else "gnss"
        return Steering(autopilot, self.guidance or "path", self.nav or default_nav)

    def with_stated_defaults(self) -> "FlightTable":
        """Return a copy that states autopilot, release and navigation accuracy, as plans and logs store it."""
        autopilot, guidance, nav = self.steering
        autopilot_entries: dict[str, str] = (
            {"autopilot": autopilot} if autopilot != OWN_GUIDANCE else {"guidance": guidance}
        )
        if autopilot == _ARDUPILOT and self.params is None:
            autopilot_entries["arduplane_version"] = self.arduplane_version or NEWEST_ARDUPLANE
        if autopilot == _PX4 and self.params is None:
            autopilot_entries["px4_version"] = self.px4_version or NEWEST_PX4
        return self.model_copy(update={**autopilot_entries, "nav": nav})


class WindTable(ScenarioTable):
    """[wind]: gradient in m/s per metre of height above the start.

    forecast: file of a weather forecast, which states the wind instead. A scenario file then must not state speed_mps,
    from_deg and gradient; planfly sets them to those of the forecast's mean profile around the start.

    """

    speed_mps: Annotated[float, in_range(0.0, 40.0)] = 0.0
    from_deg: Course = 0.0
    gradient: Annotated[float, in_range(-0.05, 0.05)] = 0.0
    turbulence: Literal["none", "light", "moderate"] = "none"
    seed: Seed | None = None
    forecast: Annotated[str, Field(min_length=1, max_length=1000)] | None = None


class HomeTable(PositionTable):
    """[home]: position on the ground where the mission begins; place = "start" for the ground below it."""

    place: Literal["start"] | None = None

    @model_validator(mode="before")
    @classmethod
    def _check_on_ground(cls, data: Any) -> Any:
        """Raise ValueError for an altitude or a height, because home is on the ground."""
        for key in ("amsl_m", "height_m"):
            if isinstance(data, dict) and key in data:
                raise ValueError(f"{key}: home is on the scenario's ground: give only its position")
        return data

    @model_validator(mode="after")
    def _check_place(self) -> "HomeTable":
        """Raise ValueError unless home is stated by a place or by a position."""
        coordinates = (self.east_m, self.north_m, self.lat_deg, self.lon_deg)
        if self.place is None and all(value is None for value in coordinates):
            raise ValueError('position: missing; give place = "start", east_m and north_m, or lat_deg and lon_deg')
        if self.place is None:
            _check_one_position(self)
        elif any(value is not None for value in coordinates):
            raise ValueError('place: give place = "start" or a position, not both')
        return self


LaunchMethod = Literal["catapult", "hand", "runway"]
# Largest incline of a runway, degrees above level, as for a landing strip (`world.airfield.STEEPEST_STRIP_SLOPE`).
MAX_RUNWAY_INCLINE_DEG = 5.0


class LaunchTable(ScenarioTable):
    """[launch]: the launch of the aircraft at home.

    course_deg: clockwise from north; None for the course of the mission's first leg.
    speed_mps: speed at the end of the rail or throw.
    length_m, incline_deg: length of the rail, throw or runway, and its angle above level.
    A value that is not given takes the method's default (`world.airfield`).
    """

    method: LaunchMethod
    course_deg: Course | None = None
    speed_mps: Annotated[float, in_range(1.0, 60.0)] | None = None
    length_m: Annotated[float, in_range(0.1, 3000.0)] | None = None
    incline_deg: Annotated[float, in_range(0.0, 45.0)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _check_method(cls, data: Any) -> Any:
        """Raise ValueError if the method is missing."""
        if isinstance(data, dict) and "method" not in data:
            raise ValueError('method: missing; give "catapult", "hand" or "runway"')
        return data

    @model_validator(mode="after")
    def _check_launch_values(self) -> "LaunchTable":
        """Raise ValueError for values that do not suit the launch method."""
        if self.method == "runway" and self.speed_mps is not None:
            raise ValueError(
                f"speed_mps: {self.speed_mps:g}: not allowed for a runway, where the motor accelerates the aircraft"
            )
        if self.method == "runway" and (self.incline_deg or 0.0) > MAX_RUNWAY_INCLINE_DEG:
            raise ValueError(f"incline_deg: {self.incline_deg:g}: allowed 0..{MAX_RUNWAY_INCLINE_DEG:g} for a runway")
        return self


_OR_WIND = ', or "wind"'


def _check_course(value: Any) -> Any:
    """Return the value; raise ValueError unless it is a number or "wind"."""
    if value != "wind" and (isinstance(value, bool) or not isinstance(value, int | float)):
        raise ValueError(f"allowed -360..360{_OR_WIND}")
    return value


class LandingTable(PositionTable):
    """[landing]: the landing strip at the end of the mission.

    course_deg: landing course, clockwise from north, or "wind" for a landing into the wind.
    length_m, width_m: size of the strip, which is centred on the landing point.
    approach_m: length of the straight final before the landing point.
    slope_deg: glide slope of the final, below level.
    height_sd_m: standard deviation of the strip's surveyed height.  If it is not given, the height is only known from
        the elevation file, and a campaign varies it with the terrain.
    If approach_m or slope_deg is not given, a plan chooses a value that the autopilot and the aircraft can fly.
    """

    course_deg: Annotated[
        Annotated[float, in_range(-360.0, 360.0, also=_OR_WIND)] | Literal["wind"], BeforeValidator(_check_course)
    ] = "wind"
    length_m: Annotated[float, in_range(20.0, 5000.0)] = 200.0
    width_m: Annotated[float, in_range(5.0, 500.0)] = 40.0
    approach_m: Annotated[float, in_range(200.0, 5000.0)] | None = None
    slope_deg: Annotated[float, in_range(1.0, 20.0)] | None = None
    height_sd_m: Annotated[float, in_range(0.0, 20.0)] | None = None

    @model_validator(mode="after")
    def _check_position(self) -> "LandingTable":
        """Raise ValueError unless the position is stated exactly once."""
        _check_one_position(self)
        return self


class RallyTable(PointTable):
    """[returns] rally: a rally point for RTL, at an altitude AMSL or a height above the ground there."""

    @model_validator(mode="after")
    def _check_height(self) -> "RallyTable":
        """Raise ValueError unless an altitude or a height is stated."""
        if self.amsl_m is None and self.height_m is None:
            raise ValueError("amsl_m: missing; give amsl_m or height_m")
        return self


def _check_autoland(value: Any) -> Any:
    """Return the value if it is an allowed value of ArduPlane's RTL_AUTOLAND: 1, 2 or 3.

    Otherwise raise ValueError.

    True and 1.0 are not allowed, although they equal 1.
    """
    if type(value) is not int or value not in (1, 2, 3):
        raise ValueError("allowed 1, 2 or 3")
    return value


# Requirements on the return from every point of the mission: a safe RTL, an engine-off glide to a landing place, and a
# landing that can be aborted.
ReturnDemand = Literal["rtl", "glide", "go_around"]


class ReturnsTable(ScenarioTable):
    """[returns]: requirements of the verdict on RTL from any point, and RTL settings of a planned mission.

    require: "rtl" if every RTL (return to launch) must be safe, "glide" if the engine may fail anywhere, "go_around" if
        a landing may be aborted anywhere on its glide.
    rtl_altitude_m: height above home that a return climbs or descends to.
    rtl_autoland: ArduPlane's RTL_AUTOLAND: 1 for home and then the landing, 2 for straight to the landing, 3 for a
        loiter at home.
    rally: return points that are nearer than home.
    """

    require: list[ReturnDemand] | None = None
    rtl_altitude_m: Annotated[float, in_range(1.0, 9000.0)] | None = None
    rtl_autoland: Annotated[Literal[1, 2, 3], BeforeValidator(_check_autoland)] | None = None
    rally: Annotated[list[RallyTable], Field(min_length=1, max_length=100)] | None = None

    @model_validator(mode="after")
    def _check_contents(self) -> "ReturnsTable":
        """Raise ValueError for an empty table, and for a requirement that is named twice."""
        if not self.require and all(value is None for value in (self.rtl_altitude_m, self.rtl_autoland, self.rally)):
            raise ValueError("require: missing; give require, rtl_altitude_m, rtl_autoland or rally")
        if self.require is not None and len(set(self.require)) < len(self.require):
            raise ValueError(f"require: {', '.join(self.require)}: name each requirement only once")
        return self


# Use of a radio link: the ground station's link, or the pilot's remote control.
LinkUse = Literal["telemetry", "control"]


class LinkTable(PositionTable):
    """[link]: radio link between a ground station and the aircraft.

    east_m, north_m or lat_deg, lon_deg: position of the station's antenna; if none is given, the mission's home.
    use: "telemetry" for the ground station's link, "control" for the pilot's remote control.
    antenna_m: height of the station's antenna above ground.
    frequency_mhz: up to 15 GHz, because absorption by the air (ITU-R P.676) is not modelled.
    power_dbm: output of the transmitter.  sensitivity_dbm: power at which the receiver still works.
    station_gain_dbi, aircraft_gain_dbi: antenna gains.  cable_loss_db: losses of cables and connectors at both ends.
    fade_margin_db: power above the sensitivity that the link has to keep.
    max_outage_s: longest time below the fade margin that the verdict accepts.
    """

    use: LinkUse = "telemetry"
    antenna_m: Annotated[float, in_range(0.5, 500.0)] = 3.0
    frequency_mhz: Annotated[float, in_range(30.0, 15_000.0)]
    power_dbm: Annotated[float, in_range(-30.0, 60.0)]
    sensitivity_dbm: Annotated[float, in_range(-150.0, 0.0)]
    station_gain_dbi: Annotated[float, in_range(-20.0, 60.0)] = 0.0
    aircraft_gain_dbi: Annotated[float, in_range(-20.0, 60.0)] = 0.0
    cable_loss_db: Annotated[float, in_range(0.0, 60.0)] = 0.0
    fade_margin_db: Annotated[float, in_range(0.0, 60.0)] = 10.0
    max_outage_s: Annotated[float, in_range(0.0, 3600.0)] = 0.0

    @model_validator(mode="after")
    def _check_position(self) -> "LinkTable":
        """Raise ValueError for a position that is stated incompletely or twice."""
        if any(value is not None for value in (self.east_m, self.north_m, self.lat_deg, self.lon_deg)):
            _check_one_position(self)
        return self


class ScenarioFile(ScenarioTable):
    """A complete scenario file.

    zones: None if there are no zones, so that the written form of a scenario without zones does not change.
    zones_file: one or several files of zones; a made scenario has their zones in `zones`, and `zone_notes` lists what
    was changed or left out on reading them.
    at: time of the flight, as `world.airspace.zone_times` reads it; zones that are not active then are left out.
    home, launch, landing: None for a mission that begins and ends in the air.
    returns: None if there are no requirements on returns.
    link: None if no radio link is judged.
    """

    name: Name
    description: Annotated[str, Field(max_length=500), AfterValidator(check_no_line_break)] = ""
    origin: OriginTable | None = None
    terrain: TerrainTable
    area: AreaTable | None = None
    start: EndTable
    destination: EndTable
    threats: list[ThreatTable] = Field(default_factory=list, max_length=20_000)
    zones: Annotated[list[ZoneTable], Field(max_length=MAX_ZONES)] | None = None
    zones_file: FilePath | Annotated[list[FilePath], Field(max_length=100)] | None = None
    zone_notes: Annotated[list[str], Field(max_length=1000)] | None = None
    at: Annotated[str, Field(max_length=100), AfterValidator(_make_text_check(parse_span))] | None = None
    limits: LimitsTable = LimitsTable()
    planner: PlannerTable = PlannerTable()
    flight: FlightTable = FlightTable()
    wind: WindTable = WindTable()
    home: HomeTable | None = None
    launch: LaunchTable | None = None
    landing: LandingTable | None = None
    returns: ReturnsTable | None = None
    link: LinkTable | None = None

    @model_validator(mode="after")
    def _check_area(self) -> "ScenarioFile":
        """Raise ValueError if the area is missing and there is no elevation file to take it from."""
        if self.area is None and self.terrain.kind != "dem":
            raise ValueError(f'area: missing; terrain of kind "{self.terrain.kind}" does not imply an area')
        return self

    @model_validator(mode="after")
    def _check_home(self) -> "ScenarioFile":
        """Raise ValueError if home is missing, but a launch or a landing requires it."""
        if self.home is None:
            for key in ("launch", "landing"):
                if getattr(self, key) is not None:
                    raise ValueError(
                        f"home: missing; [{key}] requires it, because take-off and landing heights are relative to home"
                    )
        return self
