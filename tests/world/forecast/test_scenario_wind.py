"""Coverage of a mission by a forecast in place and time, and the change of its wind with its mean."""

import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from world.errors import ForecastError
from world.forecast.forecast import Forecast
from world.forecast.scenario_wind import ForecastSite, check_coverage, forecast_wind, map_box, with_mean_wind
from world.frames import GeoOrigin
from world.scenario_tables import WindTable

NOON = datetime(2026, 5, 1, 12, tzinfo=UTC)
ORIGIN = GeoOrigin(46.0, 8.0)
TABLE = WindTable(forecast="a.nc")


def made_forecast(*, single: bool = False) -> Forecast:
    """Return a westerly wind from 12:00 to 14:00: 8 m/s at 100 m, 12 m/s at 900 m."""
    count = 1 if single else 2
    latitudes, longitudes = (np.array([value]) if single else value + np.array([-0.1, 0.1]) for value in (46.0, 8.0))
    shape = (2, count, count, 2)
    return Forecast(
        source="a.nc",
        issued=NOON - timedelta(hours=6),
        times=NOON.timestamp() + np.array([0.0, 7200.0]),
        latitudes=latitudes,
        longitudes=longitudes,
        altitudes=np.broadcast_to([100.0, 900.0], shape).copy(),
        velocities=np.broadcast_to([[8.0, 0.0], [12.0, 0.0]], (1, *shape, 2)).copy(),
    )


def uniform_forecast(east: float) -> Forecast:
    return replace(made_forecast(), velocities=np.broadcast_to([east, 0.0], (1, 2, 2, 2, 2, 2)).copy())


def site(east: float = 1000.0) -> ForecastSite:
    return ForecastSite(ORIGIN, (np.array([0.0, 0.0, 180.0]), np.array([east, 0.0, 180.0])), -math.inf)


def test_the_box_around_a_map() -> None:
    box = map_box(ORIGIN, np.array([[-7000.0, 7000.0], [-11_000.0, 11_000.0]]))
    # 111.1 km for a degree of latitude, 77.4 km for one of longitude.
    assert box.north - box.south == pytest.approx(22.0 / 111.1, rel=0.01)
    assert box.east - box.west == pytest.approx(14.0 / 77.4, rel=0.01)
    across = map_box(GeoOrigin(0.0, 180.0), np.array([[-7000.0, 7000.0], [-500.0, 500.0]]))
    assert across.west < 180.0 < across.east
    assert across.east - across.west < 0.2


def test_the_forecast_ends_before_a_step_of_more_than_six_hours() -> None:
    forecast = made_forecast()
    longer = replace(forecast, times=NOON.timestamp() + 3600.0 * np.array([0.0, 6.0, 13.0, 14.0]))
    assert [
        (longer.interpolation_end(NOON + timedelta(hours=h)) - NOON).total_seconds() / 3600 for h in (0, 1, 6, 13)
    ] == [
        6.0,
        6.0,
        6.0,
        14.0,
    ]
    # 0.2 degrees of latitude, and of longitude by cos 45.9 degrees.
    assert forecast.grid_km == pytest.approx(0.2 * 111.2)
    wide = replace(forecast, longitudes=8.0 + np.array([-0.5, 0.5]))
    assert wide.grid_km == pytest.approx(111.2 * math.cos(math.radians(45.9)))


def test_the_words_of_a_forecast_name_a_later_issue_and_the_member() -> None:
    facts = made_forecast().facts(NOON)
    later = replace(facts, issued=NOON + timedelta(hours=42), members=2).describe()
    assert "(42 h after take-off)" in later
    assert "2 members (one flight takes the first)" in later


@pytest.mark.parametrize("minutes", [0, 120])
def test_the_first_and_the_last_time_are_covered(minutes: int) -> None:
    at = (NOON + timedelta(minutes=minutes)).isoformat()
    wind, table = forecast_wind(TABLE, made_forecast(), at, site(), 0)
    # 80 of 800 m above the lower level.
    assert table.speed_mps == wind.speed == pytest.approx(8.4, abs=1e-4)


@pytest.mark.parametrize("minutes", [-1, 121])
def test_a_minute_outside_is_not(minutes: int) -> None:
    at = (NOON + timedelta(minutes=minutes)).isoformat()
    with pytest.raises(ForecastError, match="the forecast covers 2026-05-01 12:00 to 2026-05-01 14:00 UTC") as caught:
        forecast_wind(TABLE, made_forecast(), at, site(), 0)
    assert caught.value.field == "time"


@pytest.mark.parametrize(("east", "is_inside"), [(7500.0, True), (8000.0, False)])
def test_places_at_the_edge_of_the_box(east: float, is_inside: bool) -> None:
    """0.1 degrees of longitude are 7.74 km."""
    if is_inside:
        forecast_wind(TABLE, made_forecast(), NOON.isoformat(), site(east), 0)
        return
    with pytest.raises(
        ForecastError, match=r"outside the forecast's area, latitude 45\.900 to 46\.100, longitude 7\.900 to 8\.100"
    ):
        forecast_wind(TABLE, made_forecast(), NOON.isoformat(), site(east), 0)


@pytest.mark.parametrize(("east", "is_near"), [(14_500.0, True), (15_500.0, False)])
def test_a_single_place_holds_for_15_km(east: float, is_near: bool) -> None:
    if is_near:
        forecast_wind(TABLE, made_forecast(single=True), NOON.isoformat(), site(east), 0)
        return
    with pytest.raises(ForecastError, match="within 15 km of the forecast's only place"):
        forecast_wind(TABLE, made_forecast(single=True), NOON.isoformat(), site(east), 0)


@pytest.mark.parametrize("is_varied", [True, False])
@pytest.mark.parametrize(
    ("amsl", "words"),
    [(899.0, ""), (901.0, "highest level, 900 m AMSL"), (1.0, ""), (-1.0, "lowest level is at 100 m AMSL")],
)
def test_altitudes_at_the_ends_of_the_levels(amsl: float, words: str, is_varied: bool) -> None:
    forecast = made_forecast() if is_varied else uniform_forecast(6.0)
    wind, _ = forecast_wind(TABLE, forecast, NOON.isoformat(), site(), 0)
    assert (wind.field is None) != is_varied
    place = np.array([46.0]), np.array([8.0]), np.array([amsl])
    if words:
        with pytest.raises(ForecastError, match=words):
            check_coverage(wind, "a.nc", *place)
    else:
        check_coverage(wind, "a.nc", *place)


@pytest.mark.parametrize(("east", "is_allowed"), [(39.0, True), (41.0, False)])
def test_the_strongest_mean_wind(east: float, is_allowed: bool) -> None:
    if is_allowed:
        assert forecast_wind(TABLE, uniform_forecast(east), NOON.isoformat(), site(), 0)[0].speed == east
        return
    with pytest.raises(ForecastError, match=r"41\.0 m/s at 2026-05-01 12:00 UTC: allowed 0\.\.40 m/s") as caught:
        forecast_wind(TABLE, uniform_forecast(east), NOON.isoformat(), site(), 0)
    assert caught.value.field == "wind at the start"


def test_a_field_of_too_many_numbers_is_refused() -> None:
    """5 times, 600 x 600 nodes and 4 levels, with 3 numbers each."""
    shape = (5, 600, 600, 4)
    forecast = replace(
        made_forecast(),
        times=NOON.timestamp() + 3600.0 * np.arange(5.0),
        latitudes=45.0 + np.arange(600) / 300.0,
        longitudes=7.0 + np.arange(600) / 300.0,
        altitudes=np.broadcast_to(np.array([50.0, 100.0, 500.0, 900.0]), shape),
        velocities=np.broadcast_to(np.array([5.0, 0.0]), (1, *shape, 2)),
    )
    # 21.6 million, and the axes.
    with pytest.raises(
        ForecastError, match=r"a\.nc: nodes: 21,60\d,\d+ numbers for a flight: allowed up to 20,000,000"
    ):
        forecast_wind(TABLE, forecast, NOON.isoformat(), site(), 0)


def test_a_shift_to_no_mean_wind_leaves_the_differences_of_the_levels() -> None:
    wind, _ = forecast_wind(TABLE, made_forecast(), NOON.isoformat(), site(), 0)
    calm = with_mean_wind(wind, 0.0, wind.from_course, wind.gradient)
    assert calm.field is not None
    assert (calm.speed, calm.gradient) == (0.0, 0.0)
    found = calm.field.velocities_at(0.0, 46.0, 8.0, [100.0, 180.0, 900.0])
    # 8 m/s, 8.4 m/s and 12 m/s, less the mean wind of 8.4 m/s.
    assert found[:, 0] == pytest.approx([-0.4, 0.0, 3.6], abs=1e-4)
