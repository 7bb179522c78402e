"""The ground ends of a scenario: home, how an aircraft is launched there, the strip that it lands on, and returns.

A scenario without these tables has none: its flight begins and ends in the air.  Places lie on the map (m east and
north of its origin), courses are radians clockwise from north, and home stands on the scenario's ground.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from world.errors import ScenarioError
from world.frames import GeoOrigin
from world.map_positions import check_above_ground, check_in_area, map_place, map_position
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

Floats = NDArray[np.float64]

# Where a scenario does not state them: the rail of a small catapult, the swing of an arm with two steps, m; and how
# steep each goes up, rad.  A catapult of 6 m at 12 degrees launched the Aerosonde without loss of height.
_LENGTH: dict[LaunchMethod, float] = {"catapult": 6.0, "hand": 2.0, "runway": 200.0}
_INCLINE: dict[LaunchMethod, float] = {
    "catapult": math.radians(12.0),
    "hand": math.radians(10.0),
    "runway": 0.0,
}
# Steepest ground (m per m) along and across a strip; and this much of it at least is looked at on either, m.
STEEPEST_STRIP = 0.10
_MIN_LOOKED_AT = 60.0
# A catapult leaves so much of the slowest level flight, as catapults are set; an arm throws at this speed, m/s.
_CATAPULT_SHARE, _THROW = 1.2, 10.0


@dataclass(frozen=True, slots=True)
class Launch:
    """How an aircraft leaves the ground at home.

    method: "catapult", "hand" or "runway".
    course: rad clockwise from north; None for along the mission's first leg.
    speed: at the end of the launch, m/s against the ground; None for the method's default, see `release_speed`.
    length: of the rail, the throw or the runway, m; None for the method's default, see `run`.
    incline: of the launch above level, rad.
    """

    method: LaunchMethod
    course: float | None = None
    speed: float | None = None
    length: float | None = None
    incline: float = 0.0

    @property
    def run(self) -> float:
        """Length of the rail, the throw or the runway, m.

        >>> Launch("catapult").run, Launch("catapult", length=4.0).run
        (6.0, 4.0)
        """
        return _LENGTH[self.method] if self.length is None else self.length

    def release_speed(self, slowest: float) -> float:
        """Speed at the end of the launch, m/s; of a runway, where the aircraft's own motor gives it, 0.

        slowest: of level flight, m/s.

        >>> [Launch(method).release_speed(15.0) for method in ("catapult", "hand", "runway")]
        [18.0, 10.0, 0.0]
        """
        if self.speed is not None:
            return self.speed
        return {"catapult": _CATAPULT_SHARE * slowest, "hand": _THROW, "runway": 0.0}[self.method]

    def acceleration(self, slowest: float) -> float:
        """Mean acceleration along the launch, m/s2: v^2 / 2 L; 0 of a runway, where nothing but the motor pulls.

        slowest: of level flight, m/s.

        >>> Launch("catapult", speed=10.0, length=6.0).acceleration(15.0).__round__(2)
        8.33
        """
        if self.method == "runway":
            return 0.0
        return self.release_speed(slowest) ** 2 / (2.0 * self.run)


@dataclass(frozen=True, slots=True)
class LandingStrip:
    """Where a mission lands.

    east, north: the landing point, the middle of the strip, m on the map.
    course: of the landing, rad clockwise from north; None for into the wind, see `into`.
    length, width: of the ground that can be landed on, m.
    approach: length of the straight final before the landing point, m.
    slope: of the glide there, rad below level.
    Either is None for what a plan finds that the autopilot and the aircraft can fly.
    """

    east: float
    north: float
    course: float | None = None
    length: float = 200.0
    width: float = 40.0
    approach: float | None = None
    slope: float | None = None

    def into(self, wind: Wind, amsl: float) -> float | None:
        """Course of the landing, rad: the stated one, or into the wind at a height (m AMSL).

        None where none is stated and there is no wind: then any will do.

        >>> LandingStrip(0.0, 0.0).into(Wind(5.0, 2.0, 0.0, "none", None, 100.0), 100.0)
        2.0
        >>> LandingStrip(0.0, 0.0, course=1.0).into(Wind(5.0, 2.0, 0.0, "none", None, 100.0), 100.0)
        1.0
        """
        if self.course is not None:
            return self.course
        return wind.from_course if math.hypot(*wind.at(amsl)) > 0.0 else None


def strip_slopes(ground: Terrain, strip: LandingStrip, course: float) -> tuple[float, float]:
    """How the ground of a strip rises along a landing course (rad), and across it to the right: m per m, between ends.

    NaN where the ground is not known to the ends.
    """
    found = []
    for heading, length in ((course, strip.length), (course + 0.5 * math.pi, max(_MIN_LOOKED_AT, strip.width))):
        away = 0.5 * length * np.array([-1.0, 1.0])
        ends = ground.height(strip.east + away * math.sin(heading), strip.north + away * math.cos(heading))
        found.append(float(ends[1] - ends[0]) / length)
    return found[0], found[1]


@dataclass(frozen=True, slots=True)
class AskedReturns:
    """What is asked of returns, and what a planned mission sets for them.

    require: "rtl" among them where every return to launch has to be safe, "glide" where an engine may stop anywhere.
    rtl_altitude: over home, m; None where the scenario sets none.
    rally: (n, 3) east, north, m AMSL.
    rtl_autoland: ArduPlane's RTL_AUTOLAND; None where the scenario sets none.
    """

    require: tuple[ReturnDemand, ...]
    rtl_altitude: float | None
    rally: Floats
    rtl_autoland: int | None = None

    def __post_init__(self) -> None:
        """Lock the array."""
        rally = np.array(self.rally, dtype=np.float64).reshape(-1, 3)
        rally.setflags(write=False)
        object.__setattr__(self, "rally", rally)


# ----------------------------------------------------------------------
# Made of a scenario file's tables.


def make_home(
    table: HomeTable | None, source: str, origin: GeoOrigin, ground: Terrain | None, bounds: Floats, start: Floats
) -> Floats | None:
    """Home (3,), m on the map, on the ground; None without a table.

    start: (3,) m, that place = "start" is below.  source: names the file in messages.
    Raises ScenarioError where home is outside the area (2, 2), or the height of the ground there is not known.
    """
    if table is None:
        return None
    place = (float(start[0]), float(start[1])) if table.place == "start" else map_place(table, origin)
    return _on_ground("home", place, source, ground, bounds)


def make_launch(table: LaunchTable | None) -> Launch | None:
    """The launch of a table; None without one."""
    if table is None:
        return None
    incline = _INCLINE[table.method] if table.incline_deg is None else math.radians(table.incline_deg)
    course = None if table.course_deg is None else math.radians(table.course_deg)
    return Launch(table.method, course, table.speed_mps, table.length_m, incline)


def make_landing(
    table: LandingTable | None, source: str, origin: GeoOrigin, ground: Terrain | None, bounds: Floats
) -> LandingStrip | None:
    """The strip of a table; None without one.

    Raises ScenarioError as `make_home` does.
    """
    if table is None:
        return None
    place = map_place(table, origin)
    _on_ground("landing", place, source, ground, bounds)
    course = None if isinstance(table.course_deg, str) else math.radians(table.course_deg)
    slope = None if table.slope_deg is None else math.radians(table.slope_deg)
    return LandingStrip(*place, course, table.length_m, table.width_m, table.approach_m, slope)


def make_returns(
    table: ReturnsTable | None, source: str, origin: GeoOrigin, ground: Terrain | None
) -> AskedReturns | None:
    """What a table asks and sets of returns; None without one.

    Raises ScenarioError for a rally point that is not above the ground, and where a height above ground has none to
    count from.
    """
    if table is None:
        return None
    points = []
    for k, one in enumerate(table.rally or ()):
        key = f"returns.rally[{k}]"
        points.append(map_position(one, key, source, origin, ground))
        check_above_ground(key, points[-1], source, ground)
    return AskedReturns(tuple(table.require or ()), table.rtl_altitude_m, np.array(points), table.rtl_autoland)


def _on_ground(key: str, place: tuple[float, float], source: str, ground: Terrain | None, bounds: Floats) -> Floats:
    """A place on the ground, (3,) m."""
    check_in_area(key, np.array(place), source, bounds)
    under = float(ground.height(*place)) if ground is not None else math.nan
    if math.isnan(under):
        message = (
            f"{source}: {key}: east {place[0]:.0f} m, north {place[1]:.0f} m: the elevation file knows no ground there"
        )
        raise ScenarioError(message, file=source, field=key)
    return np.array([*place, under])
