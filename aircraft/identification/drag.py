"""Estimate drag and thrust together, from forward acceleration and, if logged, the battery's current.

Level flight shows only the difference of thrust and drag; climbs, glides and other speeds show more, and the current
shows most. Other uncertain properties of motor and accelerometer are estimated as well, within their ranges. The model
does not contain those of them that belong to the aircraft (the motor's resistance, the battery's voltage). They are
therefore folded into the parameters: otherwise the model's thrust would differ from the measured thrust.
"""

from dataclasses import dataclass

import numpy as np

from aircraft.identification.alignment import Signals
from aircraft.identification.base_model import BaseModel
from aircraft.identification.flow import Flow, battery_voltage, dynamic_force, lift_curve, rate_and_elevator_lift
from aircraft.identification.parameters import PARAMETERS, prior_means, prior_sds
from aircraft.identification.regression import Fit, fit_with_prior
from world.arrays import Floats

# Cutoff below which forces are compared, Hz.
FORCE_CUTOFF_HZ = 1.0
# One of this many samples is used.
FORCE_THINNING = 10
# Nuisance parameters: other uncertain quantities, which are estimated with drag and thrust, with their standard
# deviations. A log hardly determines them.
NUISANCES = {
    "forward accelerometer, m/s2": 0.01,
    "resistance of the motor": 0.2,
    "idle current of the motor": 0.3,
    "voltage of the battery": 0.02,
    "drag of the elevator": 0.5,
    "angle of attack": 1.0,
    "angle of attack by lift": 1.0,
}
# The last two are in standard deviations of `AlphaUncertainty`.

# True for quantities of the aircraft, False for quantities of its sensors.
_IS_OF_AIRCRAFT = np.array([name.split()[0] in ("resistance", "idle", "voltage", "drag") for name in NUISANCES])
# Number of steps of the search for folded parameters.
_MAX_FOLDING_STEPS = 3
# Factor on the voltage's standard deviation if the battery's data are logged.
_LOGGED_VOLTAGE_FACTOR = 0.25
# Error of every model in the forward acceleration, m/s^2.
FORCE_FLOOR = 0.015
# Error of every model in the current, A.
_CURRENT_FLOOR_A = 0.3
# Time over which these errors stay the same, s: a climb, a glide, a level run.
FLOOR_SECONDS = 25.0
# Mask of the parameters of drag and motor.
_IS_DRAG_PARAMETER = np.array([parameter.group == "drag" for parameter in PARAMETERS])
# Step of the difference quotients.
_DIFFERENCE_STEP = 1e-3
# Largest number of steps of a search.
_MAX_STEPS = 12
# Largest last step of a search, in standard deviations of the prior.
_MAX_LAST_STEP = 0.01


@dataclass(frozen=True, slots=True)
class AlphaUncertainty:
    """Uncertainty of the angle of attack from the lift curve.

    angle: standard deviation at the lift coefficient ``mean_lift``, rad.
    by_lift: standard deviation of its change per unit of lift coefficient, rad.
    """

    angle: float = float(np.radians(0.3))
    by_lift: float = 0.02
    mean_lift: float = 0.6


@dataclass(frozen=True, slots=True)
class ForwardForces:
    """Thinned signals, and the contribution of each unknown to the forward force.

    known: (n,) contribution of the lift, N.
    tilts: (2, n) contributions of one standard deviation of each uncertainty of the angle of attack, N.
    drags: (2, n) contributions of zero-lift and induced drag, N.
    elevator: (n,) contribution of the elevator's drag, N.
    volts: battery voltage, V, (n,) or one value.
    """

    signals: Signals
    base: BaseModel
    known: Floats
    tilts: Floats
    drags: Floats
    elevator: Floats
    volts: Floats | float

    def predict(self, unknown: Floats) -> tuple[Floats, Floats]:
        """Predict forward acceleration, m/s^2, and current, A, both low-pass filtered, two arrays (n,).

        unknown: values of the parameters, then of the nuisance parameters.
        """
        force, current = self._predict_unfiltered(unknown)
        return self.signals.smooth(force, FORCE_CUTOFF_HZ), self.signals.smooth(current, FORCE_CUTOFF_HZ)

    def _predict_unfiltered(self, unknown: Floats) -> tuple[Floats, Floats]:
        """Return the forward acceleration, m/s^2, and the current, A, two arrays (n,), before the low-pass."""
        zero_lift, induced, thrust, speed, torque, bias, resistance, idle, voltage, elevator_drag, *tilts = unknown
        motor = self.base.motor.with_factors(thrust, speed, torque, 1.0 + resistance, 1.0 + idle)
        signals = self.signals
        thrust_force, current = motor.thrust_and_current(
            signals.airspeed, signals.throttle, signals.density, self.volts * (1.0 + voltage)
        )
        force = (
            self.known
            + np.array([zero_lift, induced]) @ self.drags
            + (1.0 + elevator_drag) * self.elevator
            + thrust_force
        )
        force = force + np.array(tilts) @ self.tilts
        return force / self.base.mass + bias, current

    def slopes(self, unknown: Floats) -> tuple[Floats, Floats]:
        """Return the derivatives of acceleration and current by the unknowns, two arrays (n, p).

        The p unknowns are those of `predict`.
        """
        steps = _DIFFERENCE_STEP * np.eye(len(unknown))
        # All columns are filtered in one call: a call costs far more than a column.
        forces, currents = zip(
            *(self._predict_unfiltered(unknown + step) for step in (0.0 * steps[0], *steps)), strict=True
        )
        force, current = (
            self.signals.smooth(np.column_stack(samples), FORCE_CUTOFF_HZ) for samples in (forces, currents)
        )
        return (force[:, 1:] - force[:, :1]) / _DIFFERENCE_STEP, (current[:, 1:] - current[:, :1]) / _DIFFERENCE_STEP


def fit_drag(
    signals: Signals, base: BaseModel, values: Floats, flow: Flow, uncertainty: AlphaUncertainty | None = None
) -> tuple[Fit, Floats, Floats]:
    """Fit the five parameters of drag and motor; return the fit, values (5,) and covariance (5, 5).

    values: (n,) values of all parameters, of which the parameters of lift are used.
    uncertainty: uncertainty of the lift curve; None for a default.

    The fit also estimates nuisance parameters, some of which belong to the aircraft: resistance, idle current, voltage
    and drag of the elevator. Their effect is included in the five returned values: together with the base model's
    resistance, idle current, voltage and elevator drag, these values give nearly the same forces and currents as the
    fit.
    """
    forces = forward_forces(signals, base, values, flow, AlphaUncertainty() if uncertainty is None else uncertainty)
    thin_signals = forces.signals
    with_current = bool(np.isfinite(thin_signals.current).all())
    means, sds = drag_priors(with_current=with_current)
    # First fit only the forces, then forces and current, because the first steps with the current would diverge.
    fit = _fit_unknowns(forces, _Measurement(thin_signals, with_current=False), means, sds)
    if with_current:
        fit = _fit_unknowns(forces, _Measurement(thin_signals, with_current=True), means, sds, fit.estimate)
    force, _ = forces.predict(fit.estimate)
    measured = thin_signals.smooth(thin_signals.acceleration[:, 0], FORCE_CUTOFF_HZ)
    explained = 1.0 - float((measured - force).var() / measured.var())
    drag_values, jacobian = _fold_nuisances(forces, fit.estimate)
    return (
        Fit(fit.estimate, fit.covariance, force, measured - force, explained),
        drag_values,
        jacobian @ fit.covariance @ jacobian.T,
    )


def drag_priors(*, with_current: bool) -> tuple[Floats, Floats]:
    """Return the prior means and standard deviations of the unknowns of `fit_drag`, two arrays (p,).

    with_current: True for a log with the battery's current, which also has its voltage.

    The unknowns are the parameters of drag and motor, followed by `NUISANCES`.
    """
    nuisances = np.array(list(NUISANCES.values()))
    nuisances[list(NUISANCES).index("voltage of the battery")] *= _LOGGED_VOLTAGE_FACTOR if with_current else 1.0
    means = np.concatenate([prior_means()[_IS_DRAG_PARAMETER], np.zeros(len(nuisances))])
    return means, np.concatenate([prior_sds()[_IS_DRAG_PARAMETER], nuisances])


def _fold_nuisances(forces: ForwardForces, unknown: Floats) -> tuple[Floats, Floats]:
    """Change the five parameters so that they include the effect of the fitted nuisance parameters.

    The model of the identified aircraft does not have these nuisance parameters. The five parameters are therefore
    changed by least squares, so that force and current without them differ least from force and current with them.

    unknown: (p,) fitted values of the unknowns.

    Returns the values of the parameters (5,), and their derivatives with respect to the unknowns, (5, p).
    """
    parameter_count = int(_IS_DRAG_PARAMETER.sum())
    nuisance_indices = parameter_count + np.flatnonzero(_IS_OF_AIRCRAFT)
    scale = FORCE_FLOOR / _CURRENT_FLOOR_A

    def stack_force_and_current(force: Floats, current: Floats) -> Floats:
        """Return forces and weighted currents in one array."""
        return np.concatenate([force, scale * current])

    target = stack_force_and_current(*forces.predict(unknown))
    folded_unknown = unknown.copy()
    folded_unknown[nuisance_indices] = 0.0
    for _ in range(_MAX_FOLDING_STEPS):
        columns = stack_force_and_current(*forces.slopes(folded_unknown))
        residual = target - stack_force_and_current(*forces.predict(folded_unknown))
        folded_unknown[:parameter_count] += np.linalg.lstsq(columns[:, :parameter_count], residual, rcond=None)[0]
    jacobian = np.zeros((parameter_count, len(unknown)))
    jacobian[:, :parameter_count] = np.eye(parameter_count)
    jacobian[:, nuisance_indices] = np.linalg.lstsq(
        columns[:, :parameter_count], columns[:, nuisance_indices], rcond=None
    )[0]
    return folded_unknown[:parameter_count], jacobian


class _Measurement:
    """Low-passed forward acceleration (m/s^2) and battery current (A) of a log, two arrays (n,).

    with_current: False to leave out the current; it is then None.
    block: (n,) time block of each row.
    floor: lower bound on the residual variance; see `aircraft.identification.regression.fit_with_prior`.
    """

    def __init__(self, signals: Signals, *, with_current: bool) -> None:
        self.force = signals.smooth(signals.acceleration[:, 0], FORCE_CUTOFF_HZ)
        self.current = signals.smooth(signals.current, FORCE_CUTOFF_HZ) if with_current else None
        self.block, self.floor = signals.block, FORCE_FLOOR**2 * FLOOR_SECONDS * signals.hertz


def _fit_unknowns(
    forces: ForwardForces, measurement: _Measurement, means: Floats, sds: Floats, start: Floats | None = None
) -> Fit:
    """Fit the unknowns by Gauss-Newton steps, each limited to one standard deviation of the prior.

    means, sds: means and standard deviations of the prior, (p,).
    start: (p,) first estimate; None for the means of the prior.
    """
    estimate = means.copy() if start is None else start.copy()
    for _ in range(_MAX_STEPS):
        force, current = forces.predict(estimate)
        slopes, current_slopes = forces.slopes(estimate)
        force_residual, blocks = measurement.force - force, measurement.block
        targets = force_residual + slopes @ estimate
        if measurement.current is not None:
            # Weight forces and current by the scatter of their residuals.
            current_scatter = max(_CURRENT_FLOOR_A, float((measurement.current - current).std()))
            scale = max(FORCE_FLOOR, float(force_residual.std())) / current_scatter
            slopes = np.vstack([slopes, scale * current_slopes])
            targets = np.concatenate([targets, scale * (measurement.current - current + current_slopes @ estimate)])
            blocks = np.concatenate([blocks, blocks])
        fit = fit_with_prior(slopes, targets, means, sds, blocks, measurement.floor)
        step = np.clip(fit.estimate - estimate, -sds, sds)
        estimate = estimate + step
        if np.abs(step / sds).max() < _MAX_LAST_STEP:
            break
    return Fit(estimate, fit.covariance, fit.predicted, fit.residual, fit.explained)


def forward_forces(
    signals: Signals, base: BaseModel, values: Floats, flow: Flow, uncertainty: AlphaUncertainty
) -> ForwardForces:
    """Return how much each unknown contributes to the forward force, over the thinned signals.

    values, uncertainty: see `fit_drag`.
    """
    coefficients, (slope, zero) = base.coefficients, lift_curve(base, values)
    thin_signals = signals.thin(FORCE_THINNING, {"alpha": flow.alpha})
    alpha, pressure = thin_signals.extra["alpha"], dynamic_force(thin_signals, base)
    lift = slope * alpha + zero
    forward_pressure, lift_excess = -pressure * np.cos(alpha), lift - coefficients.lift_least_drag
    tilt = pressure * lift * np.cos(alpha)
    return ForwardForces(
        signals=thin_signals,
        base=base,
        known=pressure * (lift + rate_and_elevator_lift(thin_signals, base)) * np.sin(alpha),
        tilts=tilt
        * np.vstack([np.full(len(alpha), uncertainty.angle), uncertainty.by_lift * (lift - uncertainty.mean_lift)]),
        drags=forward_pressure
        * np.vstack([np.full(len(alpha), coefficients.drag_zero), coefficients.drag_induced * np.square(lift_excess)]),
        elevator=forward_pressure * coefficients.drag_elevator * thin_signals.surfaces[:, 0],
        volts=battery_voltage(thin_signals, base),
    )
