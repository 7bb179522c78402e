"""Predict parts of a log that no estimate has used, as bands of 95 %.

The fraction of the flight inside the bands is counted.

The judged part of the log is cut into windows. Each window starts from the measured state and follows the logged
controls. Forty flights of each window are simulated. Each of them uses another draw of the aircraft. The prediction
errors of the central aircraft (the estimate itself) over a random window of an earlier part of the log are added. These
blocks of errors contain gusts, sensor noise and errors of the model, with their growth over time and their correlation
(a block bootstrap: Kunsch 1989; Politis and Romano 1994). Sensor biases, trim offsets and the gust filter also come
from the earlier part. Nothing is fitted to the judged part.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aircraft.identification.airspeed import airspeed_scale
from aircraft.identification.alignment import Clocks, Signals, align
from aircraft.identification.base_model import BaseModel
from aircraft.identification.flight_record import GRID_HZ, FlightRecord
from aircraft.identification.flow import battery_voltage, flow_from_forces, make_motor
from aircraft.identification.level import remove_sensor_biases
from aircraft.identification.parameters import prior_means
from aircraft.identification.prediction import GustFilter, Predictor
from world.arrays import Flags, Floats, Ints

# Number of flights of each window. The lowest and the highest of 40 values enclose the next value of the same kind with
# a probability of 39 / 41, 95.1 %.
DRAWS = 40
# Probability with which the flight is inside a band.
COVERAGE = 0.95
# Fraction of the draws that must have a value for a band to be known.
_MIN_KNOWN_FRACTION = 0.9
# Duration of a window, s.
WINDOW_S = 2.0
# Time between the starts of windows in the earlier part, s; they may overlap.
_CALIBRATION_STEP_S = 0.5
# Time from the start of a record to its first window, s; the filter settles in this time.
_SETTLING_TIME_S = 2.0
# One of this many samples is kept, at `GRID_HZ`.
_THINNING_FACTOR = 5
# Seed of the blocks of errors.
_SEED = 68


@dataclass(frozen=True, slots=True)
class BlindQuantity:
    """One predicted quantity.

    name, unit: name and unit in texts.
    factor: factor from SI to the unit.
    """

    name: str
    unit: str
    factor: float = 1.0


# Predicted quantities; height and track begin with zero in each window.
QUANTITIES = (
    BlindQuantity("bank", "deg", float(np.degrees(1.0))),
    BlindQuantity("pitch", "deg", float(np.degrees(1.0))),
    BlindQuantity("airspeed", "m/s"),
    BlindQuantity("height rate", "m/s"),
    BlindQuantity("height", "m"),
    BlindQuantity("track", "m"),
    BlindQuantity("power", "W"),
)
# Columns of the height rate, the height and the power.
_HEIGHT_RATE = 3
_HEIGHT = 4
_POWER = 6


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Predicted band of one quantity, and the values of the flight.

    along: (n,) time or distance.
    low, high: (n,) ends of the band.
    flown: (n,) values of the flight; NaN where they are not known.
    unchanged: half the width of the band of a prediction without a model, in which the quantity keeps the value that it
        has at the start of each window; NaN if there is no such prediction.
    """

    name: str
    unit: str
    along: Floats
    low: Floats
    high: Floats
    flown: Floats
    unchanged: float = float("nan")

    @property
    def inside(self) -> float:
        """Fraction of the known values that lie inside the band; NaN without known values."""
        is_known = self._known
        is_inside = (self.flown >= self.low) & (self.flown <= self.high)
        return float(is_inside[is_known].mean()) if is_known.any() else float("nan")

    @property
    def half_width(self) -> float:
        """Half of the width of the band, median over all values."""
        is_known = self._known
        return float(np.median(0.5 * (self.high - self.low)[is_known])) if is_known.any() else float("nan")

    @property
    def known_fraction(self) -> float:
        """Fraction of the flight's known values at which the band is known, too; NaN without known values."""
        is_flown = np.isfinite(self.flown)
        return float(self._known[is_flown].mean()) if is_flown.any() else float("nan")

    @property
    def is_informative(self) -> bool:
        """True if the band is narrower than the band without a model (`unchanged`), or if `unchanged` is NaN."""
        return not self.half_width >= self.unchanged

    @property
    def _known(self) -> Flags:
        """Mask of the values at which the flight and the band are known, (n,)."""
        return np.isfinite(self.flown) & np.isfinite(self.low) & np.isfinite(self.high)


def uninformative_note(bands: Sequence[Band]) -> str:
    """Return a sentence about the quantities whose bands are not informative; "" without any."""
    names = ", ".join(band.name for band in bands if not band.is_informative)
    return f"the model does not predict {names}: the band is at least as wide as without a model" if names else ""


def band_limits(values: Floats) -> tuple[Floats, Floats]:
    """Return the ends of the band that contains another draw with the probability `COVERAGE`.

    values: draws, (d, n).

    The lower and the upper end are arrays (n,), at the plotting positions k / (d + 1) (Weibull 1939). Percentiles of
    the draws would give too narrow a band. The band is unknown (NaN) where fewer than `_MIN_KNOWN_FRACTION` of the
    draws have a value.

    >>> low, high = band_limits(np.arange(39.0)[:, np.newaxis])
    >>> low.round(9).tolist(), high.round(9).tolist()
    ([0.0], [38.0])
    """
    tail = 0.5 * (1.0 - COVERAGE)
    is_known = np.isfinite(values).mean(axis=0) >= _MIN_KNOWN_FRACTION
    limits = np.full((2, *values.shape[1:]), np.nan)
    limits[:, is_known] = np.nanquantile(values[:, is_known], [tail, 1.0 - tail], axis=0, method="weibull")
    return limits[0], limits[1]


class BlindPrediction:
    """Prediction of the judged part of a log, window by window, by draws of an aircraft's model.

    earlier: records before the judged part, for biases, trims, filters and errors.
    judged: records of the judged part.
    clocks: lags and delays of the log's sensors and servos, estimated from the earlier part.
    base: the central aircraft.
    window: length of a window, s.
    """

    def __init__(
        self,
        earlier: Sequence[FlightRecord],
        judged: Sequence[FlightRecord],
        clocks: Clocks,
        base: BaseModel,
        window: float = WINDOW_S,
    ) -> None:
        raw = align(earlier, [clocks] * len(earlier), base.motor_lag)
        self._earlier = remove_sensor_biases(raw)
        scale, _ = airspeed_scale(self._earlier, flow_from_forces(self._earlier, base, prior_means()))
        self._earlier = _scale_airspeed(self._earlier, scale)
        self._judged = _scale_airspeed(
            remove_sensor_biases(align(judged, [clocks] * len(judged), base.motor_lag), reference=raw), scale
        )
        self._times = np.concatenate([record.time for record in judged])
        self._count = round(window * self._earlier.hertz)
        central = Predictor(self._earlier, base, prior_means())
        self._filters: Sequence[GustFilter] = central.filters
        starts = _window_starts(self._earlier, self._count, round(_CALIBRATION_STEP_S * self._earlier.hertz))
        measured = _measured_quantities(self._earlier, starts, self._count)
        self._errors = measured - self._simulate_windows(self._earlier, base, starts)
        self._changes = measured - measured[:, :1]
        # For the height, the change beyond the change at a constant height rate.
        seconds = np.arange(measured.shape[1]) * _THINNING_FACTOR / GRID_HZ
        self._changes[:, :, _HEIGHT] -= measured[:, :1, _HEIGHT_RATE] * seconds
        self._starts = _window_starts(self._judged, self._count, self._count)
        self._flown = _measured_quantities(self._judged, self._starts, self._count)

    @property
    def windows(self) -> tuple[int, int]:
        """Number of windows in the earlier part, and in the judged part."""
        return len(self._errors), len(self._starts)

    def bands(self, draws: Sequence[BaseModel]) -> tuple[Band, ...]:
        """Return the band of each of `QUANTITIES` in the judged windows.

        draws: draws of the aircraft with which the windows are predicted.

        Each draw predicts every window, and the prediction errors of a random window of the earlier part are added. The
        bands are computed from these predictions by `band_limits`.
        """
        generator = np.random.default_rng(_SEED)
        blocks = generator.integers(len(self._errors), size=(len(draws), len(self._starts)))
        flights = np.stack(
            [
                self._simulate_windows(self._judged, base, self._starts) + self._errors[block_numbers]
                for base, block_numbers in zip(draws, blocks, strict=True)
            ]
        )
        flights[:, :, :, _POWER] = np.maximum(0.0, flights[:, :, :, _POWER])
        low, high = band_limits(flights)
        times = self._times[self._starts[:, np.newaxis] + _compared_rows(self._count)].ravel()
        bands = []
        for k, quantity in enumerate(QUANTITIES):
            unchanged = np.quantile(np.abs(self._changes[:, :, k]), COVERAGE, axis=0)
            lower, upper, flown = (quantity.factor * values[:, :, k].ravel() for values in (low, high, self._flown))
            width = quantity.factor * float(np.median(unchanged))
            bands.append(Band(quantity.name, quantity.unit, times, lower, upper, flown, width))
        return tuple(bands)

    def _simulate_windows(self, signals: Signals, base: BaseModel, starts: Ints) -> Floats:
        """Simulate a window from each start row (w,), with the trims of the earlier part.

        Returns the q `QUANTITIES` at the k samples of `_compared_rows` in each window, (w, k, q).
        """
        values = prior_means()
        trims = Predictor(self._earlier, base, values, self._filters).trims.mean(axis=0)
        predictor = Predictor(signals, base, values, self._filters, trims=trims)
        states = np.stack(list(predictor.simulate(starts, self._count)), axis=1)
        rows = starts[:, np.newaxis] + np.arange(self._count + 1)
        measured_velocity = signals.velocity[rows[:, 0]]
        motor = make_motor(base, values)
        airspeed = np.linalg.norm(states[:, :, :3], axis=2)
        volts = battery_voltage(signals, base)
        battery = volts[rows] if isinstance(volts, np.ndarray) else np.full(rows.shape, volts)
        flat = [array.ravel() for array in (airspeed, signals.throttle[rows], signals.density[rows], battery)]
        _, current = motor.thrust_and_current(*flat)
        u, v, w, _, pitch_rate, yaw_rate, roll, pitch = np.moveaxis(states, 2, 0)
        # Heading by integrating the turn rate.
        rate = (pitch_rate * np.sin(roll) + yaw_rate * np.cos(roll)) / np.cos(pitch)
        turned = np.cumsum(0.5 * (1.0 / signals.hertz) * (rate[:, 1:] + rate[:, :-1]), axis=1)
        start_heading = signals.attitude[rows[:, 0], 2][:, np.newaxis]
        heading = start_heading + np.concatenate([np.zeros((len(states), 1)), turned], axis=1)
        # Velocity through the air with wings level, then with wings and nose level, then north, east and down.
        wings_level_down = v * np.sin(roll) + w * np.cos(roll)
        right = v * np.cos(roll) - w * np.sin(roll)
        forward = u * np.cos(pitch) + wings_level_down * np.sin(pitch)
        down = wings_level_down * np.cos(pitch) - u * np.sin(pitch)
        north = forward * np.cos(heading) - right * np.sin(heading)
        east = forward * np.sin(heading) + right * np.cos(heading)
        air = np.stack([north, east, down], axis=2)
        # The wind stays as at the start of the window.
        velocity = air + (measured_velocity - air[:, 0])[:, np.newaxis]
        return _stack_quantities(
            states[:, :, 6:8], airspeed, velocity, current.reshape(rows.shape) * battery, signals.hertz
        )


def _scale_airspeed(signals: Signals, factor: float) -> Signals:
    """Return signals with the airspeed multiplied by a factor."""
    return replace(signals, airspeed=signals.airspeed * factor)


def _compared_rows(count: int) -> Ints:
    """Return the indices of the samples in a window at which quantities are compared.

    They are every `_THINNING_FACTOR`-th sample after the measured start of the window.

    count: number of samples in the window.
    """
    return np.arange(_THINNING_FACTOR, count + 1, _THINNING_FACTOR)


def _window_starts(signals: Signals, count: int, step: int) -> Ints:
    """Return the rows at which the windows of all records start, (w,).

    count: number of samples in a window.
    step: rows between the starts of two windows.
    """
    settling = round(_SETTLING_TIME_S * signals.hertz)
    return np.concatenate(
        [
            np.arange(start_row + settling, end_row - count - 1, step)
            for start_row, end_row in zip(signals.edges[:-1], signals.edges[1:], strict=True)
        ]
    )


def _measured_quantities(signals: Signals, starts: Ints, count: int) -> Floats:
    """Return the measured `QUANTITIES` in windows, (w, k, q); power is NaN for a log without current.

    starts: first row of each window, (w,).
    count: number of samples in a window.
    """
    rows = starts[:, np.newaxis] + np.arange(count + 1)
    return _stack_quantities(
        signals.attitude[rows, :2],
        signals.airspeed[rows],
        signals.velocity[rows],
        signals.current[rows] * signals.voltage[rows],
        signals.hertz,
    )


def _stack_quantities(angles: Floats, airspeed: Floats, velocity: Floats, power: Floats, hertz: float) -> Floats:
    """Return the `QUANTITIES` of windows at the samples of `_compared_rows`, (w, k, q).

    angles: bank and pitch, rad, (w, n, 2).
    airspeed: m/s, (w, n).
    velocity: velocity over the ground, north, east, down, m/s, (w, n, 3).
    power: W, (w, n).
    """
    north, east, down = np.moveaxis(velocity, 2, 0)
    course = np.arctan2(east[:, :1], north[:, :1])
    right = east * np.cos(course) - north * np.sin(course)
    height, track = (np.cumsum(speed, axis=1) / hertz for speed in (-down, right))
    rows = _compared_rows(angles.shape[1] - 1)
    columns = (angles[:, :, 0], angles[:, :, 1], airspeed, -down, height - height[:, :1], track - track[:, :1], power)
    return np.stack([column[:, rows] for column in columns], axis=2)
