"""The scale of an airspeed sensor, of made flights in a wind and gusts that are known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from aircraft.identification.airspeed import SCALE_SD, airspeed_scale, with_airspeed_scale
from aircraft.identification.alignment import Clocks, Signals, align
from aircraft.identification.flight_record import GRID_HZ, FlightRecord
from aircraft.identification.flow import Flow
from tests.aircraft.identification.flown_truth import SENSORS, flown_truth
from tests.soak import scaled


def flown(
    reads: float, *, turns: bool, seed: int = 1, seconds: float = 360.0, leg: float = 25.0, drift: float = 1e9
) -> tuple[Signals, Flow]:
    """Level flight at 25 m/s without sideslip, in squares or straight ahead; reads: factor of the airspeed sensor.

    The wind is 5 m/s; gusts of 0.7 m/s are forgotten over 11 s and change airspeed and heading, the way made good only
    as the aircraft drifts with them.  drift: time constant of that, s.  leg: time of one with its turn of 6 s, s.
    """
    count = round(seconds * GRID_HZ)
    time = np.arange(count) / GRID_HZ
    legs = np.clip((time % leg - leg + 6.0) / 6.0, 0.0, 1.0) + time // leg
    course = 0.5 * np.pi * legs if turns else np.zeros(count)
    steady = 25.0 * np.column_stack([np.cos(course), np.sin(course)])
    wind = np.array([4.0, -3.0])
    decay = np.exp(-1.0 / (11.0 * GRID_HZ))
    noise = np.random.default_rng(seed).normal(size=(count, 2))
    gusts = 0.7 * lfilter([np.sqrt(1.0 - decay**2)], [1.0, -decay], noise, axis=0)
    slow = np.exp(-1.0 / (drift * GRID_HZ))
    drifting = lfilter([1.0 - slow], [1.0, -slow], gusts, axis=0)
    air = steady + drifting - gusts
    zero = np.zeros(count)
    record = FlightRecord(
        time=time,
        acceleration=np.zeros((count, 3)),
        rates=np.zeros((count, 3)),
        attitude=np.column_stack([zero, zero, np.unwrap(np.arctan2(air[:, 1], air[:, 0]))]),
        velocity=np.column_stack([steady + drifting + wind, zero]),
        wind=np.zeros((count, 2)),
        airspeed=reads * np.hypot(*air.T),
        density=zero + 1.2,
        height=zero,
        controls=np.zeros((count, 4)),
        current=zero,
        voltage=zero,
    )
    return align([record], [Clocks(0.0, 0.0, 0.0)], 0.0), Flow(zero, zero, zero)


@pytest.mark.parametrize("reads", [0.96, 1.0, 1.04])
def test_turns_in_the_wind_tell_the_scale(reads: float) -> None:
    factor, sd = airspeed_scale(*flown(reads, turns=True))
    assert sd < 0.008
    # The prior draws a part of the way back to 1.
    assert factor * reads == pytest.approx(1.0, abs=2.5 * sd)
    assert reads == 1.0 or abs(factor * reads - 1.0) < 0.3 * abs(reads - 1.0)


def test_the_airspeed_is_multiplied_with_it() -> None:
    signals, flow = flown(0.96, turns=True)
    mended = with_airspeed_scale(signals, flow)
    assert float(mended.airspeed.mean()) == pytest.approx(25.0, abs=0.4)
    assert mended.airspeed_factor * signals.airspeed == pytest.approx(mended.airspeed)


def test_gusts_do_not_count_for_the_scale() -> None:
    """Over many flights the mean error is none; taken as measured, gusts would cost a percent and more."""
    errors = [airspeed_scale(*flown(1.0, turns=True, seed=seed))[0] - 1.0 for seed in range(12)]
    assert abs(np.mean(errors)) < 0.004
    assert np.std(errors) < 0.01


def test_gusts_that_an_aircraft_drifts_with_count_little() -> None:
    """Turned seldom and drifting soon, its way made good has the gusts in it: taken as the air's they cost 0.37 %."""
    flights = [flown(1.0, turns=True, seed=seed, seconds=1600.0, leg=80.0, drift=3.0) for seed in range(scaled(8, 4))]
    errors = [airspeed_scale(*one)[0] - 1.0 for one in flights]
    assert abs(np.mean(errors)) < 0.0025


def test_straight_flight_tells_nothing() -> None:
    """A sensor as it comes is known to 2 %."""
    assert SCALE_SD == 0.02
    _, sd = airspeed_scale(*flown(0.97, turns=False))
    assert 0.014 < sd < 0.021


def test_a_flight_by_arduplanes_law_has_its_sensors_scale() -> None:
    factor, sd = flown_truth().estimate.airspeed
    assert factor * SENSORS.airspeed == pytest.approx(1.0, abs=2.5 * sd)
    assert sd < 0.008


def test_each_stretch_has_its_own_wind() -> None:
    signals, flow = flown(0.97, turns=True)
    half = len(signals.airspeed) // 2
    other = signals.velocity.copy()
    other[half:, :2] += [8.0, 8.0]
    parted = replace(signals, velocity=other, edges=(0, half, 2 * half))
    factor, sd = airspeed_scale(parted, flow)
    assert factor * 0.97 == pytest.approx(1.0, abs=2.5 * sd)
