"""Represent a plan's departure from the ground and its approach to the ground.

Both can be converted to JSON.

A plan's path stays in the air between start and destination.  If its scenario has `[launch]` or `[landing]`, the
departure leads from home to the path and the approach from the path to the landing strip;
`planner.search.lay_ground_ways` lays them out.
"""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from world.arrays import Floats

_Metres = Annotated[float, Field(ge=-500_000.0, le=500_000.0)]
_Position = Annotated[list[_Metres], Field(min_length=3, max_length=3)]
_Course = Annotated[float, Field(ge=-10.0, le=10.0)]
_Length = Annotated[float, Field(gt=0.0, le=100_000.0)]


@dataclass(frozen=True, slots=True, eq=False)
class ClimbOut:
    """Departure from home to the plan's start.

    It has a launch, a straight climb to the take-off altitude, and waypoints.

    home: (3,) m, on the ground.
    course: launch course, rad clockwise from north.
    up: altitude at the end of the take-off, m AMSL.
    waypoints: (n, 3) m, between home and the plan's first waypoint.
    gradient: minimum climb gradient with which the departure can be flown, m per m.
    """

    home: Floats
    course: float
    up: float
    waypoints: Floats
    gradient: float

    def __post_init__(self) -> None:
        """Lock the arrays."""
        _lock_arrays(self, "home", "waypoints")


@dataclass(frozen=True, slots=True, eq=False)
class Descent:
    """Approach from the plan's end to the ground.

    It has waypoints to the line-up, which is a level leg, and a glide.

    waypoints: (n, 3) m, before the line-up.
    final_waypoints: (2, 3) m, both ends of the line-up, at one altitude on the landing course; the glide begins at the
        second.
    point: (3,) m, the landing point on the ground.
    course: landing course, rad clockwise from north.
    slope: slope of the straight line from the end of the line-up to the landing point, m per m.
    go_around: height above home to which a go-around climbs, m.
    """

    waypoints: Floats
    final_waypoints: Floats
    point: Floats
    course: float
    slope: float
    go_around: float

    def __post_init__(self) -> None:
        """Lock the arrays."""
        _lock_arrays(self, "waypoints", "final_waypoints", "point")


@dataclass(frozen=True, slots=True)
class DepartureAndApproach:
    """Departure and approach of a plan; each is None if the scenario requires none, or if it is blocked."""

    climb: ClimbOut | None = None
    descent: Descent | None = None


def _lock_arrays(procedure: ClimbOut | Descent, *names: str) -> None:
    """Replace the named arrays of a departure or approach by read-only copies.

    `waypoints` and `final_waypoints` get the shape (n, 3), also if they are empty.
    """
    for name in names:
        array = np.array(getattr(procedure, name), dtype=np.float64)
        array = array.reshape(-1, 3) if name in ("waypoints", "final_waypoints") else array
        array.setflags(write=False)
        object.__setattr__(procedure, name, array)


# ----------------------------------------------------------------------
# File format.


class _FileTable(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True)


class _ClimbFile(_FileTable):
    home_east_north_amsl_m: _Position
    course_rad: _Course
    takeoff_amsl_m: _Metres
    waypoints_east_north_amsl_m: Annotated[list[_Position], Field(min_length=1, max_length=1000)]
    gradient: Annotated[float, Field(gt=0.0, le=10.0)]


class _DescentFile(_FileTable):
    waypoints_east_north_amsl_m: Annotated[list[_Position], Field(max_length=1000)]
    line_up_east_north_amsl_m: Annotated[list[_Position], Field(min_length=2, max_length=2)]
    point_east_north_amsl_m: _Position
    course_rad: _Course
    slope: Annotated[float, Field(gt=0.0, le=10.0)]
    go_around_m: _Length


class DepartureAndApproachFile(_FileTable):
    """Departure and approach of a plan as JSON, with units in the keys; each is None if missing."""

    climb: _ClimbFile | None = None
    descent: _DescentFile | None = None

    def to_procedures(self) -> DepartureAndApproach:
        """Convert the entries of the file to a departure and an approach; each is None if it is missing."""
        climb_file, descent_file = self.climb, self.descent
        climb = descent = None
        if climb_file is not None:
            climb = ClimbOut(
                np.array(climb_file.home_east_north_amsl_m),
                climb_file.course_rad,
                climb_file.takeoff_amsl_m,
                np.array(climb_file.waypoints_east_north_amsl_m),
                climb_file.gradient,
            )
        if descent_file is not None:
            descent = Descent(
                np.array(descent_file.waypoints_east_north_amsl_m),
                np.array(descent_file.line_up_east_north_amsl_m),
                np.array(descent_file.point_east_north_amsl_m),
                descent_file.course_rad,
                descent_file.slope,
                descent_file.go_around_m,
            )
        return DepartureAndApproach(climb, descent)


def departure_and_approach_json(procedures: DepartureAndApproach) -> dict[str, Any]:
    """Convert a departure and an approach to JSON data, from which `DepartureAndApproachFile` reads them.

    >>> climb = ClimbOut(np.zeros(3), 0.5, 80.0, np.array([[0.0, 600.0, 90.0]]), 0.15)
    >>> data = departure_and_approach_json(DepartureAndApproach(climb))
    >>> list(data), DepartureAndApproachFile.model_validate(data).to_procedures().climb.waypoints.tolist()
    (['climb'], [[0.0, 600.0, 90.0]])
    """
    data: dict[str, Any] = {}
    if (climb := procedures.climb) is not None:
        data["climb"] = {
            "home_east_north_amsl_m": climb.home.tolist(),
            "course_rad": climb.course,
            "takeoff_amsl_m": climb.up,
            "waypoints_east_north_amsl_m": climb.waypoints.tolist(),
            "gradient": climb.gradient,
        }
    if (descent := procedures.descent) is not None:
        data["descent"] = {
            "waypoints_east_north_amsl_m": descent.waypoints.tolist(),
            "line_up_east_north_amsl_m": descent.final_waypoints.tolist(),
            "point_east_north_amsl_m": descent.point.tolist(),
            "course_rad": descent.course,
            "slope": descent.slope,
            "go_around_m": descent.go_around,
        }
    return data
