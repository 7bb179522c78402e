import numpy as np
import pytest

from logs.importers.clean_positions import measure_steps
from logs.importers.raw_log import COLUMNS, EXAMPLE_SPEED_MPS, EXAMPLE_STEP_S, example_raw_log


def test_each_series_has_a_column_for_each_name() -> None:
    for name, series in example_raw_log().series.items():
        assert series.values.shape == (len(series.time), len(COLUMNS[name]))


@pytest.mark.parametrize("lon", [8.0, 179.995])
def test_it_flies_at_its_speed(lon: float) -> None:
    lat, east, _ = example_raw_log(-33.0, lon).series["position"].values.T
    assert np.abs(measure_steps(lat, east) / EXAMPLE_STEP_S - EXAMPLE_SPEED_MPS).max() < 0.2
