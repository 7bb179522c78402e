"""Fit the lift curve by reverse regression.

The angle of attack, computed from attitude, is regressed on the lift coefficient.

At low frequencies an aircraft heaves with the gusts: its lift does not contain the gusts, but the angle of attack from
attitude and velocity does. Therefore the lift is the regressor, without errors, and the angle of attack has the errors.
"""

import numpy as np

from aircraft.identification.alignment import Signals
from aircraft.identification.base_model import BaseModel
from aircraft.identification.flow import alpha_from_attitude
from aircraft.identification.parameters import prior_sds
from aircraft.identification.regression import Fit, fit_with_prior
from world.arrays import Floats

# Cutoff below which lift and angle of attack are compared, Hz.
LIFT_CUTOFF_HZ = 0.15


def fit_lift(signals: Signals, base: BaseModel, lift: Floats, level: float = 0.0) -> tuple[Fit, Floats, Floats]:
    """Fit the lift curve; return the fit, the slope and offset (2,), and their covariance (2, 2).

    lift: (n,) lift coefficient.
    level: angle of the autopilot's level above the model's level, rad.
    """
    measured = signals.smooth(alpha_from_attitude(signals, level), LIFT_CUTOFF_HZ)
    smoothed = signals.smooth(lift, LIFT_CUTOFF_HZ)
    c = base.coefficients
    slope_sd, offset_sd = prior_sds()[:2]
    # Fit the angle at the mean lift, where slope and angle are uncorrelated.
    mean_lift = float(smoothed.mean())
    columns = np.column_stack([smoothed - mean_lift, np.ones(len(smoothed))])
    inverse = 1.0 / c.lift_alpha
    mean = np.array([inverse, (mean_lift - c.lift_zero) * inverse])
    fit = fit_with_prior(columns, measured, mean, np.array([slope_sd * inverse, offset_sd * inverse]), signals.block)
    inverse_slope, angle = fit.estimate
    slope = 1.0 / inverse_slope
    curve = np.array([slope / c.lift_alpha, mean_lift - slope * angle - c.lift_zero])
    jacobian = np.array([[-slope * slope / c.lift_alpha, 0.0], [slope * slope * angle, -slope]])
    return fit, curve, jacobian @ fit.covariance @ jacobian.T
