"""A MAVLink mission as data: items, home, fences and rally points."""

import math
from dataclasses import dataclass, field
from enum import IntEnum


class Command(IntEnum):
    """The MAV_CMD numbers that planfly knows by name."""

    NAV_WAYPOINT = 16
    NAV_LOITER_UNLIM = 17
    NAV_LOITER_TURNS = 18
    NAV_LOITER_TIME = 19
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    NAV_LOITER_TO_ALT = 31
    NAV_SPLINE_WAYPOINT = 82
    NAV_VTOL_TAKEOFF = 84
    NAV_VTOL_LAND = 85
    DO_JUMP = 177
    DO_CHANGE_SPEED = 178
    DO_LAND_START = 189
    NAV_FENCE_POLYGON_INCLUSION = 5001
    NAV_FENCE_POLYGON_EXCLUSION = 5002
    NAV_FENCE_CIRCLE_INCLUSION = 5003
    NAV_FENCE_CIRCLE_EXCLUSION = 5004
    NAV_RALLY_POINT = 5100


class Frame(IntEnum):
    """MAV_FRAME numbers; heights are AMSL, relative to home, or above terrain."""

    GLOBAL = 0
    MISSION = 2
    GLOBAL_RELATIVE_ALT = 3
    GLOBAL_INT = 5
    GLOBAL_RELATIVE_ALT_INT = 6
    GLOBAL_TERRAIN_ALT = 10
    GLOBAL_TERRAIN_ALT_INT = 11


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One mission item.

    seq: its number in the file it came from (home is not an item).  params: p1..p4, NaN where unset.
    lat_deg, lon_deg: degrees on the 1e-7 grid of MISSION_ITEM_INT.  alt: m in the item's frame.
    """

    seq: int
    command: int
    frame: int
    params: tuple[float, float, float, float]
    lat_deg: float
    lon_deg: float
    alt: float
    autocontinue: bool = True

    @property
    def x(self) -> int:
        """Latitude as MISSION_ITEM_INT carries it, 1e-7 degrees, rounded, never truncated."""
        return round(self.lat_deg * 1e7)

    @property
    def y(self) -> int:
        """Longitude as MISSION_ITEM_INT carries it."""
        return round(self.lon_deg * 1e7)

    @property
    def has_position(self) -> bool:
        """Whether its latitude and longitude say anything (0, 0 means that they do not)."""
        return not (self.x == 0 and self.y == 0) and math.isfinite(self.lat_deg) and math.isfinite(self.lon_deg)


@dataclass(frozen=True, slots=True)
class Home:
    """The planned home position; alt in m AMSL."""

    lat_deg: float
    lon_deg: float
    alt: float


@dataclass(frozen=True, slots=True)
class Mission:
    """A mission: what a .waypoints file, a .plan file or an upload holds.

    home: None where the file has none, or 0,0.  fences: items 5001..5004, one per vertex or circle.
    rally: items 5100.  warnings: what was odd about the file but could be read.  source: names it in messages.
    """

    home: Home | None
    items: tuple[MissionItem, ...]
    fences: tuple[MissionItem, ...] = ()
    rally: tuple[MissionItem, ...] = ()
    cruise_speed: float | None = None
    warnings: tuple[str, ...] = field(default=())
    source: str = "mission"
