"""Predict the motion up to a second ahead, and score a model by the errors of its predictions.

In real air an open-loop simulation over seconds shows the gusts, not the model. A prediction therefore starts from the
measured state, gusts included, and a Kalman filter estimates the moments that gusts and other unmodelled effects add: a
first-order Gauss-Markov process about each axis (process noise, as in the filter-error method: Jategaonkar, Flight
Vehicle System Identification, second edition, chapter 5; rotational gusts of MIL-F-8785C, 3.7.2, have that form). The
time constant and the gain of the filter minimize the innovations. The errors are compared with the errors of constant
rates, which shows how much a model explains. The innovations of a complete model are white (Klein and Morelli, Aircraft
System Identification, section 6.2).

Trim offsets (constant moments, one for each record) are estimated for each model before it predicts.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aircraft.identification.alignment import Signals
from aircraft.identification.base_model import BaseModel
from aircraft.identification.flow import Flow, battery_voltage, flow_from_forces, lift_curve, make_motor
from aircraft.identification.level import GRAVITY
from aircraft.identification.moments import required_moments
from aircraft.identification.parameters import INDEX
from world.arrays import Floats, Ints

# Predicted quantities.
QUANTITIES = ("roll rate", "pitch rate", "yaw rate", "bank", "pitch", "airspeed")
# Unit of each quantity.
UNITS = ("deg/s", "deg/s", "deg/s", "deg", "deg", "m/s")
# Times of the predictions, s.
HORIZONS_S = (0.2, 0.5, 1.0)
# Largest number of predictions.
MAX_PREDICTIONS = 1500
# Time in a record before its first prediction, s; the filter has settled then.
_SETTLING_TIME_S = 2.0
# Time constants of the unmodelled moments that are tried, s.
_GUST_TIMES_S = (0.05, 0.1, 0.2, 0.4, 0.8)
# Gains of the filter that are tried.
_FILTER_GAINS = (0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7)
# Time over which the innovations' autocorrelation is examined, s.
_WHITENESS_TIME_S = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Errors of one model's predictions.

    model: name in texts: the base's name, "identified" or "constant rates".
    rms: root mean square error for each of `QUANTITIES`, in `UNITS`, by the time ahead, s.
    whiteness: for roll, pitch and yaw the fraction of the innovations' autocorrelations, at lags up to 0.5 s, within
        the 95 % interval of white noise; 0.95 for white innovations. Empty for constant rates.
    """

    model: str
    rms: Mapping[float, Floats]
    whiteness: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class PredictedLog:
    """Predictions of a log by several models.

    predictions: errors of constant rates, of the base and of the identified model.
    count: number of predictions.
    time: (n,) times of the predicted values that are shown, s.
    measured, predicted: (n, 6) measured values, and the identified model's predictions half a second ahead.
    """

    predictions: tuple[Prediction, ...]
    count: int
    time: Floats
    measured: Floats
    predicted: Floats


@dataclass(frozen=True, slots=True)
class GustFilter:
    """Steady-state Kalman filter of the unmodelled moments about one axis.

    The moments are taken as a first-order Gauss-Markov process.

    decay: factor by which the process decays over a sample.
    gain: fraction of an innovation that is attributed to the process; the rest is white noise.
    """

    decay: float
    gain: float

    def estimate(self, residual: Floats, signals: Signals) -> Floats:
        """Estimate the unmodelled moment at each sample, (n,), from the earlier samples of a residual (n,)."""
        from scipy.signal import lfilter

        estimate = np.zeros_like(residual)
        for start_row, end_row in zip(signals.edges[:-1], signals.edges[1:], strict=True):
            numerator, denominator = [self.decay * self.gain], [1.0, -self.decay * (1.0 - self.gain)]
            estimate[start_row + 1 : end_row] = lfilter(numerator, denominator, residual[start_row:end_row])[:-1]
        return estimate


class Predictor:
    """Predicts the motion in a log by a model, from measured states up to a second ahead.

    It first determines the trim offsets and the unmodelled moments in the log.

    base, values: base model, and values of its parameters, (n,).
    filters: filters of roll, pitch and yaw; None for the filters with the smallest innovations.
    trims: (3,) trim offsets as angular accelerations, rad/s^2; None for the means over each record of the log.
    with_flow: True to use the measured flow angles and airspeed at all times; False to predict them, too.
    """

    def __init__(
        self,
        signals: Signals,
        base: BaseModel,
        values: Floats,
        filters: Sequence[GustFilter] | None = None,
        *,
        trims: Floats | None = None,
        with_flow: bool = False,
    ) -> None:
        self._signals, self._base, self._values = signals, base, values
        self._with_flow = with_flow
        # A prediction must not start from later samples.
        self._flow = flow_from_forces(signals, base, values, smooth=with_flow)
        self._motor = make_motor(base, values)
        # Moments about roll, pitch and yaw that the measured motion requires, divided by the moments of inertia.
        ixx, iyy, izz, _ = self._base.inertia
        moments = required_moments(self._signals, self._base, self._motor)
        required = np.column_stack([moments["roll"] / ixx, moments["pitch"] / iyy, moments["yaw"] / izz])
        modelled = self._modelled_accelerations(
            self._flow, signals.rates, signals.airspeed, np.arange(len(signals.airspeed))
        )
        self.trims = np.empty_like(modelled)
        for start_row, end_row in zip(signals.edges[:-1], signals.edges[1:], strict=True):
            offsets = (
                (required[start_row:end_row] - modelled[start_row:end_row]).mean(axis=0) if trims is None else trims
            )
            self.trims[start_row:end_row] = offsets
        residual = required - modelled - self.trims
        self.filters = [] if filters is None else list(filters)
        candidates = [
            GustFilter(float(np.exp(-1.0 / (signals.hertz * gust_time))), gain)
            for gust_time in _GUST_TIMES_S
            for gain in _FILTER_GAINS
        ]
        for column in residual.T if filters is None else ():
            # The filter of each axis leaves the smallest innovations.
            variances = [float((column - candidate.estimate(column, signals)).var()) for candidate in candidates]
            self.filters.append(candidates[int(np.argmin(variances))])
        self._unmodelled = np.column_stack(
            [gust_filter.estimate(residual[:, axis], signals) for axis, gust_filter in enumerate(self.filters)]
        )
        self._innovations = residual - self._unmodelled

    @property
    def whiteness(self) -> tuple[float, ...]:
        """Fraction of the innovations' autocorrelations within the 95 % interval of white noise, by axis."""
        count = round(_WHITENESS_TIME_S * self._signals.hertz)
        return tuple(whiteness(self._innovations[:, axis], count) for axis in range(3))

    def predict(self, starts: Ints, horizons: Sequence[float] = HORIZONS_S) -> dict[float, Floats]:
        """Predict `QUANTITIES` at some later times, arrays (n, 6) in rad, rad/s and m/s.

        starts: (n,) rows at which the predictions start.
        horizons: predicted times, s, which are the keys of the result.
        """
        horizon_by_sample = {round(horizon * self._signals.hertz): horizon for horizon in horizons}
        predictions = {}
        for sample, state in enumerate(self.simulate(starts, max(horizon_by_sample))):
            if sample in horizon_by_sample:
                speed = np.linalg.norm(state[:, :3], axis=1)
                predictions[horizon_by_sample[sample]] = np.column_stack([state[:, 3:8], speed])
        return predictions

    def simulate(self, starts: Ints, count: int) -> Iterator[Floats]:
        """Simulate flights with the logged controls; yield the states (n, 8) at the start and each sample.

        starts: (n,) rows at which the flights start.
        count: number of samples.

        A state holds the velocity through the air (body axes, m/s), the angular rates (rad/s), bank and pitch (rad).
        """
        signals, step = self._signals, 1.0 / self._signals.hertz
        state = np.column_stack([self._air_velocity(starts), signals.rates[starts], signals.attitude[starts, :2]])
        disturbances, decays = self._unmodelled[starts], np.array([gust_filter.decay for gust_filter in self.filters])
        yield state
        for k in range(count):
            rows = starts + k
            # Heun's method, with disturbances held over a step.
            start_derivatives = self._state_derivatives(state, disturbances, rows)
            end_derivatives = self._state_derivatives(state + step * start_derivatives, disturbances, rows + 1)
            state = state + 0.5 * step * (start_derivatives + end_derivatives)
            if self._with_flow:
                state[:, :3] = self._air_velocity(rows + 1)
            disturbances = disturbances * decays
            yield state

    def _air_velocity(self, rows: Ints) -> Floats:
        """Return the measured velocity through the air in body axes, m/s, (n, 3), at the given rows (n,)."""
        speed, alpha, beta = self._signals.airspeed[rows], self._flow.alpha[rows], self._flow.beta[rows]
        symmetric_speed = speed * np.cos(beta)
        return np.column_stack([symmetric_speed * np.cos(alpha), speed * np.sin(beta), symmetric_speed * np.sin(alpha)])

    def _modelled_accelerations(self, flow: Flow, rates: Floats, airspeed: Floats, rows: Ints) -> Floats:
        """Return the aerodynamic moments of the model divided by the moments of inertia, rad/s^2, (n, 3).

        rates: angular rates, rad/s, (n, 3).
        rows: (n,) rows of the control surfaces and the density.
        """
        base, c = self._base, self._base.coefficients
        factor = {name: float(self._values[k]) for name, k in INDEX.items()}
        elevator, aileron, rudder = self._signals.surfaces[rows].T
        roll, pitch, yaw = (rates * np.array([base.span, base.chord, base.span])).T / (2.0 * airspeed)
        pressure = 0.5 * self._signals.density[rows] * np.square(airspeed) * base.area
        roll_moment = (
            c.roll_beta * factor["dihedral-effect"] * flow.beta
            + c.roll_roll * factor["roll-damping"] * roll
            + c.roll_yaw * factor["roll-from-yaw"] * yaw
            + c.roll_aileron * factor["aileron-power"] * aileron
            + c.roll_rudder * rudder
        )
        pitch_moment = (
            c.pitch_zero
            + factor["pitch-offset"]
            + c.pitch_alpha * factor["pitch-stiffness"] * flow.alpha
            + c.pitch_rate * factor["pitch-damping"] * pitch
            + c.pitch_elevator * factor["elevator-power"] * elevator
        )
        yaw_moment = (
            c.yaw_beta * factor["weathercock"] * flow.beta
            + c.yaw_roll * factor["yaw-from-roll"] * roll
            + c.yaw_yaw * factor["yaw-damping"] * yaw
            + c.yaw_aileron * factor["adverse-yaw"] * aileron
            + c.yaw_rudder * factor["rudder-power"] * rudder
        )
        ixx, iyy, izz, _ = base.inertia
        accelerations_per_force = np.column_stack(
            [base.span / ixx * roll_moment, base.chord / iyy * pitch_moment, base.span / izz * yaw_moment]
        )
        return np.asarray(pressure[:, np.newaxis] * accelerations_per_force)

    def _state_derivatives(self, state: Floats, disturbances: Floats, rows: Ints) -> Floats:
        """Return the state derivatives (n, 8), with the gusts held constant.

        disturbances: unmodelled angular accelerations, rad/s^2, (n, 3).
        rows: (n,) rows of the controls and the density.
        """
        signals, base = self._signals, self._base
        u, v, w, p, q, r, roll, pitch = state.T
        airspeed = np.sqrt(u * u + v * v + w * w)
        flow = Flow(np.arctan2(w, u), np.arcsin(v / airspeed), np.zeros_like(u))
        angular_accelerations = (
            self._modelled_accelerations(flow, state[:, 3:6], airspeed, rows) + self.trims[rows] + disturbances
        )
        specific_forces = self._specific_forces(flow, state[:, 3:6], airspeed, rows)
        ixx, iyy, izz, ixz = base.inertia
        torque = (
            self._motor.propeller_torque(airspeed, signals.throttle[rows], signals.density[rows])
            if base.has_torque_reaction
            else 0.0
        )
        # Euler's equations with a product of inertia, solved for the accelerations.
        roll_moment = ixx * angular_accelerations[:, 0] - torque + ixz * p * q - (izz - iyy) * q * r
        yaw_moment = izz * angular_accelerations[:, 2] - ixz * q * r - (iyy - ixx) * p * q
        determinant = ixx * izz - ixz * ixz
        return np.column_stack(
            [
                r * v - q * w - GRAVITY * np.sin(pitch) + specific_forces[0],
                p * w - r * u + GRAVITY * np.cos(pitch) * np.sin(roll) + specific_forces[1],
                q * u - p * v + GRAVITY * np.cos(pitch) * np.cos(roll) + specific_forces[2],
                (izz * roll_moment + ixz * yaw_moment) / determinant,
                angular_accelerations[:, 1] - ((ixx - izz) * p * r + ixz * (p * p - r * r)) / iyy,
                (ixz * roll_moment + ixx * yaw_moment) / determinant,
                p + np.tan(pitch) * (q * np.sin(roll) + r * np.cos(roll)),
                q * np.cos(roll) - r * np.sin(roll),
            ]
        )

    def _specific_forces(
        self, flow: Flow, rates: Floats, airspeed: Floats, rows: Ints
    ) -> tuple[Floats, Floats, Floats]:
        """Return the specific forces forward, right and down, m/s^2, three arrays (n,).

        rates: angular rates, rad/s, (n, 3).
        rows: (n,) rows of the controls and the density.
        """
        signals, base, c = self._signals, self._base, self._base.coefficients
        elevator, aileron, rudder = signals.surfaces[rows].T
        roll, pitch, yaw = (rates * np.array([base.span, base.chord, base.span])).T / (2.0 * airspeed)
        slope, zero = lift_curve(base, self._values)
        alpha_lift = zero + slope * flow.alpha
        lift = alpha_lift + c.lift_rate * pitch + c.lift_elevator * elevator
        induced = c.drag_induced * self._values[INDEX["induced-drag"]] * np.square(alpha_lift - c.lift_least_drag)
        drag = c.drag_zero * self._values[INDEX["zero-lift-drag"]] + induced + c.drag_elevator * elevator
        side = (
            c.side_beta * flow.beta
            + c.side_roll * roll
            + c.side_yaw * yaw
            + c.side_aileron * aileron
            + c.side_rudder * rudder
        )
        density = signals.density[rows]
        volts = battery_voltage(signals, base)
        thrust, _ = self._motor.thrust_and_current(
            airspeed, signals.throttle[rows], density, volts[rows] if isinstance(volts, np.ndarray) else volts
        )
        per_mass = 0.5 * density * np.square(airspeed) * base.area / base.mass
        sine, cosine = np.sin(flow.alpha), np.cos(flow.alpha)
        forward = per_mass * (lift * sine - drag * cosine) + thrust / base.mass
        return forward, per_mass * side, -per_mass * (lift * cosine + drag * sine)


def whiteness(innovations: Floats, lags: int) -> float:
    """Return the fraction of a series' autocorrelations that are within +-1.96 / sqrt(n).

    innovations: series, (n,).
    lags: largest lag of the autocorrelations, in samples.
    For white noise the fraction is 0.95.

    >>> whiteness(np.random.default_rng(1).normal(size=5000), 100) > 0.9
    True
    """
    centred = innovations - innovations.mean()
    total = float(centred @ centred) + 1e-300
    limit = 1.96 / np.sqrt(len(centred))
    correlations = [float(centred[lag:] @ centred[:-lag]) / total for lag in range(1, lags + 1)]
    return float(np.mean(np.abs(correlations) < limit))


def prediction_starts(signals: Signals, count: int = MAX_PREDICTIONS, horizon: float = max(HORIZONS_S)) -> Ints:
    """Return the rows from which predictions start, (n,), evenly distributed over all records.

    count: maximum number of rows.
    horizon: longest time that is predicted, s.
    """
    longest = round(horizon * signals.hertz)
    settling = round(_SETTLING_TIME_S * signals.hertz)
    rows = np.concatenate(
        [
            np.arange(start_row + settling, end_row - longest - 1)
            for start_row, end_row in zip(signals.edges[:-1], signals.edges[1:], strict=True)
        ]
    )
    return rows[np.unique(np.linspace(0, len(rows) - 1, min(count, len(rows))).astype(np.int64))]


def predict_log(signals: Signals, models: Mapping[str, tuple[BaseModel, Floats]]) -> PredictedLog:
    """Compare the predictions of a log with the measured values.

    models: base model and parameter values by name. The predicted values of the last model are part of the result.

    The log is predicted by constant rates and by each model.
    """
    starts = prediction_starts(signals)
    measured = {
        horizon: _measured_quantities(signals, starts + round(horizon * signals.hertz)) for horizon in HORIZONS_S
    }
    start_values = _measured_quantities(signals, starts)
    # Roll and pitch after each time at constant angular rates, and at constant airspeed.
    p, q, r, roll, pitch, _ = start_values.T
    constant_rates = {}
    for horizon in HORIZONS_S:
        quantities = start_values.copy()
        quantities[:, 3] += horizon * (p + np.tan(pitch) * (q * np.sin(roll) + r * np.cos(roll)))
        quantities[:, 4] += horizon * (q * np.cos(roll) - r * np.sin(roll))
        constant_rates[horizon] = quantities
    predictions = [Prediction("constant rates", _rms_errors(constant_rates, measured))]
    shown_values = constant_rates[HORIZONS_S[1]]
    for name, (base, values) in models.items():
        predictor = Predictor(signals, base, values)
        predicted = predictor.predict(starts)
        shown_values = predicted[HORIZONS_S[1]]
        predictions.append(Prediction(name, _rms_errors(predicted, measured), predictor.whiteness))
    return PredictedLog(
        tuple(predictions),
        len(starts),
        starts / signals.hertz + HORIZONS_S[1],
        _convert_units(measured[HORIZONS_S[1]]),
        _convert_units(shown_values),
    )


def _measured_quantities(signals: Signals, rows: Ints) -> Floats:
    """Return the measured `QUANTITIES` at some rows, in rad, rad/s and m/s, (n, 6)."""
    return np.column_stack([signals.rates[rows], signals.attitude[rows, :2], signals.airspeed[rows]])


def _convert_units(quantities: Floats) -> Floats:
    """Convert quantities (n, 6) from rad, rad/s and m/s to `UNITS`."""
    return quantities * np.array([np.degrees(1.0)] * 5 + [1.0])


def _rms_errors(predicted: Mapping[float, Floats], measured: Mapping[float, Floats]) -> dict[float, Floats]:
    """Return the root mean square errors (6,) in `UNITS`, by the predicted time."""
    errors = {horizon: _convert_units(predicted[horizon] - measured[horizon]) for horizon in HORIZONS_S}
    return {horizon: np.sqrt(np.square(error).mean(axis=0)) for horizon, error in errors.items()}
