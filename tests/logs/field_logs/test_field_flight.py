from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from logs.field_logs.example_raw_log import example_raw_log
from logs.field_logs.field_flight import make_flight
from logs.field_logs.raw_log import LogSeries, RawLog
from world.errors import LogError


def with_series(raw: RawLog, **series: LogSeries | None) -> RawLog:
    kept = {name: found for name, found in (dict(raw.series) | series).items() if found is not None}
    return replace(raw, series=kept)


@pytest.mark.parametrize("vehicle", ["copter", "rover", "boat", "submarine", "tracker", "blimp"])
def test_a_vehicle_that_is_no_aeroplane_is_refused_by_name(vehicle: Any) -> None:
    raw = replace(example_raw_log(), vehicle=vehicle, program="ArduSomething V4.5")
    with pytest.raises(LogError, match=rf"{vehicle if vehicle != 'tracker' else 'antenna tracker'}'s log \(ArduSome"):
        make_flight(raw)


def test_a_bench_log_is_refused() -> None:
    raw = example_raw_log()
    still = raw.series["position"]
    values = np.broadcast_to(still.values[0], still.values.shape)
    with pytest.raises(LogError, match="no flight in it: in 92 s it never went faster"):
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
    with pytest.raises(LogError, match=r"--flight 2: it holds flights 1\.\.1"):
        make_flight(example_raw_log(), 2)
