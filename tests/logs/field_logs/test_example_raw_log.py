import numpy as np
import pytest

from logs.field_logs.clean_places import metres_between
from logs.field_logs.example_raw_log import SPEED, STEP, example_raw_log


@pytest.mark.parametrize("lon", [8.0, 179.995])
def test_it_flies_at_its_speed(lon: float) -> None:
    lat, east, _ = example_raw_log(-33.0, lon).series["position"].values.T
    assert np.abs(metres_between(lat, east) / STEP - SPEED).max() < 0.2
