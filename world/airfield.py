"""Home, launch, landing strip and return requirements of a scenario.

The flight of a scenario without these tables begins and ends in the air.  Positions are m east and north of the map's
origin, courses are radians clockwise from north, and home is on the scenario's ground.
"""

import math
from dataclasses import dataclass

import numpy as np

from world.arrays import Floats
from world.errors import ScenarioError
from world.frames import GeoOrigin
from world.map_positions import check_above_ground, check_in_area, map_coordinates, map_position
from world.scenario_tables import (
    HomeTable,
    LandingTable,
    LaunchMethod,
    LaunchTable,
    ReturnDemand,
    ReturnsTable,
)
from world.terrain import Terrain
from world.wind import Wind

# Default launch length, m: the rail of a small catapult, a throw (two steps and the swing of an arm), a runway.  A
# catapult of 6 m at 12 degrees launched the Aerosonde without loss of height.
_LAUNCH_LENGTH_M: dict[LaunchMethod, float] = {"catapult": 6.0, "hand": 2.0, "runway": 200.0}
# Default launch incline, rad.
_LAUNCH_INCLINE_RAD: dict[LaunchMethod, float] = {
    "catapult": math.radians(12.0),
    "hand": math.radians(10.0),
    "runway": 0.0,
}
# Steepest slope of a strip, along and across, m per m.
STEEPEST_STRIP_SLOPE = 0.10
# Smallest width over which the slope across a strip is measured, m.
_MIN_MEASURED_WIDTH_M = 60.0
# Release speed of a catapult as a multiple of the lowest speed in level flight, as catapults are usually set.
_CATAPULT_SPEED_RATIO = 1.2
# Speed of a hand launch, m/s.
_THROW_SPEED_MPS = 10.0


@dataclass(frozen=True, slots=True)
class Launch:
    """Launch of the aircraft at home.

    method: "catapult", "hand" or "runway".
    course: rad clockwise from north; None for the course of the mission's first leg.
    speed: ground speed at the end of the launch, m/s; None for the method's default, see `release_speed`.
    length: length of the rail, the throw or the runway, m; None for the method's default, see `effective_length`.
    incline: angle of the launch above level, rad.
    """

    method: LaunchMethod
    course: float | None = None
    speed: float | None = None
    length: float | None = None
    incline: float = 0.0

    @property
    def effective_length(self) -> float:
        """Length of the rail, the throw or the runway, m.

        >>> Launch("catapult").effective_length, Launch("catapult", length=4.0).effective_length
        (6.0, 4.0)
        """
        return _LAUNCH_LENGTH_M[self.method] if self.length is None else self.length

    def release_speed(self, min_speed: float) -> float:
        """Return the ground speed at the end of the launch, m/s.

        min_speed: lowest speed in level flight, m/s.

        The speed is the stated speed, or else the default of the launch method. The default is 0 for a runway, where
        the aircraft accelerates under its own power.

        >>> [Launch(method).release_speed(15.0) for method in ("catapult", "hand", "runway")]
        [18.0, 10.0, 0.0]
        """
        if self.speed is not None:
            return self.speed
        return {"catapult": _CATAPULT_SPEED_RATIO * min_speed, "hand": _THROW_SPEED_MPS, "runway": 0.0}[self.method]

    def acceleration(self, min_speed: float) -> float:
        """Return the mean acceleration along the launch, v^2 / (2 L), m/s^2; 0 on a runway.

        min_speed: lowest speed in level flight, m/s.

        >>> Launch("catapult", speed=10.0, length=6.0).acceleration(15.0).__round__(2)
        8.33
        """
        if self.method == "runway":
            return 0.0
        return self.release_speed(min_speed) ** 2 / (2.0 * self.effective_length)


@dataclass(frozen=True, slots=True)
class LandingStrip:
    """Landing strip of a mission.

    east, north: landing point, the centre of the strip, m on the map.
    course: landing course, rad clockwise from north; None for a landing into the wind, see `landing_course`.
    length, width: size of the ground that is suitable for landing, m.
    approach: length of the straight final before the landing point, m.
    slope: glide slope of the final, rad below level.
    height_sd: standard deviation of the strip's surveyed height, m; None if only the elevation file states its height.
    If approach or slope is None, a plan chooses a value that the autopilot and the aircraft can fly.
    """

    east: float
    north: float
    course: float | None = None
    length: float = 200.0
    width: float = 40.0
    approach: float | None = None
    slope: float | None = None
    height_sd: float | None = None

    def landing_course(self, wind: Wind, amsl: float) -> float | None:
        """Return the landing course, rad: the stated course, or else the course into the wind.

        amsl: altitude of the wind, m AMSL.

        Returns None if no course is stated and there is no wind, because any course is then suitable.

        >>> LandingStrip(0.0, 0.0).landing_course(Wind(5.0, 2.0, 0.0, "none", None, 100.0), 100.0)
        2.0
        >>> LandingStrip(0.0, 0.0, course=1.0).landing_course(Wind(5.0, 2.0, 0.0, "none", None, 100.0), 100.0)
        1.0
        """
        if self.course is not None:
            return self.course
        return wind.from_course if math.hypot(*wind.velocity_at(amsl)) > 0.0 else None


def strip_slopes(ground: Terrain, strip: LandingStrip, course: float) -> tuple[float, float]:
    """Return the ground slopes of a strip along a landing course and across it, m per m.

    course: rad.

    A slope is positive if it rises along the course or to the right of it. It is measured between two opposite ends of
    the strip, and NaN if the ground height at one of them is unknown.
    """
    slopes = []
    for heading, length in ((course, strip.length), (course + 0.5 * math.pi, max(_MIN_MEASURED_WIDTH_M, strip.width))):
        offsets = 0.5 * length * np.array([-1.0, 1.0])
        ends = ground.height(strip.east + offsets * math.sin(heading), strip.north + offsets * math.cos(heading))
        slopes.append(float(ends[1] - ends[0]) / length)
    return slopes[0], slopes[1]


@dataclass(frozen=True, slots=True, eq=False)
class ReturnRequirements:
    """Requirements on RTL (return to launch), glides and go-arounds.

    The RTL settings of the planned mission are included.

    require: contains "rtl" if every RTL must be safe, "glide" if the engine may fail anywhere, "go_around" if a landing
        may be aborted anywhere on its glide.
    rtl_altitude: height above home to which an RTL climbs or descends, m; None if the scenario sets none.
    rally: rally points, (n, 3) m: east, north, altitude AMSL.
    rtl_autoland: ArduPlane's RTL_AUTOLAND; None if the scenario sets none.
    """

    require: tuple[ReturnDemand, ...]
    rtl_altitude: float | None
    rally: Floats
    rtl_autoland: int | None = None

    def __post_init__(self) -> None:
        """Convert the rally points to a read-only array (n, 3)."""
        rally = np.array(self.rally, dtype=np.float64).reshape(-1, 3)
        rally.setflags(write=False)
        object.__setattr__(self, "rally", rally)


# ----------------------------------------------------------------------
# Conversion from a scenario file's tables.


def make_home(
    table: HomeTable | None, source: str, origin: GeoOrigin, ground: Terrain | None, bounds: Floats, start: Floats
) -> Floats | None:
    """Convert a scenario's [home] table to a position on the ground, (3,) m; None without a table.

    source: name of the file in messages.
    bounds: area of the scenario, (2, 2) m.
    start: (3,) m; with place = "start", home is the point on the ground below it.

    Raises ScenarioError if home is outside the area, or if the ground height at home is not known.
    """
    if table is None:
        return None
    position = (float(start[0]), float(start[1])) if table.place == "start" else map_coordinates(table, origin)
    return _position_on_ground("home", position, source, ground, bounds, origin)


def make_launch(table: LaunchTable | None) -> Launch | None:
    """Convert a scenario's [launch] table to a launch; None without a table."""
    if table is None:
        return None
    incline = _LAUNCH_INCLINE_RAD[table.method] if table.incline_deg is None else math.radians(table.incline_deg)
    course = None if table.course_deg is None else math.radians(table.course_deg)
    return Launch(table.method, course, table.speed_mps, table.length_m, incline)


def make_landing(
    table: LandingTable | None, source: str, origin: GeoOrigin, ground: Terrain | None, bounds: Floats
) -> LandingStrip | None:
    """Convert a scenario's [landing] table to a landing strip; None without a table.

    source, bounds: name of the file in messages, and area of the scenario, (2, 2) m.

    Raises ScenarioError if the landing point is outside the area, or if the ground height there is not known.
    """
    if table is None:
        return None
    position = map_coordinates(table, origin)
    _position_on_ground("landing", position, source, ground, bounds, origin)
    course = None if isinstance(table.course_deg, str) else math.radians(table.course_deg)
    slope = None if table.slope_deg is None else math.radians(table.slope_deg)
    return LandingStrip(*position, course, table.length_m, table.width_m, table.approach_m, slope, table.height_sd_m)


def make_return_requirements(
    table: ReturnsTable | None,
    source: str,
    origin: GeoOrigin,
    ground: Terrain | None,
    *,
    allows_underground: bool = False,
) -> ReturnRequirements | None:
    """Convert a scenario's [returns] table to RTL requirements; None without a table.

    source: name of the file in messages.
    ground: terrain; None if unknown.
    allows_underground: True to accept rally points below the ground, for terrain other than the scenario's.

    Raises ScenarioError for a rally point that is not above the ground, and for a height above ground at a position
    with unknown ground.
    """
    if table is None:
        return None
    points = []
    for k, rally_table in enumerate(table.rally or ()):
        key = f"returns.rally[{k}]"
        points.append(map_position(rally_table, key, source, origin, ground))
        if not allows_underground:
            check_above_ground(key, points[-1], source, ground)
    return ReturnRequirements(tuple(table.require or ()), table.rtl_altitude_m, np.array(points), table.rtl_autoland)


def _position_on_ground(
    key: str,
    position: tuple[float, float],
    source: str,
    ground: Terrain | None,
    bounds: Floats,
    origin: GeoOrigin,
) -> Floats:
    """Return a map position (east, north, m) with the altitude of the ground there, (3,) m.

    key: name of the scenario's table in messages.
    bounds: area of the scenario, (2, 2) m.

    Raises ScenarioError if the position is outside the area, or if the ground there is unknown.
    """
    check_in_area(key, np.array(position), source, bounds, origin)
    ground_height = float(ground.height(*position)) if ground is not None else math.nan
    if math.isnan(ground_height):
        message = (
            f"{source}: {key}: east {position[0]:.0f} m, north {position[1]:.0f} m: the elevation "
            "file has no data there"
        )
        raise ScenarioError(message, file=source, field=key)
    return np.array([*position, ground_height])
