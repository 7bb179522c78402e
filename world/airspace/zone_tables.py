"""[[zones]] of a scenario file as a pydantic model."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from world.scenario_types import (
    Amsl,
    Height,
    Latitude,
    Longitude,
    Metres,
    Name,
    Radius,
    ScenarioTable,
    within,
)

# Corners of a ring, and rings of a zone, at most.
MOST_CORNERS, MOST_RINGS = 20_000, 1_000
# Zones of a scenario at most, those of its files included.
MOST_ZONES = 20_000


def _latitude_first(corner: list[float]) -> list[float]:
    """The corner, if its first number can be a latitude."""
    if not -89.0 <= corner[0] <= 89.0:
        raise ValueError(f"latitude {corner[0]:g}: allowed -89..89; a corner is [latitude, longitude]")
    return corner


_MetreCorner = Annotated[list[Metres], Field(min_length=2, max_length=2)]
_Degrees = Annotated[float, within(-180.0, 180.0)]
_DegreeCorner = Annotated[list[_Degrees], Field(min_length=2, max_length=2), AfterValidator(_latitude_first)]
_MetreRing = Annotated[list[_MetreCorner], Field(max_length=MOST_CORNERS)]
_DegreeRing = Annotated[list[_DegreeCorner], Field(max_length=MOST_CORNERS)]


class ZoneTable(ScenarioTable):
    """[[zones]]: a polygon, by its corners, or a cylinder, by its centre and radius; and its band of heights.

    polygon_m: corners as [east, north]; polygon_deg: as [latitude, longitude].
    rings_m, rings_deg: several such rings, for a zone with holes or of several parts: inside is what lies in an odd
    number of them.
    east_m, north_m or lat_deg, lon_deg, with radius_m: a cylinder.
    floor, ceiling: above mean sea level or above ground; none where neither is given.
    """

    name: Name
    kind: Literal["inclusion", "exclusion"]
    polygon_m: _MetreRing | None = None
    polygon_deg: _DegreeRing | None = None
    rings_m: Annotated[list[_MetreRing], Field(max_length=MOST_RINGS)] | None = None
    rings_deg: Annotated[list[_DegreeRing], Field(max_length=MOST_RINGS)] | None = None
    east_m: Metres | None = None
    north_m: Metres | None = None
    lat_deg: Latitude | None = None
    lon_deg: Longitude | None = None
    radius_m: Radius | None = None
    floor_amsl_m: Amsl | None = None
    floor_agl_m: Height | None = None
    ceiling_amsl_m: Amsl | None = None
    ceiling_agl_m: Height | None = None

    @model_validator(mode="after")
    def _one_shape(self) -> "ZoneTable":
        shapes = ("polygon_m", "polygon_deg", "rings_m", "rings_deg", "radius_m")
        given = [key for key in shapes if getattr(self, key) is not None]
        if len(given) != 1:
            raise ValueError(f"polygon_m: give one of {', '.join(shapes)}, not {len(given)}")
        metres = (self.east_m is not None, self.north_m is not None)
        degrees = (self.lat_deg is not None, self.lon_deg is not None)
        if self.radius_m is None:
            if any(metres) or any(degrees):
                raise ValueError("radius_m: missing; a centre is a cylinder's")
        elif not ((all(metres) and not any(degrees)) or (all(degrees) and not any(metres))):
            raise ValueError("position: give east_m and north_m, or lat_deg and lon_deg, not both")
        return self

    @model_validator(mode="after")
    def _one_band(self) -> "ZoneTable":
        for side in ("floor", "ceiling"):
            if getattr(self, f"{side}_amsl_m") is not None and getattr(self, f"{side}_agl_m") is not None:
                raise ValueError(f"{side}_agl_m: give {side}_amsl_m or {side}_agl_m, not both")
        for datum in ("amsl", "agl"):
            floor, ceiling = getattr(self, f"floor_{datum}_m"), getattr(self, f"ceiling_{datum}_m")
            if floor is not None and ceiling is not None and ceiling <= floor:
                raise ValueError(f"ceiling_{datum}_m: {ceiling:g}: must be above floor_{datum}_m {floor:g}")
        return self
