"""Define the input of an identification: sensors and controls of one flight on a common time grid."""

from dataclasses import dataclass, fields, replace
from functools import cache

import numpy as np

from world.arrays import Floats

# Samples per second of the grid.
GRID_HZ = 50.0


@dataclass(frozen=True, slots=True)
class FlightRecord:
    """Part of a flight without a gap, as logged, without any correction of delays; SI units and radians.

    time: (n,) s, `GRID_HZ` samples per second.
    acceleration: (n, 3) specific force of the accelerometers, body axes forward, right, down, m/s^2.
    rates: (n, 3) p, q, r of the gyros, rad/s.
    attitude: (n, 3) roll, pitch, yaw, rad.
    velocity: (n, 3) north, east, down over the ground, m/s.
    wind: (n, 2) velocity of the air, north and east, as estimated by the autopilot, m/s.
    airspeed: (n,) true, m/s.
    density: (n,) kg/m^3.
    height: (n,) m AMSL.
    controls: (n, 4) commanded elevator, aileron and rudder (rad, positive as in the model) and throttle (0..1).
    current: (n,) current from the battery, A; NaN for a log without current.
    voltage: (n,) voltage of the battery, V; NaN for a log without voltage.
    source: name of the log in texts.
    """

    time: Floats
    acceleration: Floats
    rates: Floats
    attitude: Floats
    velocity: Floats
    wind: Floats
    airspeed: Floats
    density: Floats
    height: Floats
    controls: Floats
    current: Floats
    voltage: Floats
    source: str = ""

    @property
    def seconds(self) -> float:
        """Duration of the record, s."""
        return len(self.time) / GRID_HZ

    def central_part(self, seconds: float) -> "FlightRecord":
        """Return the central part of the record, at most ``seconds`` long."""
        rows = round(seconds * GRID_HZ)
        begin = max(0, (len(self.time) - rows) // 2)
        return self.rows(slice(begin, begin + rows))

    def part_between(self, start: float, end: float) -> "FlightRecord":
        """Return the part of the record from a start time up to an end time (excluded), s."""
        begin_row, end_row = np.searchsorted(self.time, [start, end]).tolist()
        return self.rows(slice(begin_row, end_row))

    def rows(self, rows: slice) -> "FlightRecord":
        """Return a copy of the record with only the rows in the slice."""
        columns = {field.name: getattr(self, field.name)[rows] for field in fields(self) if field.name != "source"}
        return replace(self, **columns)

    @property
    def has_current(self) -> bool:
        """True if the battery's current is known throughout."""
        return bool(np.isfinite(self.current).all())


@cache
def _filter_sections(cutoff: float, hertz: float) -> Floats:
    """Return the second-order sections of a Butterworth low-pass filter; cutoff and sampling rate in Hz."""
    # Imported here, as in the neighboring modules: scipy is an extra, without which `planfly` still has this module's
    # names.
    from scipy.signal import butter

    return np.asarray(butter(2, cutoff, fs=hertz, output="sos"))


def low_pass(values: Floats, cutoff: float, hertz: float = GRID_HZ) -> Floats:
    """Low-pass values forwards and backwards, so that there is no delay.

    values: (n,) or (n, k).
    cutoff: cutoff of the second-order Butterworth filter, Hz.
    hertz: samples per second.

    >>> steady = low_pass(np.full(200, 3.0), 0.5)
    >>> bool(np.allclose(steady, 3.0))
    True
    """
    from scipy.signal import sosfiltfilt

    sections = _filter_sections(cutoff, hertz)
    # The ends are mirrored over one period of the cutoff, or over the available samples.
    length = min(len(values) - 1, round(hertz / cutoff))
    return np.asarray(sosfiltfilt(sections, values, axis=0, padlen=length))


def apply_delay(values: Floats, delay: float) -> Floats:
    """Return values delayed by ``delay`` (s), by linear interpolation; a negative delay advances them.

    values: (n,) or (n, k).

    >>> apply_delay(np.arange(5.0), 0.02)
    array([0., 0., 1., 2., 3.])
    """
    rows = np.arange(len(values)) - delay * GRID_HZ
    lower_rows = np.clip(np.floor(rows).astype(np.intp), 0, len(values) - 1)
    upper_rows = np.clip(lower_rows + 1, 0, len(values) - 1)
    fraction = np.clip(rows - lower_rows, 0.0, 1.0)
    fraction = fraction[:, np.newaxis] if values.ndim == 2 else fraction
    return np.asarray(values[lower_rows] * (1.0 - fraction) + values[upper_rows] * fraction)


def apply_lag(values: Floats, time_constant: float) -> Floats:
    """Return the output of a first-order lag with a time constant, s.

    values: input, (n,) or (n, k).

    Between two samples the input is assumed to be constant at their mean.

    >>> apply_lag(np.array([0.0, 1.0, 1.0]), 0.0)
    array([0., 1., 1.])
    """
    if time_constant <= 1e-4:
        return values.copy()
    from scipy.signal import lfilter

    decay = float(np.exp(-1.0 / (GRID_HZ * time_constant)))
    # The input holds its mean over a sample: half of the last and half of this value.
    gain = 0.5 * (1.0 - decay)
    numerator, denominator = [gain, gain], [1.0, -decay]
    initial_state = values[:1] * (1.0 - gain)
    lagged_values, _ = lfilter(numerator, denominator, values, axis=0, zi=initial_state)
    return np.asarray(lagged_values)


def derivative(values: Floats) -> Floats:
    """Return the time derivative of samples, per second, by central differences.

    values: samples at `GRID_HZ`, (n,) or (n, k).
    """
    return np.asarray(np.gradient(values, 1.0 / GRID_HZ, axis=0))
