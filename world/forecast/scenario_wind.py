"""Make the wind of a scenario from the forecast that its [wind] table names."""

import math
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from world.airspace.zone_times import parse_span
from world.arrays import Floats
from world.errors import ForecastError
from world.forecast.forecast import LONGEST_STEP, Box, Forecast
from world.forecast.read_forecast import read_forecast
from world.forecast.wind_field import (
    MAX_FIELD_NUMBERS,
    MeanProfile,
    fit_mean_profile,
    limit_gradient,
    subtract_profile,
    without_levels_above,
)
from world.frames import GeoOrigin, to_geo
from world.wind import Wind

if TYPE_CHECKING:
    from world.scenario_tables import WindTable

# Height above the highest ground up to which the mean profile of a mission's wind is fitted, m.
_CLEARANCE_M = 150.0
# Ground higher above the start than this is treated as if it were this high, m: a mission does not climb over it.
_MAX_CLIMB_M = 2000.0
# Altitude above which the levels of a forecast are left out, m AMSL: the highest altitude of a scenario.
MAX_AMSL_M = 9000.0
# Distance below the lowest level within which the lowest level's wind applies, m.
MAX_DEPTH_BELOW_LEVELS_M = 100.0
# Distance around a forecast of a single place within which it applies, m: half a cell of a global model.
PLACE_RADIUS_M = 15_000.0
# Distance beyond the outermost nodes that is a rounding error, deg.
_BOX_TOLERANCE_DEG = 1e-6
# Strongest mean wind at the start, m/s: the range of a scenario's [wind] speed_mps.
_MAX_MEAN_WIND_MPS = 40.0


def map_box(origin: GeoOrigin, bounds: Floats) -> Box:
    """Return the geographic box (deg) around a map's bounds.

    bounds: [[west, east], [south, north]], (2, 2) m.
    """
    edges = [np.linspace(float(bounds[k, 0]), float(bounds[k, 1]), 9) for k in range(2)]
    east, north = (grid.ravel() for grid in np.meshgrid(*edges))
    latitudes, longitudes = to_geo(origin, east, north)
    near = origin.lon_deg + (longitudes - origin.lon_deg + 180.0) % 360.0 - 180.0
    return Box(float(latitudes.min()), float(near.min()), float(latitudes.max()), float(near.max()))


def departure_of(at: str) -> datetime:
    """Return the time of take-off, UTC, which is the start of the flight's time span.

    at: the time span as text; see `world.airspace.zone_times.parse_span`.
    """
    return parse_span(at)[0].astimezone(UTC)


def read_table_forecast(table: "WindTable", origin: GeoOrigin, bounds: Floats, start_ground: float) -> Forecast:
    """Read the forecast that a [wind] table names, for the area of a scenario.

    start_ground: ground at the mission's start, m AMSL.

    Raises ForecastError as `read_forecast` does.
    """
    return read_forecast(Path(str(table.forecast)), map_box(origin, bounds), start_ground)


class ForecastSite(NamedTuple):
    """Place of a mission in a forecast.

    origin: origin of the map.
    ends: start and destination of the mission, (3,) east, north and up, m.
    max_ground: highest ground of the map, m AMSL; -inf without terrain.
    """

    origin: GeoOrigin
    ends: tuple[Floats, Floats]
    max_ground: float


def forecast_wind(
    table: "WindTable", forecast: Forecast, at: str, site: ForecastSite, member: int
) -> tuple[Wind, "WindTable"]:
    """Return the wind of a flight in a forecast, and the [wind] table with the mean profile of this wind.

    at: time span of the flight as text; its start is the take-off.
    member: member of the ensemble, from 0.

    Raises ForecastError if the take-off is outside the forecast's times, or if an end of the mission is outside its box
    or its levels. Also raises ForecastError if the mean wind is stronger than a scenario allows.
    """
    file, departure = str(table.forecast), departure_of(at)
    if not forecast.first_time <= departure <= forecast.last_time:
        raise ForecastError.at(
            file,
            "time",
            f"take-off {departure:%Y-%m-%d %H:%M} UTC",
            f"the forecast covers {forecast.first_time:%Y-%m-%d %H:%M} to {forecast.last_time:%Y-%m-%d %H:%M} UTC",
        )
    before, after = forecast.step_at(departure)
    if departure < after and after - before > LONGEST_STEP:
        raise ForecastError.at(
            file,
            "time",
            f"take-off {departure:%Y-%m-%d %H:%M} UTC",
            f"the forecast has no time between {before:%Y-%m-%d %H:%M} and {after:%Y-%m-%d %H:%M} UTC;"
            f" steps of at most {LONGEST_STEP.total_seconds() / 3600.0:.0f} h are allowed",
        )
    latitudes, longitudes = to_geo(site.origin, [point[0] for point in site.ends], [point[1] for point in site.ends])
    altitudes = np.array([float(point[2]) for point in site.ends])
    reference = float(altitudes[0])
    field = without_levels_above(forecast.field_from(departure, member), MAX_AMSL_M)
    if field.packed().size > MAX_FIELD_NUMBERS:
        shown = f"{field.packed().size:,} numbers for a flight"
        raise ForecastError.at(file, "nodes", shown, f"allowed up to {MAX_FIELD_NUMBERS:,}: make its area smaller")
    # A mission flies from its lower end to somewhat above the highest ground.
    highest = max(float(altitudes.max()), min(site.max_ground, reference + _MAX_CLIMB_M)) + _CLEARANCE_M
    place = float(latitudes[0]), float(longitudes[0])
    profile = fit_mean_profile(field, 0.0, *place, reference, (float(altitudes.min()), highest))
    if profile.speed > _MAX_MEAN_WIND_MPS:
        raise ForecastError.at(
            file,
            "wind at the start",
            f"{profile.speed:.1f} m/s at {departure:%Y-%m-%d %H:%M} UTC",
            f"allowed 0..{_MAX_MEAN_WIND_MPS:g} m/s",
        )
    from_deg = round(math.degrees(profile.from_course), 5)
    entries = {"speed_mps": profile.speed, "from_deg": from_deg, "gradient": profile.gradient}
    wind = Wind(
        profile.speed,
        profile.from_course,
        profile.gradient,
        table.turbulence,
        table.seed,
        reference,
        subtract_profile(field, profile, reference),
        forecast.facts(departure),
    )
    check_coverage(wind, file, latitudes, longitudes, altitudes)
    return wind, table.model_copy(update=entries)


def check_coverage(wind: Wind, file: str, latitudes: Floats, longitudes: Floats, altitudes: Floats) -> None:
    """Raise ForecastError if a position of a mission is outside the box or the levels of the forecast.

    For a forecast of a single place, also raise it if a position is more than `PLACE_RADIUS_M` from this place. A
    stated wind, without a forecast, covers all positions.

    file: file of the forecast, for the message.
    latitudes, longitudes: (n,) deg.
    altitudes: (n,) m AMSL.
    """
    facts = wind.forecast
    if facts is None:
        return
    south, west, north, east = facts.box
    center = 0.5 * (west + east)
    near = center + (longitudes - center + 180.0) % 360.0 - 180.0
    if not facts.grid_km:
        east_distance = (near - west) * 111_000.0 * math.cos(math.radians(south))
        distances = np.hypot((latitudes - south) * 111_000.0, east_distance)
        is_outside = distances > PLACE_RADIUS_M
        radius_text = f"{PLACE_RADIUS_M / 1000.0:.0f} km"
        allowed = f"it must be within {radius_text} of the forecast's only place, {south:.3f}, {west:.3f}"
    else:
        beyond = np.maximum.reduce([south - latitudes, latitudes - north, west - near, near - east])
        is_outside = beyond > _BOX_TOLERANCE_DEG
        area = f"latitude {south:.3f} to {north:.3f}, longitude {west:.3f} to {east:.3f}"
        allowed = f"outside the forecast's area, {area}"
    if is_outside.any():
        k = int(np.argmax(is_outside))
        shown = f"the mission is at {latitudes[k]:.3f}, {longitudes[k]:.3f}"
        raise ForecastError.at(file, "latitude, longitude", shown, allowed)
    lowest, highest = np.array(facts.lowest_amsl), np.array(facts.highest_amsl)
    if wind.field is not None:
        # The levels at each place: levels above ground follow the ground of the forecast's model.
        lowest = wind.field.interpolate(0.0, latitudes, longitudes, -math.inf)[:, 2]
        highest = wind.field.interpolate(0.0, latitudes, longitudes, math.inf)[:, 2]
    above, below = altitudes - highest, lowest - MAX_DEPTH_BELOW_LEVELS_M - altitudes
    if above.max() > 0.0:
        k = int(np.argmax(above))
        top = float(altitudes[k] - above[k])
        shown = f"the mission flies at {altitudes[k]:.0f} m AMSL"
        raise ForecastError.at(
            file, "levels", shown, f"this is above the forecast's highest level, {top:.0f} m AMSL there"
        )
    if below.max() > 0.0:
        k = int(np.argmax(below))
        bottom = float(altitudes[k] + below[k]) + MAX_DEPTH_BELOW_LEVELS_M
        raise ForecastError.at(
            file,
            "levels",
            f"the mission flies at {altitudes[k]:.0f} m AMSL",
            f"the forecast's lowest level is at {bottom:.0f} m AMSL there, and applies {MAX_DEPTH_BELOW_LEVELS_M:.0f} m"
            " below itself",
        )


def with_mean_wind(wind: Wind, speed: float, from_course: float, gradient: float) -> Wind:
    """Return a wind with another mean profile; the wind of a forecast keeps its deviations from the mean.

    speed: m/s, at the reference altitude.
    from_course: direction that the mean wind blows from, rad.
    gradient: change of the speed with altitude, 1/s.

    The wind of a forecast changes by the same vector at all positions of one altitude.
    """
    field, mean_gradient = wind.field, gradient
    if field is not None:
        heights = field.altitudes - wind.reference_amsl
        mean_gradient = limit_gradient(gradient, speed, heights)
        old_mean = MeanProfile(wind.speed, wind.from_course, wind.gradient).velocities_at(heights)
        new_mean = MeanProfile(speed, from_course, mean_gradient).velocities_at(heights)
        old_shift = MeanProfile(wind.speed, wind.from_course, 0.0).velocities_at(heights)
        new_shift = MeanProfile(speed, from_course, gradient - wind.gradient).velocities_at(heights)
        field = replace(field, velocities=field.velocities + old_mean - old_shift + new_shift - new_mean)
    return replace(wind, speed=speed, from_course=from_course, gradient=mean_gradient, field=field)
