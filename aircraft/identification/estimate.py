"""Estimate lift curve, drag with thrust, and moments one after the other, with their uncertainties.

The order matters. The scale of the airspeed is estimated from the wind triangle. The accelerometers serve as vanes: the
lift divided by the slope of the lift curve is the angle of attack, gusts included, and the side force gives the
sideslip in the same way. The lift curve is estimated from low frequencies, at which the aircraft heaves with the gusts;
drag and thrust are estimated from the forward acceleration, and the moments from the rates of change of the gyros, and
then from the errors of short predictions (`refinement`).

Each uncertain quantity that is held fixed (`aircraft.identification.fixed_parameters`) is changed by one standard
deviation, and the estimate is repeated: the resulting shifts are part of the covariance.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from aircraft.identification.airspeed import SCALE_SD, with_airspeed_scale
from aircraft.identification.alignment import Clocks, Signals, align, find_clocks, invert_first_order_lag
from aircraft.identification.base_model import BaseModel
from aircraft.identification.drag import FORCE_THINNING, AlphaUncertainty, fit_drag
from aircraft.identification.fixed_parameters import ACCELEROMETER_NOISE, FIXED_PARAMETERS
from aircraft.identification.flight_record import GRID_HZ, FlightRecord
from aircraft.identification.flow import flow_from_forces, make_motor
from aircraft.identification.level import LEVEL_SD, remove_sensor_biases
from aircraft.identification.lift import fit_lift
from aircraft.identification.moments import AXES, MOMENT_THINNING, fit_moments
from aircraft.identification.parameters import PARAMETERS, Group, prior_means, prior_sds
from aircraft.identification.prediction import PredictedLog, predict_log
from aircraft.identification.refinement import IS_MOMENT, OTHER_HORIZONS_S, Refinement, refine_moments
from aircraft.identification.regression import Fit, correlation_samples
from world.arrays import Floats

# Duration of the part of a log that is used to align its signals in time, s.
ALIGNED_SECONDS = 200.0
# Number of passes over lift curve and drag; each pass uses the angle of attack of the previous pass.
_PASSES = 2
# Minimum fraction of a parameter's prior variance that the logs remove; below it they hardly determine the parameter.
MIN_LOG_FRACTION = 0.2
# Title, unit and samples per second of each equation.
_EQUATIONS: Mapping[Group, tuple[str, str, float]] = {
    "lift": ("angle of attack", "rad", GRID_HZ),
    "drag": ("forward acceleration", "m/s2", GRID_HZ / FORCE_THINNING),
    "pitch": ("pitch acceleration", "rad/s2", GRID_HZ / MOMENT_THINNING),
    "roll": ("roll acceleration", "rad/s2", GRID_HZ / MOMENT_THINNING),
    "yaw": ("yaw acceleration", "rad/s2", GRID_HZ / MOMENT_THINNING),
}


@dataclass(frozen=True, slots=True, eq=False)
class Equation:
    """Fit of one equation of motion.

    name: title in texts.
    unit: unit of measured and predicted values.
    hertz: samples per second.
    measured, predicted: (n,), low-passed, all records in sequence.
    explained: R^2.
    correlation: time over which residuals are autocorrelated, s.
    """

    name: str
    unit: str
    hertz: float
    measured: Floats
    predicted: Floats
    explained: float
    correlation: float


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Estimate of an aircraft's parameters from its logs.

    values: values of `PARAMETERS`, (n,).
    covariance: covariance of the values, (n, n).
    clocks: lags and delays of each record.
    equations: the fitted equations.
    shifts: change of the values (n,) for one standard deviation of each quantity that is held fixed, by its name.
    with_current: True if the battery's current was used.
    dynamics: True if the moments were estimated; False if their parameters have the values of the prior.
    airspeed: ratio of true to measured airspeed from the wind triangle, and its standard deviation.
    seconds: length of the flight that was used.
    refinement: refinement of the moments; None if they were not estimated.
    """

    values: Floats
    covariance: Floats
    clocks: tuple[Clocks, ...]
    equations: tuple[Equation, ...]
    shifts: Mapping[str, Floats] = field(default_factory=dict)
    with_current: bool = False
    dynamics: bool = True
    airspeed: tuple[float, float] = (1.0, SCALE_SD)
    seconds: float = 0.0
    refinement: Refinement | None = None

    @property
    def sds(self) -> Floats:
        """Standard deviations of the values, (n,)."""
        return np.sqrt(np.diag(self.covariance))

    def uninformed_lines(self) -> tuple[str, ...]:
        """Return a line for each parameter that the logs hardly determine.

        These are the parameters whose `log_fractions` are below `MIN_LOG_FRACTION`. Each line names a maneuver or a
        measurement that would determine the parameter.
        """
        fractions = self.log_fractions().tolist()
        return tuple(
            f"{parameter.title}: the logs hardly determine it, so its assumed interval remains; to"
            f" determine it, record {parameter.show}"
            for parameter, fraction in zip(PARAMETERS, fractions, strict=True)
            if fraction < MIN_LOG_FRACTION
        )

    def log_fractions(self) -> Floats:
        """Return the fraction of the prior's variance that the logs remove, for each parameter, (n,)."""
        return np.clip(1.0 - np.square(self.sds / prior_sds()), 0.0, 1.0)


def estimate_model(records: Sequence[FlightRecord], base: BaseModel, *, dynamics: bool = True) -> Estimate:
    """Estimate all parameters from flight records.

    dynamics: True to estimate the moments as well; False for logs with too few rows per second to show them.
    """
    default_clocks = Clocks(servo_lag=base.servo_lag)
    clocks = estimate_clocks(records, base) if dynamics else tuple(default_clocks for _ in records)
    signals = make_aligned_signals(records, clocks, base)
    nominal = fit_parameters(signals, base, dynamics=dynamics)
    shifts = {}
    for fixed_parameter in FIXED_PARAMETERS:
        if fixed_parameter.applies(with_current=nominal.with_current):
            shifted_signals, shifted_base = fixed_parameter.change(signals, base)
            shifted_estimate = fit_parameters(
                shifted_signals,
                shifted_base,
                level=fixed_parameter.tilt(shifted_signals),
                dynamics=dynamics,
                nominal=nominal.refinement,
            )
            shifts[fixed_parameter.name] = shifted_estimate.values - nominal.values
    # Shifts of the lift curve along each principal axis of its covariance, by one standard deviation.
    # `nominal.covariance` already contains the uncertainty of the lift curve itself, which is therefore subtracted.
    eigenvalues, axes = np.linalg.eigh(nominal.covariance[:2, :2])
    for k in range(2):
        lift = nominal.values[:2] + np.sqrt(max(0.0, float(eigenvalues[k]))) * axes[:, k]
        shifted = fit_parameters(signals, base, lift=lift, dynamics=nominal.dynamics, nominal=nominal.refinement)
        shift = shifted.values - nominal.values
        nominal.covariance[:2, :2] -= np.outer(shift[:2], shift[:2])
        shifts[f"lift curve, axis {k + 1}"] = shift
    if nominal.refinement is not None:
        for name, horizons in OTHER_HORIZONS_S.items():
            other_refinement = refine_moments(signals, base, nominal.values, horizons, steps=2)
            shifts[name] = np.zeros(len(PARAMETERS))
            shifts[name][IS_MOMENT] = other_refinement.values - nominal.refinement.values
    # Noise in a regressor reduces its fitted slope. Doubling the noise shows this effect, which is then subtracted: the
    # linear extrapolation of Cook and Stefanski 1994.
    noise_bias = np.where(IS_MOMENT, shifts[ACCELEROMETER_NOISE], 0.0)
    covariance = total_covariance(nominal.covariance, shifts)
    values = nominal.values - noise_bias
    if dynamics:
        values, covariance = combine_with_prior(values, covariance)
    else:
        covariance[np.ix_(IS_MOMENT, IS_MOMENT)] = np.diag(np.square(prior_sds()[IS_MOMENT]))
    return replace(
        nominal,
        values=values,
        covariance=covariance,
        clocks=clocks,
        shifts=shifts,
        airspeed=(signals.airspeed_factor, signals.airspeed_sd),
        seconds=sum(record.seconds for record in records),
    )


def combine_with_prior(values: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    """Combine the estimates of the moments with their priors by Bayes' rule.

    values: values of all parameters, (n,); the parameters of lift and drag are returned unchanged.
    covariance: covariance of the values, (n, n).

    Returns values (n,) and covariance (n, n). The refinement of the moments uses a prior that is wider by
    `PRIOR_SPREAD`, because its weights do not include the shifts.
    """
    prior = np.square(prior_sds())
    weight = np.where(IS_MOMENT, prior / (prior + np.diag(covariance)), 1.0)
    combined = covariance * np.outer(weight, weight) + np.diag(np.square(1.0 - weight) * prior)
    return prior_means() + weight * (values - prior_means()), combined


def make_aligned_signals(records: Sequence[FlightRecord], clocks: Sequence[Clocks], base: BaseModel) -> Signals:
    """Align the signals of all records, remove sensor biases, and apply the fitted airspeed scale factor."""
    signals = remove_sensor_biases(align(records, clocks, base.motor_lag))
    return with_airspeed_scale(signals, flow_from_forces(signals, base, prior_means()))


def score_predictions(
    estimate: Estimate, records: Sequence[FlightRecord], base: BaseModel, base_name: str
) -> PredictedLog:
    """Compare how well constant rates, the base model and an estimate predict flight records.

    base_name: name of the base model in texts.

    The signals are aligned with the lags and delays of the estimate's last record.
    """
    signals = remove_sensor_biases(align(records, [estimate.clocks[-1]] * len(records), base.motor_lag))
    signals = replace(signals, airspeed=signals.airspeed * estimate.airspeed[0])
    return predict_log(signals, {base_name: (base, prior_means()), "identified": (base, estimate.values)})


def total_covariance(fitted: Floats, shifts: Mapping[str, Floats]) -> Floats:
    """Return the covariance (n, n) of the fitted parameters, systematic errors included.

    fitted: covariance of the fit (n, n).
    shifts: change of the parameters (n,) that one standard deviation of each error source causes, by its name.

    The variances of lift and drag do not exceed the variances of their priors.

    >>> shift = np.zeros(len(PARAMETERS))
    >>> shift[0] = 0.04
    >>> total = total_covariance(np.diag(np.full(len(PARAMETERS), 0.03**2)), {"clock of the servos": shift})
    >>> round(float(np.sqrt(total[0, 0])), 6), round(float(np.sqrt(total[1, 1])), 6)
    (0.05, 0.03)
    """
    covariance = fitted + sum(np.outer(shift, shift) for shift in shifts.values())
    # Scaling rows and columns keeps the correlations where a variance is reduced to the prior's variance.
    factor = np.where(IS_MOMENT, 1.0, np.minimum(1.0, prior_sds() / np.sqrt(np.diag(covariance))))
    return np.asarray(covariance * np.outer(factor, factor))


def estimate_clocks(records: Sequence[FlightRecord], base: BaseModel) -> tuple[Clocks, ...]:
    """Estimate the lags and delays of each record, from the longest record of its log.

    The central `ALIGNED_SECONDS` of this record are used. All records of a log have the same lags and delays.
    """
    clocks_by_source: dict[str, Clocks] = {}
    for source in {record.source: None for record in records}:
        longest = max((record for record in records if record.source == source), key=lambda record: record.seconds)
        part = longest.central_part(ALIGNED_SECONDS)

        def misfit(clock: Clocks, part: FlightRecord = part) -> float:
            """Return the sum over the axes of the logarithm of the unexplained fraction of the moments."""
            signals = align([part], [clock], base.motor_lag)
            alpha, beta, _ = flow_from_forces(signals, base, prior_means())
            # A wide prior, so that the clocks fit the data and not the prior.
            fits = fit_moments(signals, base, alpha, beta, prior_factor=10.0)
            return sum(_log_unexplained(fits[axis], clock.lag) for axis in AXES)

        clocks_by_source[source] = find_clocks(misfit)
    return tuple(clocks_by_source[record.source] for record in records)


def _log_unexplained(fit: Fit, lag: float) -> float:
    """Return the logarithm of the fraction of the moments' variance that a fit does not explain.

    lag: first-order lag of the accelerometers, s, whose effect on the residual and the moments is inverted first.

    The lag smooths both and removes fast motion that is badly explained, so that without the inversion the longest lag
    would always seem best.
    """
    hertz = GRID_HZ / MOMENT_THINNING
    residual, total = (
        invert_first_order_lag(values, lag, hertz) for values in (fit.residual, fit.predicted + fit.residual)
    )
    return float(np.log(residual.var() / (total.var() + 1e-300) + 1e-6))


def fit_parameters(
    signals: Signals,
    base: BaseModel,
    lift: Floats | None = None,
    level: float = 0.0,
    *,
    dynamics: bool = True,
    nominal: Refinement | None = None,
) -> Estimate:
    """Estimate all parameters from aligned signals.

    The quantities that are held fixed are assumed to have no errors.

    lift: (2,) values of slope and offset of the lift curve to hold fixed; None to estimate them.
    level: levelling error of the autopilot (error of its pitch reference), rad.
    dynamics: True to estimate the moments as well.
    nominal: moment refinement of an earlier estimate, which is updated to first order for the changed signals and
        parameters; None to refine the moments in full.
    """
    values, covariance = prior_means(), np.diag(np.square(prior_sds()))
    fits: dict[Group, Fit] = {}

    uncertainty: AlphaUncertainty | None = None

    def store(group: Group, estimate: Floats, group_covariance: Floats) -> None:
        """Store the values and the covariance of a group of parameters."""
        is_in_group = np.array([parameter.group == group for parameter in PARAMETERS])
        values[is_in_group] = estimate
        covariance[np.ix_(is_in_group, is_in_group)] = group_covariance

    if lift is not None:
        store("lift", lift, np.zeros((2, 2)))
    for _ in range(_PASSES):
        flow = flow_from_forces(signals, base, values)
        if lift is None:
            fits["lift"], curve, curve_covariance = fit_lift(signals, base, flow.lift, level)
            store("lift", curve, curve_covariance)
            uncertainty = alpha_uncertainty(fits["lift"], flow.lift)
            flow = flow_from_forces(signals, base, values)
        fits["drag"], drag_values, drag_covariance = fit_drag(signals, base, values, flow, uncertainty)
        store("drag", drag_values, drag_covariance)
    refinement = nominal
    if refinement is not None:
        values[IS_MOMENT] = refinement.values_for(signals, base, values)
    elif dynamics:
        fits |= fit_moments(signals, base, flow.alpha, flow.beta, make_motor(base, values))
        for axis in AXES:
            is_in_axis = np.array([parameter.group == axis for parameter in PARAMETERS])
            values[is_in_axis] = fits[axis].estimate[: is_in_axis.sum()]
        refinement = refine_moments(signals, base, values)
        values[IS_MOMENT] = refinement.values
        covariance[np.ix_(IS_MOMENT, IS_MOMENT)] = refinement.covariance
    equations = []
    for group, fit in fits.items():
        title, unit, hertz = _EQUATIONS[group]
        correlation = correlation_samples(fit.residual) / hertz
        flown = fit.predicted + fit.residual
        equations.append(Equation(title, unit, hertz, flown, fit.predicted, fit.explained, correlation))
    has_current = bool(np.isfinite(signals.current).all())
    return Estimate(
        values, covariance, (), tuple(equations), with_current=has_current, dynamics=dynamics, refinement=refinement
    )


def alpha_uncertainty(fit: Fit, lift: Floats) -> AlphaUncertainty:
    """Return the uncertainty of the angle of attack: from the lift fit, and from the autopilot's level.

    lift: (n,) lift coefficients of the fitted signals.
    """
    slope_sd, offset_sd = np.sqrt(np.diag(fit.covariance)).tolist()
    return AlphaUncertainty(float(np.hypot(offset_sd, LEVEL_SD)), slope_sd, float(lift.mean()))
