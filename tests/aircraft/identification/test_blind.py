"""Tests of blind predictions: bands, their coverage, and what they may know of the judged part."""

from dataclasses import replace

import numpy as np

from aircraft.identification.alignment import Clocks, align
from aircraft.identification.blind import DRAWS, Band, band_limits, uninformative_note
from aircraft.identification.flight_record import GRID_HZ, FlightRecord
from aircraft.identification.level import remove_sensor_biases

# Number of trials of the coverage.
_TRIALS = 20_000
# Bias of the roll gyro, rad/s.
_GYRO_BIAS = 0.02


def test_the_next_draw_is_inside_the_band_in_39_of_41_cases() -> None:
    """Of 41 equal values, the last is neither the lowest nor the highest with a probability of 39 / 41."""
    values = np.random.default_rng(1).normal(size=(DRAWS + 1, _TRIALS))
    low, high = band_limits(values[:DRAWS])
    share = float(((values[DRAWS] >= low) & (values[DRAWS] <= high)).mean())
    # Three standard deviations of a share of 20,000 trials are 0.0046.  The percentiles of the draws hold 0.90.
    assert abs(share - 39.0 / 41.0) < 0.005


def test_a_band_of_few_draws_is_unknown() -> None:
    """A band is known with 36 of 40 draws, and unknown with 35."""
    values = np.zeros((40, 2))
    values[:4, 0] = np.nan
    values[:5, 1] = np.nan
    low, high = band_limits(values)
    assert np.isfinite([low[0], high[0]]).all()
    assert np.isnan([low[1], high[1]]).all()


def test_the_share_inside_leaves_out_what_is_not_known() -> None:
    """Of five values, one has no band and one is not logged; of the other three, two are inside."""
    flown = np.array([0.0, 0.5, 2.0, np.nan, 0.0])
    low, high = np.array([-1.0, -1.0, -1.0, -1.0, np.nan]), np.array([1.0, 1.0, 1.0, 1.0, np.nan])
    band = Band("bank", "deg", np.arange(5.0), low, high, flown)
    assert band.inside == 2.0 / 3.0
    assert band.half_width == 1.0
    # Of four logged values, three have a band.
    assert band.known_fraction == 0.75


def test_a_band_as_wide_as_without_a_model_is_named() -> None:
    """Half of each band is 1 wide: it says something of a quantity that would change by 1.1, and nothing of 0.9."""
    along, low, high = np.arange(3.0), -np.ones(3), np.ones(3)
    bank, pitch, power = (
        Band(name, "", along, low, high, np.zeros(3), unchanged)
        for name, unchanged in (("bank", 0.9), ("pitch", 1.1), ("power", np.nan))
    )
    assert uninformative_note([bank, pitch, power]).startswith("the model does not predict bank: ")
    assert not uninformative_note([pitch, power])


def _steady_record(bias: float) -> FlightRecord:
    """Return a minute of straight and level flight, with a bias of the roll gyro, rad/s."""
    count = round(60.0 * GRID_HZ)
    zeros = np.zeros(count)
    velocity = np.column_stack([np.full(count, 20.0), zeros, zeros])
    acceleration = np.column_stack([zeros, zeros, np.full(count, -9.80665)])
    rates = np.column_stack([np.full(count, bias), zeros, zeros])
    return FlightRecord(
        time=np.arange(count) / GRID_HZ,
        acceleration=acceleration,
        rates=rates,
        attitude=np.zeros((count, 3)),
        velocity=velocity,
        wind=np.zeros((count, 2)),
        airspeed=np.full(count, 20.0),
        density=np.full(count, 1.2),
        height=np.full(count, 100.0),
        controls=np.zeros((count, 4)),
        current=np.full(count, np.nan),
        voltage=np.full(count, np.nan),
    )


def test_biases_come_from_the_earlier_part() -> None:
    """A gyro bias of the earlier part is removed from the judged part, and a change of it within that part stays."""
    earlier = align([_steady_record(_GYRO_BIAS)], [Clocks()], 0.0)
    judged = align([_steady_record(1.5 * _GYRO_BIAS)], [Clocks()], 0.0)
    rates = remove_sensor_biases(judged, reference=earlier).rates[:, 0]
    assert np.allclose(rates, 0.5 * _GYRO_BIAS)
    # Without a reference, the bias of the part itself is removed: that would be knowledge of the judged part.
    assert np.allclose(remove_sensor_biases(judged).rates[:, 0], 0.0)


def test_rows_between_two_times() -> None:
    """The part before a time and the part from it on make up the record."""
    record = replace(_steady_record(0.0), source="log")
    before, after = record.part_between(-np.inf, 20.0), record.part_between(20.0, np.inf)
    assert len(before.time) + len(after.time) == len(record.time)
    assert before.time[-1] < 20.0 <= after.time[0]
    assert after.source == "log"
