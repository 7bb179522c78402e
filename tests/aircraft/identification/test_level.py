from dataclasses import replace

import numpy as np
import pytest

from aircraft.identification.alignment import align
from aircraft.identification.level import GRAVITY, forward_excess, remove_sensor_biases
from tests.aircraft.identification.flown_truth import flown_truth


def test_a_bias_ahead_shows_in_full_and_is_shared_with_the_level() -> None:
    flown = flown_truth()
    signals = align(flown.records, flown.estimate.clocks, 0.1)
    biased = replace(signals, acceleration=signals.acceleration + np.array([0.05, 0.0, 0.0]))
    assert forward_excess(biased)[0] - forward_excess(signals)[0] == pytest.approx(0.05, abs=0.001)
    mended, before = remove_sensor_biases(biased), remove_sensor_biases(signals)
    taken = float((biased.acceleration - mended.acceleration)[0, 0])
    pitched = float((mended.attitude - biased.attitude)[0, 1])
    # Whatever the shares are, they are the whole of it.
    assert taken + GRAVITY * pitched == pytest.approx(forward_excess(biased)[0], rel=1e-6)
    assert abs(forward_excess(before)[0]) < 0.002
