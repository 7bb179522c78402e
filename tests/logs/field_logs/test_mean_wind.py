import math
from dataclasses import replace

import numpy as np
import pytest

from logs.field_logs.example_raw_log import example_raw_log
from logs.field_logs.field_flight import make_flight
from logs.field_logs.mean_wind import mean_wind
from logs.field_logs.raw_log import LogSeries


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
