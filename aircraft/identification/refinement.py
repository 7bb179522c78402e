"""Refine the moments by the errors of short predictions.

The equation-error method treats the measured rates as true, and its low-pass uses later samples: in real air, its
estimates of stiffness, damping and control power are all too small. The prediction-error method (Ljung, System
Identification, second edition, chapter 7; the filter-error method of Jategaonkar, Flight Vehicle System Identification,
second edition, chapter 5, is its one-step form) compares angular rates 0.1 s and 0.3 s ahead: long enough for the rates
to respond, short enough that the autopilot has hardly reacted to later gusts. The measured flow angles, gusts included,
are inputs. On a flight of an Ultra Stick 25e, damping and the power of elevator and ailerons are 0.7 to 0.8 of the wind
tunnel's values by this method, and 0.3 to 0.45 by equation error.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aircraft.identification.alignment import Signals
from aircraft.identification.base_model import BaseModel
from aircraft.identification.moments import AXES
from aircraft.identification.parameters import PARAMETERS, prior_means, prior_sds
from aircraft.identification.prediction import GustFilter, Predictor, prediction_starts
from aircraft.identification.regression import correlation_samples, fit_with_prior
from world.arrays import Flags, Floats, Ints

# Times ahead of the compared predictions, s.
HORIZONS_S = (0.1, 0.3)
# Other times ahead, s; their estimates show how much the estimate depends on the times. The autopilot reacts to gusts
# within these times, so that controls and gusts are correlated and the estimate is biased (Forssell and Ljung 1999,
# Closed-loop identification revisited, Automatica 35); the covariance from the residuals does not contain this bias.
OTHER_HORIZONS_S = {
    "time ahead of the predictions (0.06 to 0.2 s shorter)": (0.04, 0.1),
    "time ahead of the predictions (0.1 to 0.2 s longer)": (0.2, 0.5),
}
# Number of compared predictions.
_COUNT = 600
# Factor on the standard deviations of the prior in the refinement.
PRIOR_SPREAD = 2.5
# Number of Gauss-Newton steps.
MAX_STEPS = 4
# Largest condition index of a direction that the log determines. Errors of the measured regressors grow by this index
# in the estimate (Belsley, Kuh and Welsch 1980, Regression Diagnostics, section 3.2: 10 is a beginning and 30 a strong
# dependency): the rounding to 1 us of a rudder that only follows the ailerons, a mix, would be taken for its motion.
MAX_CONDITION_INDEX = 15.0
# Step of the difference quotients, in standard deviations of the prior.
_DIFFERENCE_STEP = 0.02
# True for the parameters of the moments.
IS_MOMENT: Flags = np.array([parameter.group in AXES for parameter in PARAMETERS])


@dataclass(frozen=True, slots=True, eq=False)
class Refinement:
    """Refined parameters of the moments.

    values: values of the m parameters for which `IS_MOMENT` is true, (m,).
    covariance: covariance of the values, (m, m).
    starts: (n,) rows of the compared predictions.
    filters: filters of the unmodelled moments about roll, pitch and yaw.
    errors: (3, n, h) errors of the predictions, rad/s, by axis, start and time ahead.
    gains: (m, 3 n h) change of the values with each error; the columns follow the flattened array ``errors``.
    """

    values: Floats
    covariance: Floats
    starts: Ints
    filters: Sequence[GustFilter]
    errors: Floats
    gains: Floats

    def values_for(self, signals: Signals, base: BaseModel, values: Floats) -> Floats:
        """Return the refined values (m,) for other signals, another base, or other lift and drag.

        The values are not refined again: they change by the gains times the change of the prediction errors.

        values: (n,) all parameters, of which the parameters of the moments are ignored.
        """
        tried_values = values.copy()
        tried_values[IS_MOMENT] = self.values
        errors = prediction_errors(signals, base, tried_values, self.starts, self.filters)
        return np.asarray(self.values + self.gains @ (errors - self.errors).ravel())


def refine_moments(
    signals: Signals, base: BaseModel, values: Floats, horizons: Sequence[float] = HORIZONS_S, steps: int = MAX_STEPS
) -> Refinement:
    """Refine the parameters of the moments so that the angular rates are predicted best.

    values: values of all parameters, (n,), from which the refinement starts.
    horizons: times after which predictions are compared, s.
    steps: number of Gauss-Newton steps, each limited to one standard deviation of the prior.
    """
    starts = prediction_starts(signals, _COUNT, max(horizons))
    filters = Predictor(signals, base, values, with_flow=True).filters
    means, sds = prior_means()[IS_MOMENT], PRIOR_SPREAD * prior_sds()[IS_MOMENT]
    values = values.copy()

    def errors_of(tried_values: Floats) -> Floats:
        """Return the prediction errors of parameter values (n,)."""
        return prediction_errors(signals, base, tried_values, starts, filters, horizons)

    errors = errors_of(values)
    for _ in range(steps):
        scales = errors.std(axis=1, keepdims=True)
        slopes = np.empty((errors.size, len(means)))
        for column, k in enumerate(np.flatnonzero(IS_MOMENT)):
            moved_values, change = values.copy(), _DIFFERENCE_STEP * sds[column]
            moved_values[k] += change
            slopes[:, column] = ((errors - errors_of(moved_values)) / (scales * change)).ravel()
        slopes = remove_collinear_directions(slopes)
        target = (errors / scales).ravel() + slopes @ values[IS_MOMENT]
        blocks = np.broadcast_to(signals.block[starts][:, np.newaxis], errors.shape).ravel()
        fit = fit_with_prior(slopes, target, means, sds, blocks)
        step = np.clip(fit.estimate - values[IS_MOMENT], -sds / PRIOR_SPREAD, sds / PRIOR_SPREAD)
        values[IS_MOMENT] += step
        errors = errors_of(values)
    weight = 1.0 / (float(fit.residual.var()) * correlation_samples(fit.residual))
    gains = np.linalg.solve(weight * slopes.T @ slopes + np.diag(1.0 / np.square(sds)), weight * slopes.T)
    gains = gains / np.broadcast_to(scales, errors.shape).ravel()
    return Refinement(values[IS_MOMENT], fit.covariance, starts, filters, errors, gains)


def remove_collinear_directions(slopes: Floats) -> Floats:
    """Remove from slopes (n, m) the components along parameter directions that the log does not determine.

    These directions are combinations of the m parameters whose effects are nearly equal in the log, measured after all
    columns are scaled to the same length. Along them an estimate keeps its prior.

    >>> aileron = np.array([1.0, -1.0, 2.0, 0.5])
    >>> slopes = np.column_stack([aileron, aileron + 0.01 * np.array([1.0, 1.0, -1.0, 0.0])])
    >>> [int(np.linalg.matrix_rank(some)) for some in (slopes, remove_collinear_directions(slopes))]
    [2, 1]
    """
    lengths = np.linalg.norm(slopes, axis=0) + 1e-300
    left_vectors, singular_values, right_vectors = np.linalg.svd(slopes / lengths, full_matrices=False)
    is_determined = singular_values * MAX_CONDITION_INDEX > singular_values[0]
    return np.asarray(
        (left_vectors[:, is_determined] * singular_values[is_determined]) @ right_vectors[is_determined] * lengths
    )


def prediction_errors(
    signals: Signals,
    base: BaseModel,
    values: Floats,
    starts: Ints,
    filters: Sequence[GustFilter],
    horizons: Sequence[float] = HORIZONS_S,
) -> Floats:
    """Return the measured minus the predicted angular rates, rad/s, (3, n, h).

    starts: (n,) rows at which the predictions start.
    filters: filters of the unmodelled moments about roll, pitch and yaw.
    horizons: h times after which predictions are compared, s.

    The first axis of the result is the rate: roll, pitch, yaw.
    """
    predicted = Predictor(signals, base, values, filters, with_flow=True).predict(starts, horizons)
    measured = [signals.rates[starts + round(horizon * signals.hertz)] for horizon in horizons]
    return np.stack(
        [(rates - predicted[horizon][:, :3]).T for rates, horizon in zip(measured, horizons, strict=True)], axis=2
    )
