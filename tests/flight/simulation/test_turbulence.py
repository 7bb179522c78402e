"""Dryden gusts against MIL-F-8785C's formulas, over long seeded runs."""

import itertools
import math

import numpy as np
import pytest
from numba import njit
from scipy.signal import welch

from aircraft.catalog import Aircraft
from flight.simulation.simulate import Flight
from flight.simulation.track import as_track
from flight.simulation.turbulence import GUST_FILTERS, dryden_scales, start_gusts, step_gusts
from tests.setups import MakeSetup
from world.arrays import Floats
from world.kernels import Record

SPEED, DT = 25.0, 1.0 / 60.0
LIGHT, MODERATE = 7.716, 15.43  # 15 and 30 knots at 20 ft


@njit
def _run(noise: Floats, filters: Record, w20: float, height: float, speed: float, dt: float) -> Floats:
    out = np.empty((noise.shape[0], 3))
    for k in range(noise.shape[0]):
        out[k, 0], out[k, 1], out[k, 2] = step_gusts(filters, noise[k], w20, height, speed, dt)
    return out


def _gusts(
    count: int, height: float, seed: int = 1, w20: float = MODERATE, speed: float = SPEED, dt: float = DT
) -> Floats:
    random = np.random.default_rng(seed)
    filters = np.zeros(1, GUST_FILTERS)[0]
    start_gusts(random.standard_normal(5), filters)
    return np.asarray(_run(random.standard_normal((count, 3)), filters, w20, height, speed, dt))


def _military(height: float, w20: float) -> tuple[Floats, Floats]:
    """Scale lengths (m) and standard deviations (m/s) along, across and down, by 3.7.3.4, in feet as it is written."""
    feet = min(1000.0, max(10.0, height / 0.3048))
    root = 0.177 + 0.000823 * feet
    scales = np.array([feet / root**1.2, feet / root**1.2, feet]) * 0.3048
    sigma_w = 0.1 * w20
    return scales, np.array([sigma_w / root**0.4, sigma_w / root**0.4, sigma_w])


def _spectra(frequency: Floats, height: float, w20: float, speed: float) -> Floats:
    """(3, f) two-sided Dryden spectra over radians a second, MIL-F-8785C 3.7.1.2, integral over all = variance."""
    scales, sigmas = _military(height, w20)
    lag = (scales / speed)[:, None] * frequency
    along = sigmas[0] ** 2 * scales[0] / (math.pi * speed) / (1 + lag[0] ** 2)
    cross = [
        sigmas[k] ** 2 * scales[k] / (2 * math.pi * speed) * (1 + 3 * lag[k] ** 2) / (1 + lag[k] ** 2) ** 2
        for k in (1, 2)
    ]
    return np.array([along, *cross])


@pytest.mark.parametrize("height", [1.0, 10.0, 60.0, 150.0, 304.8, 900.0])
def test_scales_by_the_standard(height: float) -> None:
    scales, sigmas = _military(height, 10.0)
    length_u, length_w, ratio = dryden_scales(height)
    assert (length_u, length_w, ratio) == pytest.approx((scales[0], scales[2], sigmas[0] / sigmas[2]), rel=1e-12)


def test_known_scales() -> None:
    # At 1,000 ft the model meets the isotropic one of greater heights: 1,000 ft and equal standard deviations.
    assert dryden_scales(304.8) == pytest.approx((304.8, 304.8, 1.0), rel=1e-12)
    # At 200 ft by hand: 0.177 + 0.1646 = 0.3416; 200 / 0.3416^1.2 = 725.8 ft; 0.3416^-0.4 = 1.537.
    length_u, length_w, ratio = dryden_scales(200 * 0.3048)
    assert (length_u / 0.3048, length_w / 0.3048, ratio) == pytest.approx((725.8, 200.0, 1.537), rel=3e-4)


def test_the_reference_spectra_hold_the_variance() -> None:
    frequency = np.linspace(0.0, 1000.0, 1_000_001)
    _, sigmas = _military(60.0, MODERATE)
    total = 2 * np.trapezoid(_spectra(frequency, 60.0, MODERATE, SPEED), frequency, axis=1)
    assert total == pytest.approx(sigmas**2, rel=2e-3)


@pytest.mark.parametrize("height", [60.0, 400.0])
def test_variance_and_mean(height: float) -> None:
    # Two million ticks of 60 Hz are 9 hours, 800 time scales at least: 5 % on a standard deviation is 2 sigma.
    gusts = _gusts(2_000_000, height)
    _, sigmas = _military(height, MODERATE)
    assert gusts.std(axis=0) == pytest.approx(sigmas, rel=0.05)
    assert np.abs(gusts.mean(axis=0) / sigmas).max() < 0.1
    # The three axes have nothing to do with one another.
    assert np.abs(np.corrcoef(gusts.T) - np.eye(3)).max() < 0.08


def test_autocorrelation() -> None:
    height = 60.0
    gusts = _gusts(2_000_000, height)
    scales, _ = _military(height, MODERATE)
    unit = gusts / gusts.std(axis=0)
    for axis, scale in enumerate(scales):
        for share in (0.25, 0.5, 1.0):
            lag = round(share * scale / SPEED / DT)
            x = lag * DT * SPEED / scale
            # Longitudinal exp(-x), transverse exp(-x) (1 - x / 2): the transforms of the spectra.
            wanted = math.exp(-x) * (1.0 if axis == 0 else 1.0 - x / 2)
            got = float((unit[:-lag, axis] * unit[lag:, axis]).mean())
            assert got == pytest.approx(wanted, abs=0.05)


def test_spectra() -> None:
    height = 60.0
    gusts = _gusts(2_000_000, height, seed=4)
    hertz, power = welch(gusts, fs=1 / DT, nperseg=2**14, axis=0)
    # One-sided over Hz to two-sided over rad/s.
    wanted = _spectra(2 * math.pi * hertz, height, MODERATE, SPEED) * 4 * math.pi
    edges = np.geomspace(0.02, 6.0, 12)  # a tenth of the sampling rate: beyond, the discrete filters fold
    for low, high in itertools.pairwise(edges):
        band = (hertz >= low) & (hertz < high)
        assert power[band].mean(axis=0) == pytest.approx(wanted[:, band].mean(axis=1), rel=0.15)


def test_starts_stationary() -> None:
    # The first gust of many flights has the standard deviation of all others.
    _, sigmas = _military(60.0, LIGHT)
    first = np.array([_gusts(1, 60.0, seed=seed, w20=LIGHT)[0] for seed in range(4000)])
    assert first.std(axis=0) == pytest.approx(sigmas, rel=0.04)


def test_step_length_does_not_matter() -> None:
    fine = _gusts(1_000_000, 60.0, dt=DT)
    coarse = _gusts(1_000_000, 60.0, dt=2 * DT)
    assert fine.std(axis=0) == pytest.approx(coarse.std(axis=0), rel=0.06)


def test_same_noise_same_gusts() -> None:
    assert np.array_equal(_gusts(500, 60.0, seed=7), _gusts(500, 60.0, seed=7))
    assert not np.array_equal(_gusts(500, 60.0, seed=7), _gusts(500, 60.0, seed=8))
    assert np.isfinite(_gusts(100, math.inf)).all()
    assert np.isfinite(_gusts(100, -5.0, speed=0.0)).all()


def test_gusts_of_a_flight_turn_with_the_wind_and_count_height_from_the_ground(
    make_setup: MakeSetup, aerosonde: Aircraft
) -> None:
    # JSBSim's own model fails both: it leaves a pure east wind's gusts unrotated and counts height from the sea.
    def gusts(from_deg: float, ground: float = 100.0) -> Floats:
        course = math.radians(from_deg)
        way = np.array(
            [[0.0, 0.0, ground + 100.0], [3000.0 * math.sin(course), 3000.0 * math.cos(course), ground + 100.0]]
        )
        setup = make_setup(way, wind=(6.0, from_deg), turbulence="moderate", terrain={"kind": "flat", "amsl_m": ground})
        flight = Flight(setup, aerosonde)
        rows, _ = flight.fly_block(120)
        wind = as_track(rows).wind[1:].astype(np.float64)
        along = -np.array([math.sin(course), math.cos(course)])
        return np.column_stack([wind[:, :2] @ along - 6.0, wind[:, :2] @ np.array([along[1], -along[0]]), wind[:, 2]])

    north = gusts(0.0)
    assert float(np.abs(north).max()) > 0.5
    for from_deg in (90.0, 200.0):
        assert gusts(from_deg) == pytest.approx(north, abs=0.03)
    # Thinner air, the same heights above ground.
    assert gusts(0.0, ground=1500.0) == pytest.approx(north, abs=0.1)
