"""Make the wind of a scenario from the forecast that its [wind] table names."""

import math
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from world.airspace.zone_times import parse_span
from world.arrays import Floats
from world.errors import ForecastError
from world.forecast.forecast import Forecast
from world.forecast.read_forecast import Box, read_forecast
from world.forecast.wind_field import fit_mean_profile, subtract_profile, without_high_levels
from world.frames import GeoOrigin, to_geo
from world.wind import Wind

if TYPE_CHECKING:
    from world.scenario_tables import WindTable

# Height above the highest ground up to which the mean profile of a mission's wind is fitted, m.
_CLEARANCE_M = 150.0
# Greatest height above the start of ground that counts for this, m.
_MAX_CLIMB_M = 2000.0


def map_box(origin: GeoOrigin, bounds: Floats) -> Box:
    """Return the geographic box around a map's bounds (2, 2), deg."""
    edges = [np.linspace(float(bounds[k, 0]), float(bounds[k, 1]), 9) for k in range(2)]
    east, north = (grid.ravel() for grid in np.meshgrid(*edges))
    latitudes, longitudes = to_geo(origin, east, north)
    near = origin.lon_deg + (longitudes - origin.lon_deg + 180.0) % 360.0 - 180.0
    return Box(float(latitudes.min()), float(near.min()), float(latitudes.max()), float(near.max()))


def departure_of(at: str) -> datetime:
    """Return the time of take-off, the start of a scenario's time of flight."""
    return parse_span(at)[0].astimezone(UTC)


def scenario_forecast(table: "WindTable", origin: GeoOrigin, bounds: Floats, start_ground: float) -> Forecast:
    """Read the forecast that a [wind] table names, around the bounds of a scenario's map.

    start_ground: ground at the mission's start, m AMSL.

    Raises ForecastError as `read_forecast` does.
    """
    return read_forecast(Path(str(table.forecast)), map_box(origin, bounds), start_ground)


class ForecastSite(NamedTuple):
    """Place of a mission in a forecast.

    origin: of the map.
    ends: start and destination of the mission, (3,) east, north and up, m.
    max_ground: highest ground of the map, m AMSL; -inf without terrain.
    """

    origin: GeoOrigin
    ends: tuple[Floats, Floats]
    max_ground: float


def forecast_wind(
    table: "WindTable", forecast: Forecast, at: str, site: ForecastSite, member: int
) -> tuple[Wind, "WindTable"]:
    """Return the wind of a flight in a forecast, and the [wind] table with the wind's mean profile.

    at: time of flight, whose start is the take-off.
    member: member of the ensemble.

    Raises ForecastError if the take-off is outside the forecast's times, or an end of the mission outside its box or
    its levels.
    """
    file, departure = str(table.forecast), departure_of(at)
    if not forecast.first_time <= departure <= forecast.last_time:
        raise ForecastError.at(
            file,
            "time",
            f"take-off {departure:%Y-%m-%d %H:%M} UTC",
            f"the forecast covers {forecast.first_time:%Y-%m-%d %H:%M} to {forecast.last_time:%Y-%m-%d %H:%M} UTC",
        )
    facts = forecast.facts(departure)
    latitudes, longitudes = to_geo(site.origin, [point[0] for point in site.ends], [point[1] for point in site.ends])
    altitudes = [float(point[2]) for point in site.ends]
    if fault := facts.place_fault(latitudes, longitudes) or facts.altitude_fault(altitudes):
        raise ForecastError(f"{file}: {fault}", file=file)
    reference = altitudes[0]
    field = without_high_levels(forecast.field_from(departure, member), reference)
    # A mission flies from its lower end to somewhat above the highest ground.
    lowest, highest = min(altitudes), max(*altitudes, min(site.max_ground, reference + _MAX_CLIMB_M)) + _CLEARANCE_M
    place = float(latitudes[0]), float(longitudes[0])
    profile = fit_mean_profile(field, 0.0, *place, reference, (lowest, highest))
    new_table = table.model_copy(
        update={
            "speed_mps": profile.speed,
            "from_deg": round(math.degrees(profile.from_course), 5),
            "gradient": profile.gradient,
        }
    )
    wind = Wind(
        profile.speed,
        profile.from_course,
        profile.gradient,
        table.turbulence,
        table.seed,
        reference,
        subtract_profile(field, profile, reference),
        facts,
    )
    return wind, new_table
