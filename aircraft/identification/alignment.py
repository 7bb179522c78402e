"""Align the signals of a log in time: find the lags of the accelerometers and of the control surfaces.

The accelerometers lag behind the gyros, and the surfaces behind their commands. If the specific force is 0.1 s late, no
model explains a moment well. Therefore the lags and delays of the accelerometers and the servos are estimated first, as
those that explain pitch, roll and yaw best. All other signals are then delayed like the accelerometers.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from aircraft.identification.flight_record import GRID_HZ, FlightRecord, apply_delay, apply_lag, derivative, low_pass
from world.arrays import Floats, Ints


@dataclass(frozen=True, slots=True)
class Clocks:
    """Lags and delays of the sensors and servos in one log, s.

    lag, delay: first-order lag and delay of the accelerometers behind the gyros.
    servo_lag: lag of the servos.
    servo_delay: time from the logged command to the servo's first motion.
    """

    lag: float = 0.0
    delay: float = 0.0
    servo_lag: float = 0.05
    servo_delay: float = 0.0

    @property
    def total_lag(self) -> float:
        """Total lag of the accelerometers relative to the gyros, s."""
        return self.lag + self.delay


@dataclass(frozen=True, slots=True)
class Signals:
    """Signals of flight records, concatenated and delayed like the accelerometers.

    The fields are as in `FlightRecord`, (n,) or (n, k), and in addition:

    rate_changes: (n, 3) derivatives of p, q and r, rad/s^2.
    throttle: (n,) after the motor's lag.
    surfaces: (n, 3) elevator, aileron, rudder after the servos' lag, rad.
    airspeed_factor: factor that the airspeed was multiplied with.
    airspeed_sd: relative standard deviation of the airspeed.
    edges: first row of each record, and at the end the number of rows: with (0, 500, 900) the first record has the rows
        0 to 499, the second record the rows 500 to 899.
    block: (n,) number of the time block of each row.
    hertz: samples per second.
    extra: further columns by name.
    """

    acceleration: Floats
    rates: Floats
    rate_changes: Floats
    attitude: Floats
    velocity: Floats
    wind: Floats
    airspeed: Floats
    density: Floats
    surfaces: Floats
    throttle: Floats
    current: Floats
    voltage: Floats
    edges: tuple[int, ...]
    block: Ints
    hertz: float = GRID_HZ
    airspeed_factor: float = 1.0
    airspeed_sd: float = 0.02
    extra: Mapping[str, Floats] = field(default_factory=dict)

    def smooth(self, values: Floats, cutoff: float) -> Floats:
        """Return low-passed values; each record is filtered on its own.

        values: (n,) or (n, k).
        cutoff: Hz.
        """
        smoothed = np.empty_like(values)
        for start_row, end_row in zip(self.edges[:-1], self.edges[1:], strict=True):
            smoothed[start_row:end_row] = low_pass(values[start_row:end_row], cutoff, self.hertz)
        return smoothed

    def thin(self, step: int, extra: Mapping[str, Floats]) -> "Signals":
        """Low-pass the signals, and keep every ``step``-th row of each record.

        extra: further columns (n,) by name, which are thinned in the same way.
        """
        edges, blocks, pieces = [0], [], []
        columns = {name: getattr(self, name) for name in _SAMPLED_FIELDS} | dict(extra)
        all_columns = np.column_stack(list(columns.values()))
        for start_row, end_row in zip(self.edges[:-1], self.edges[1:], strict=True):
            pieces.append(low_pass(all_columns[start_row:end_row], 0.3 * self.hertz / step, self.hertz)[::step])
            blocks.append(self.block[start_row:end_row:step])
            edges.append(edges[-1] + len(blocks[-1]))
        # Split into contiguous columns again, (n,) or (n, k).
        thinned_rows, column = np.concatenate(pieces), 0
        thinned_columns: dict[str, Any] = {}
        for name, values in columns.items():
            width = 1 if values.ndim == 1 else values.shape[1]
            thinned_columns[name] = np.ascontiguousarray(
                thinned_rows[:, column] if values.ndim == 1 else thinned_rows[:, column : column + width]
            )
            column += width
        extra_columns = {name: thinned_columns.pop(name) for name in extra}
        return replace(
            self,
            **thinned_columns,
            edges=tuple(edges),
            block=np.concatenate(blocks),
            hertz=self.hertz / step,
            extra=extra_columns,
        )

    def delay(self, values: Floats, delay: float) -> Floats:
        """Return values delayed by ``delay`` (s); each record is delayed on its own."""
        delayed_values = np.empty_like(values)
        for start_row, end_row in zip(self.edges[:-1], self.edges[1:], strict=True):
            delayed_values[start_row:end_row] = apply_delay(values[start_row:end_row], delay)
        return delayed_values


# Fields of `Signals` with one row per sample.
_SAMPLED_FIELDS = (
    "acceleration",
    "rates",
    "rate_changes",
    "attitude",
    "velocity",
    "wind",
    "airspeed",
    "density",
    "surfaces",
    "throttle",
    "current",
    "voltage",
)
# Length of flight through the air within which residuals may be autocorrelated, m: gusts have lengths, and a slower
# aircraft stays longer in each.
BLOCK_METRES = 500.0
# Cutoff of the airspeed, Hz: sensors are read 10 times per second, and faster changes are noise.
_AIRSPEED_CUTOFF_HZ = 2.0


def align(records: Sequence[FlightRecord], clocks: Sequence[Clocks], motor_lag: float) -> Signals:
    """Concatenate flight records, with all signals delayed like the accelerometers.

    clocks: lags and delays of each record.
    motor_lag: time constant of the motor, s.
    """
    parts: dict[str, list[Floats]] = {}
    edges, blocks, block_count = [0], [], 0
    for record, clock in zip(records, clocks, strict=True):

        def delay_signal(values: Floats, clock: Clocks = clock) -> Floats:
            """Apply the lag and the delay of the accelerometers to a signal that has the time of the gyros."""
            return apply_delay(apply_lag(values, clock.lag), clock.delay)

        rates = delay_signal(record.rates)
        aligned = {
            "acceleration": record.acceleration,
            "rates": rates,
            "rate_changes": derivative(rates),
            "attitude": np.column_stack([delay_signal(np.unwrap(angle)) for angle in record.attitude.T]),
            "velocity": delay_signal(record.velocity),
            "wind": record.wind,
            "airspeed": delay_signal(low_pass(record.airspeed, _AIRSPEED_CUTOFF_HZ)),
            "density": record.density,
            "surfaces": delay_signal(
                apply_delay(apply_lag(record.controls[:, :3], clock.servo_lag), clock.servo_delay)
            ),
            "throttle": delay_signal(apply_lag(record.controls[:, 3], motor_lag)),
            "current": record.current,
            "voltage": record.voltage,
        }
        for name, values in aligned.items():
            parts.setdefault(name, []).append(values)
        edges.append(edges[-1] + len(record.time))
        seconds = BLOCK_METRES / float(record.airspeed.mean())
        record_blocks = ((record.time - record.time[0]) // seconds).astype(np.int64)
        blocks.append(record_blocks + block_count)
        block_count += int(record_blocks[-1]) + 1
    columns: dict[str, Any] = {name: np.concatenate(values) for name, values in parts.items()}
    return Signals(**columns, edges=tuple(edges), block=np.concatenate(blocks))


def invert_first_order_lag(values: Floats, lag: float, hertz: float) -> Floats:
    """Return the input of a first-order lag from its output.

    values: output, (n,) or (n, k).
    lag: time constant, s.
    hertz: samples per second.

    The input is the output plus the lag times the rate of change of the output.

    >>> invert_first_order_lag(np.arange(4.0), 0.5, 10.0)
    array([5., 6., 7., 8.])
    """
    return np.asarray(values + lag * hertz * np.gradient(values, axis=0))


# Lags of the accelerometers in the grid at which the search starts, s.
_GRID_LAGS_S = (0.0, 0.05)
# Delays of the accelerometers in that grid, s.
_GRID_DELAYS_S = (-0.03, 0.015)
# Lag and delay of the servos in that grid, s.
_GRID_SERVOS_S = ((0.03, 0.0), (0.1, 0.0), (0.03, 0.04), (0.0, 0.08))
# Limits of lag and delay of the accelerometers, and lag and delay of the servos, s.
_LIMITS_S = np.array([[0.0, -0.08, 0.0, 0.0], [0.12, 0.1, 0.25, 0.15]])
# Steps of the initial simplex in these four, s.
_SIMPLEX_STEPS_S = np.diag([0.02, 0.02, 0.03, 0.02])


def find_clocks(misfit: Callable[[Clocks], float]) -> Clocks:
    """Find the lags and delays (`Clocks`) with the smallest misfit, by a grid and a simplex search.

    misfit: function that returns the misfit between signals and model for given lags and delays.

    The simplex search (Nelder and Mead 1965) starts at the best point of the grid.

    >>> found = find_clocks(lambda clock: abs(clock.lag - 0.05) + abs(clock.delay - 0.03) + clock.servo_lag)
    >>> round(found.lag, 2), round(found.delay, 2), round(found.servo_lag, 2)
    (0.05, 0.03, 0.0)
    """
    from scipy.optimize import minimize

    def cost(values: Floats) -> float:
        """Return the misfit of the nearest clocks within `_LIMITS_S`, plus a penalty for the distance to them."""
        clipped = np.clip(values, *_LIMITS_S)
        return misfit(Clocks(*clipped.tolist())) + 100.0 * float(np.abs(values - clipped).sum())

    grid = [
        np.array([lag, delay, servo_lag, servo_delay])
        for lag in _GRID_LAGS_S
        for delay in _GRID_DELAYS_S
        for servo_lag, servo_delay in _GRID_SERVOS_S
    ]
    start = min(grid, key=cost)
    simplex = np.vstack([start, *(start + step for step in _SIMPLEX_STEPS_S)])
    options = {"initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-4, "maxfev": 80}
    result = minimize(cost, start, method="Nelder-Mead", options=options)
    return Clocks(*np.clip(result.x, *_LIMITS_S).tolist())
