"""Drag and thrust together, from the forward acceleration, and from the battery's current where it is logged.

Level flight alone tells only their difference; climbs, glides and other speeds tell more, and the current tells most.
What else is not known about motor and accelerometer is estimated with them, within what it can be.  What of that is
the aircraft's own (its motor's resistance, the battery's voltage) is then folded into the parameters: the model has no
place for it, and without it would fly with another thrust than the one that was measured.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.identification.alignment import Signals
from aircraft.identification.base_model import BaseModel
from aircraft.identification.flow import Flow, lift_curve, other_lift, pressure_of, voltage_of
from aircraft.identification.parameters import PARAMETERS, prior_means, prior_sds
from aircraft.identification.regression import Fit, fit_with_prior

Floats = NDArray[np.float64]

# Below which forces are compared, Hz, and of so many samples one.
FORCE_BAND, FORCE_THINNING = 1.0, 10
# Not known either, and estimated with drag and thrust, of which the log says little: (what, standard deviation).
NUISANCES = {
    "forward accelerometer, m/s2": 0.01,
    "resistance of the motor": 0.2,
    "idle current of the motor": 0.3,
    "voltage of the battery": 0.02,
    "drag of the elevator": 0.5,
    "angle of attack": 1.0,
    "angle of attack by lift": 1.0,
}
# The last two count in standard deviations of `AlphaDoubt`.

# Of the aircraft, where the others are of its sensors.
_OF_AIRCRAFT = np.array([name.split()[0] in ("resistance", "idle", "voltage", "drag") for name in NUISANCES])
# Steps of the folding's search.
_FOLDING_STEPS = 3
# Where the battery's voltage is logged, it is known this much better.
_LOGGED_VOLTAGE = 0.25
# What no model gets right, m/s^2 and A, and over how long it stays the same, s: a climb, a glide, a level run.
FORCE_FLOOR, _CURRENT_FLOOR, FLOOR_SECONDS = 0.015, 0.3, 25.0
_OWN = np.array([parameter.group == "drag" for parameter in PARAMETERS])
_STEP = 1e-3
# Steps of a search at most, and how short the last is, as a share of the prior's standard deviations.
_MAX_STEPS, _CLOSE = 12, 0.01


@dataclass(frozen=True, slots=True)
class AlphaDoubt:
    """How sure the angle of attack of the lift curve is.

    angle: standard deviation at a coefficient of lift, middle, rad.  by_lift: of its change by that coefficient, rad.
    """

    angle: float = float(np.radians(0.3))
    by_lift: float = 0.02
    middle: float = 0.6


@dataclass(frozen=True, slots=True)
class ForwardForces:
    """Thinned signals, and what of the forward force each unknown makes.

    known: (n,) N, of lift.  tilts: (2, n) N, of a standard deviation of each doubt about the angle of attack.
    drags: (2, n) N, of zero-lift and induced drag.  elevator: (n,) N, of its drag.
    """

    signals: Signals
    base: BaseModel
    known: Floats
    tilts: Floats
    drags: Floats
    elevator: Floats
    volts: Floats | float

    def predicted(self, unknown: Floats) -> tuple[Floats, Floats]:
        """Forward acceleration (n,), m/s^2, and current (n,), A, low-passed; unknown: parameters, then nuisances."""
        force, current = self._raw(unknown)
        return self.signals.smooth(force, FORCE_BAND), self.signals.smooth(current, FORCE_BAND)

    def _raw(self, unknown: Floats) -> tuple[Floats, Floats]:
        """Both as they are before the low-pass."""
        zero_lift, induced, thrust, speed, torque, bias, resistance, idle, voltage, of_elevator, *tilts = unknown
        motor = self.base.motor.changed(thrust, speed, torque, 1.0 + resistance, 1.0 + idle)
        signals = self.signals
        pull, current = motor.thrust_and_current(
            signals.airspeed, signals.throttle, signals.density, self.volts * (1.0 + voltage)
        )
        force = self.known + np.array([zero_lift, induced]) @ self.drags + (1.0 + of_elevator) * self.elevator + pull
        force = force + np.array(tilts) @ self.tilts
        return force / self.base.mass + bias, current

    def slopes(self, unknown: Floats) -> tuple[Floats, Floats]:
        """(n, p) of both, by each of what is not known."""
        steps = _STEP * np.eye(len(unknown))
        # One low-pass of all columns: a call of it costs far more than a column.
        forces, currents = zip(*(self._raw(unknown + step) for step in (0.0 * steps[0], *steps)), strict=True)
        force, current = (self.signals.smooth(np.column_stack(one), FORCE_BAND) for one in (forces, currents))
        return (force[:, 1:] - force[:, :1]) / _STEP, (current[:, 1:] - current[:, :1]) / _STEP


def fit_drag(
    signals: Signals, base: BaseModel, values: Floats, flow: Flow, doubt: AlphaDoubt | None = None
) -> tuple[Fit, Floats, Floats]:
    """Fit, values (5,) of the parameters of drag and motor, and their covariance (5, 5).

    The values are those with which the base's own resistance, idle current, voltage and drag of the elevator make the
    same forces and currents as the fit does with what it found for those.

    values: (n,) of all parameters, of which those of lift count.  doubt: about the lift curve.
    """
    forces = forward_forces(signals, base, values, flow, AlphaDoubt() if doubt is None else doubt)
    thin = forces.signals
    with_current = bool(np.isfinite(thin.current).all())
    means, sds = drag_priors(with_current=with_current)
    # From the forces alone to the two together: with the current at once the first steps lead astray.
    fit = _search(forces, _Goal(thin, with_current=False), means, sds)
    if with_current:
        fit = _search(forces, _Goal(thin, with_current=True), means, sds, fit.estimate)
    force, _ = forces.predicted(fit.estimate)
    goal = thin.smooth(thin.acceleration[:, 0], FORCE_BAND)
    explained = 1.0 - float((goal - force).var() / goal.var())
    five, turn = _folded(forces, fit.estimate)
    return Fit(fit.estimate, fit.covariance, force, goal - force, explained), five, turn @ fit.covariance @ turn.T


def drag_priors(*, with_current: bool) -> tuple[Floats, Floats]:
    """Means and standard deviations (p,) of the parameters of drag and motor, and of `NUISANCES` behind them."""
    nuisances = np.array(list(NUISANCES.values()))
    nuisances[list(NUISANCES).index("voltage of the battery")] *= _LOGGED_VOLTAGE if with_current else 1.0
    means = np.concatenate([prior_means()[_OWN], np.zeros(len(nuisances))])
    return means, np.concatenate([prior_sds()[_OWN], nuisances])


def _folded(forces: ForwardForces, unknown: Floats) -> tuple[Floats, Floats]:
    """Parameters (5,) that do alone what they and the aircraft's nuisances do together, and their slopes (5, p).

    Least squares over the log's own flow and throttle.  unknown: (p,) as fitted.
    """
    own = int(_OWN.sum())
    folded = own + np.flatnonzero(_OF_AIRCRAFT)
    scale = FORCE_FLOOR / _CURRENT_FLOOR

    def joined(force: Floats, current: Floats) -> Floats:
        return np.concatenate([force, scale * current])

    goal = joined(*forces.predicted(unknown))
    alone = unknown.copy()
    alone[folded] = 0.0
    for _ in range(_FOLDING_STEPS):
        columns = joined(*forces.slopes(alone))
        left = goal - joined(*forces.predicted(alone))
        alone[:own] += np.linalg.lstsq(columns[:, :own], left, rcond=None)[0]
    turn = np.zeros((own, len(unknown)))
    turn[:, :own] = np.eye(own)
    turn[:, folded] = np.linalg.lstsq(columns[:, :own], columns[:, folded], rcond=None)[0]
    return alone[:own], turn


class _Goal:
    """What is measured: forward acceleration and, with the current, that; (n,) low-passed."""

    def __init__(self, signals: Signals, *, with_current: bool) -> None:
        self.force = signals.smooth(signals.acceleration[:, 0], FORCE_BAND)
        self.current = signals.smooth(signals.current, FORCE_BAND) if with_current else None
        self.block, self.floor = signals.block, FORCE_FLOOR**2 * FLOOR_SECONDS * signals.hertz


def _search(forces: ForwardForces, goal: _Goal, means: Floats, sds: Floats, start: Floats | None = None) -> Fit:
    """Steps of Gauss and Newton from a start, none longer than a standard deviation of the prior."""
    now = means.copy() if start is None else start.copy()
    for _ in range(_MAX_STEPS):
        force, current = forces.predicted(now)
        rows, second = forces.slopes(now)
        left, blocks = goal.force - force, goal.block
        goals = left + rows @ now
        if goal.current is not None:
            # Both count by the scatter of their residuals.
            off = max(_CURRENT_FLOOR, float((goal.current - current).std()))
            scale = max(FORCE_FLOOR, float(left.std())) / off
            rows = np.vstack([rows, scale * second])
            goals = np.concatenate([goals, scale * (goal.current - current + second @ now)])
            blocks = np.concatenate([blocks, blocks])
        fit = fit_with_prior(rows, goals, means, sds, blocks, goal.floor)
        step = np.clip(fit.estimate - now, -sds, sds)
        now = now + step
        if np.abs(step / sds).max() < _CLOSE:
            break
    return Fit(now, fit.covariance, fit.predicted, fit.residual, fit.explained)


def forward_forces(signals: Signals, base: BaseModel, values: Floats, flow: Flow, doubt: AlphaDoubt) -> ForwardForces:
    """What each unknown makes of the forward force, over the thinned signals; values, doubt: as of `fit_drag`."""
    c, (slope, zero) = base.coefficients, lift_curve(base, values)
    thin = signals.thinned(FORCE_THINNING, {"alpha": flow.alpha})
    alpha, pressure = thin.extra["alpha"], pressure_of(thin, base)
    lift = slope * alpha + zero
    ahead, rise = -pressure * np.cos(alpha), lift - c.lift_least_drag
    tilt = pressure * lift * np.cos(alpha)
    return ForwardForces(
        signals=thin,
        base=base,
        known=pressure * (lift + other_lift(thin, base)) * np.sin(alpha),
        tilts=tilt * np.vstack([np.full(len(alpha), doubt.angle), doubt.by_lift * (lift - doubt.middle)]),
        drags=ahead * np.vstack([np.full(len(alpha), c.drag_zero), c.drag_induced * np.square(rise)]),
        elevator=ahead * c.drag_elevator * thin.surfaces[:, 0],
        volts=voltage_of(thin, base),
    )
