import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flight.mission.items import Mission, MissionItem
from logs.importers.clean_positions import DEGREE_LENGTH_M
from logs.importers.imported_flight import (
    MIN_FLYING_SPEED_MPS,
    choose_part,
    find_flight_parts,
    find_flight_spans,
    make_flight,
    make_track,
    mean_wind,
    with_flown_altitudes,
)
from logs.importers.raw_log import (
    EXAMPLE_LEAD_S,
    EXAMPLE_LEG_M,
    EXAMPLE_SPEED_MPS,
    LoggedMission,
    LogSeries,
    ModeChange,
    RawLog,
    example_raw_log,
)
from world.errors import LogError
from world.frames import GeoOrigin

MISSION = example_raw_log().missions[0].mission


def spans_at(speeds: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Spans of a log that goes north at these speeds (m/s) for these times (s)."""
    speed = np.concatenate([np.full(int(seconds * 5), value) for value, seconds in speeds])
    lat = 46.0 + np.cumsum(speed * 0.2) / DEGREE_LENGTH_M
    return find_flight_spans(np.arange(lat.size) * 0.2, lat, np.full(lat.size, 8.0))


def test_slower_than_flying_is_no_flight() -> None:
    assert spans_at([(MIN_FLYING_SPEED_MPS - 0.1, 100.0)]) == []
    assert len(spans_at([(MIN_FLYING_SPEED_MPS + 0.1, 100.0)])) == 1


def test_a_short_dash_is_no_flight() -> None:
    assert spans_at([(0.0, 60.0), (20.0, 15.0), (0.0, 60.0)]) == []
    assert len(spans_at([(0.0, 60.0), (20.0, 25.0), (0.0, 60.0)])) == 1


def test_slow_for_a_minute_is_the_same_flight_and_longer_another() -> None:
    """Against the wind an aircraft may stand for a while; a minute on the ground ends a flight."""
    assert len(spans_at([(20.0, 60.0), (1.0, 50.0), (20.0, 60.0)])) == 1
    assert len(spans_at([(20.0, 60.0), (1.0, 90.0), (20.0, 60.0)])) == 2


def test_stretches_are_those_in_auto() -> None:
    modes = [
        ModeChange(0.0, "FBWA", False),
        ModeChange(20.0, "AUTO", True),
        ModeChange(50.0, "FBWA", False),
        ModeChange(60.0, "AUTO", True),
    ]
    (part,) = find_flight_parts([(10.0, 100.0)], modes, [LoggedMission(1.0, MISSION, "CMD")], 200.0)
    assert [(one.start, one.end, one.ended, one.next_mode) for one in part.stretches] == [
        (20.0, 50.0, "mode", "FBWA"),
        (60.0, 100.0, "landed", ""),
    ]
    (cut,) = find_flight_parts([(10.0, 100.0)], modes, [], 101.0)
    assert cut.stretches[-1].ended == "log"
    assert (part.mission, cut.mission) == (0, -1)


def test_a_flight_with_two_missions_is_two_parts_and_the_longer_is_chosen() -> None:
    modes = [ModeChange(0.0, "AUTO", True), ModeChange(40.0, "LOITER", False), ModeChange(50.0, "AUTO", True)]
    missions = [LoggedMission(0.0, MISSION, "CMD"), LoggedMission(45.0, MISSION, "CMD")]
    parts = find_flight_parts([(0.0, 200.0)], modes, missions, 300.0)
    assert [(part.mission, part.along_mission) for part in parts] == [(0, 40.0), (1, 150.0)]
    assert choose_part(parts) == 1


def test_without_modes_all_of_a_flight_counts() -> None:
    (part,) = find_flight_parts([(5.0, 90.0)], [], [LoggedMission(0.0, MISSION, "route")], 91.0)
    assert [(one.start, one.end, one.mode, one.ended) for one in part.stretches] == [(5.0, 90.0, "", "log")]


def test_a_flight_without_auto_is_shown_and_not_judged() -> None:
    (part,) = find_flight_parts([(5.0, 90.0)], [ModeChange(0.0, "FBWA", False)], [], 91.0)
    assert part.stretches == ()


# ----------------------------------------------------------------------
# One flight of a log.


def with_series(raw: RawLog, **series: LogSeries | None) -> RawLog:
    kept = {name: found for name, found in (dict(raw.series) | series).items() if found is not None}
    return replace(raw, series=kept)


@pytest.mark.parametrize("vehicle", ["copter", "rover", "boat", "submarine", "tracker", "blimp"])
def test_a_vehicle_that_is_no_aeroplane_is_refused_by_name(vehicle: Any) -> None:
    raw = replace(example_raw_log(), vehicle=vehicle, program="ArduSomething V4.5")
    with pytest.raises(LogError, match=rf"this log is from an? (antenna )?{vehicle} \(program ArduSome"):
        make_flight(raw)


def test_a_bench_log_is_refused() -> None:
    raw = example_raw_log()
    still = raw.series["position"]
    values = np.broadcast_to(still.values[0], still.values.shape)
    with pytest.raises(LogError, match="contains no flight: the ground speed never stayed above 6 m/s for"):
        make_flight(with_series(raw, position=LogSeries("POS", still.time, values)))


def test_other_rates_are_brought_to_the_times_of_the_places() -> None:
    raw = example_raw_log()
    time = np.arange(20.0, 112.0, 0.7)
    airspeed = LogSeries("ARSP", time, (time * 0.5)[:, None])
    flight = make_flight(with_series(raw, airspeed=airspeed))
    inside = flight.time <= time[-1]
    assert np.abs(flight.columns["airspeed"][inside, 0] - 0.5 * flight.time[inside]).max() < 1e-9


def test_nothing_is_made_up_where_a_series_has_a_pause() -> None:
    raw = example_raw_log()
    wind = raw.series["wind"]
    keep = (wind.time < 50.0) | (wind.time > 60.0)
    flight = make_flight(with_series(raw, wind=LogSeries("XKF2", wind.time[keep], wind.values[keep])))
    unknown = np.isnan(flight.columns["wind"][:, 0])
    # Half a step beside the rows that there are.
    assert np.array_equal(unknown, (flight.time >= 50.0 - 1e-9) & (flight.time <= 60.0 + 1e-9))


def test_yaw_goes_through_north_the_short_way() -> None:
    raw = example_raw_log()
    own = raw.series["attitude"]
    rows = own.time[::2]
    yaw = np.where(np.arange(rows.size) % 2 == 0, np.radians(359.0), np.radians(1.0))
    values = np.column_stack([yaw * 0.0, yaw * 0.0, yaw])
    flight = make_flight(with_series(raw, attitude=LogSeries("ATT", rows, values)))
    degrees = np.degrees(flight.columns["attitude"][1:-1:2, 2])
    assert np.minimum(degrees, 360.0 - degrees).max() < 1e-6


def test_heights_are_named_with_their_offsets() -> None:
    heights = make_flight(example_raw_log()).heights
    assert (heights.source, heights.datum) == ("POS", "amsl")
    assert [(one.name, round(one.offset, 6)) for one in heights.offsets] == [("GPS.Alt", 0.5)]


def test_what_is_not_there_is_not_held() -> None:
    flight = make_flight(with_series(example_raw_log(), airspeed=None, wind=None, attitude=None))
    assert flight.holds == ("velocity", "throttle", "heights")


def test_a_flight_is_taken_by_its_number() -> None:
    assert make_flight(example_raw_log(), 1).number == 1
    with pytest.raises(LogError, match=r"flight 2: the log has flights 1\.\.1"):
        make_flight(example_raw_log(), 2)


def test_across_the_180th_meridian_the_near_row_counts() -> None:
    task = Mission(None, (MissionItem(1, 16, 0, (0.0,) * 4, -17.0, -179.999, 0.0),))
    lon = np.array([179.9, 179.9995, -179.9])
    flown = with_flown_altitudes(task, np.full(3, -17.0), lon, np.array([100.0, 200.0, 300.0]))
    assert flown.items[0].alt == 200.0


def test_rows_without_a_height_do_not_count() -> None:
    task = Mission(None, (MissionItem(1, 16, 0, (0.0,) * 4, 46.0, 8.0, 0.0),))
    flown = with_flown_altitudes(task, np.array([46.0, 46.1]), np.full(2, 8.0), np.array([np.nan, 300.0]))
    assert flown.items[0].alt == 300.0


def blown(east: float, north: float):
    raw = example_raw_log()
    rows = raw.series["wind"]
    values = np.broadcast_to([east, north], rows.values.shape)
    return mean_wind(make_flight(replace(raw, series={**raw.series, "wind": LogSeries("XKF2", rows.time, values)})))


@pytest.mark.parametrize(("east", "north", "from_deg"), [(5.0, 0.0, 270.0), (0.0, 5.0, 180.0), (-3.0, -3.0, 45.0)])
def test_a_wind_comes_from_where_it_does_not_blow_to(east: float, north: float, from_deg: float) -> None:
    wind = blown(east, north)
    assert wind is not None
    assert math.degrees(wind.from_course) == pytest.approx(from_deg)
    assert wind.speed == pytest.approx(math.hypot(east, north))


def test_without_a_wind_there_is_none() -> None:
    raw = example_raw_log()
    series = {name: found for name, found in raw.series.items() if name != "wind"}
    assert mean_wind(make_flight(replace(raw, series=series))) is None


# ----------------------------------------------------------------------
# Places on the map south of the equator, west of Greenwich, across the 180th meridian and below the sea.

PLACES = {
    "north and east": (46.0, 8.0, 500.0),
    "south and west": (-33.9, -70.7, 900.0),
    "across the 180th meridian": (-17.0, 179.998, 120.0),
    "below the sea": (31.5, 35.45, -380.0),
}


@pytest.mark.parametrize("place", PLACES)
def test_the_flight_is_where_its_formula_has_it(place: str) -> None:
    lat, lon, up = PLACES[place]
    flight = make_flight(example_raw_log(lat, lon, up))
    track = make_track(flight, GeoOrigin(lat, lon))
    run = EXAMPLE_SPEED_MPS * (track.time - 20.0 - EXAMPLE_LEAD_S)
    wanted = np.column_stack(
        [np.maximum(run - EXAMPLE_LEG_M, 0.0), np.minimum(run, EXAMPLE_LEG_M), np.full(run.size, up)]
    )
    assert np.abs(track.position - wanted).max() < 1e-3


def test_what_the_log_does_not_hold_is_no_number() -> None:
    track = make_track(make_flight(example_raw_log()), GeoOrigin(46.0, 8.0))
    for name in ("rates", "commands", "load_factor", "current", "energy"):
        assert np.isnan(getattr(track, name)).all()
    assert (track.controls[:, 3] == np.float32(0.6)).all()


def test_velocities_that_are_missing_are_those_of_the_places() -> None:
    raw = example_raw_log()
    series = {name: found for name, found in raw.series.items() if name != "velocity"}
    flight = make_flight(type(raw)(**{**{f: getattr(raw, f) for f in raw.__slots__}, "series": series}))
    track = make_track(flight, GeoOrigin(46.0, 8.0))
    assert np.abs(np.hypot(*track.velocity[:, :2].T)[10:200] - EXAMPLE_SPEED_MPS).max() < 0.01
