"""Fit pitch, roll and yaw: the equations of rotation for the gyros' rates of change.

Euler's equations with a product of inertia (Etkin and Reid, Dynamics of Flight, third edition, section 4.6). Only
moments relative to the moments of inertia are observable.
"""

import numpy as np

from aircraft.identification.alignment import Signals
from aircraft.identification.base_model import BaseModel
from aircraft.identification.flow import dynamic_force
from aircraft.identification.motor import Motor
from aircraft.identification.parameters import PARAMETERS, Group
from aircraft.identification.regression import Fit, fit_with_prior
from world.arrays import Floats

# Axes in the order in which they are fitted.
AXES: tuple[Group, ...] = ("pitch", "roll", "yaw")

# Cutoff below which moments are compared, Hz.
MOMENT_CUTOFF_HZ = 4.0
# One of this many samples is used.
MOMENT_THINNING = 2
# Standard deviation of the moment coefficient from an aircraft's asymmetry, or a surface's trim, in a record.
_TRIM_SD = 0.01


def fit_moments(
    signals: Signals,
    base: BaseModel,
    alpha: Floats,
    beta: Floats,
    motor: Motor | None = None,
    prior_factor: float = 1.0,
) -> dict[Group, Fit]:
    """Fit the moments in pitch, roll and yaw, and return the fits by axis.

    alpha, beta: (n,) rad.
    motor: motor whose torque rolls the aircraft; None for the base's motor.
    prior_factor: factor on the priors' standard deviations.

    For each axis the fit has the parameters, and then a trim offset for each record, because the trim of the surfaces
    and the biases of the sensors may differ between records.
    """
    thin_signals = signals.thin(MOMENT_THINNING, {"alpha": alpha, "beta": beta})
    pressure = dynamic_force(thin_signals, base)
    required = required_moments(thin_signals, base, base.motor if motor is None else motor)
    terms = _moment_regressors(thin_signals, base)
    fits = {}
    ixx, iyy, izz, _ = base.inertia
    rows = np.arange(len(thin_signals.airspeed))
    for axis, inertia, length in zip(AXES, (iyy, ixx, izz), (base.chord, base.span, base.span), strict=True):
        known_part, *columns = terms[axis]
        parameters = [parameter for parameter in PARAMETERS if parameter.group == axis]
        means, sds = [parameter.prior for parameter in parameters], [parameter.sd for parameter in parameters]
        # A trim is a column that is 1 in its record and 0 elsewhere.  With a single record, the parameter
        # "pitch-offset" is the trim offset in pitch.
        ranges = zip(thin_signals.edges[:-1], thin_signals.edges[1:], strict=True)
        if axis == "pitch" and len(thin_signals.edges) <= 2:
            trims = []
        else:
            trims = [((rows >= start_row) & (rows < end_row)).astype(float) for start_row, end_row in ranges]
        columns, means, sds = [*columns, *trims], [*means, *(0.0 for _ in trims)], [*sds, *(_TRIM_SD for _ in trims)]
        scale = pressure * length / inertia
        equation = np.column_stack(
            [required[axis] / inertia - scale * known_part, *(scale * column for column in columns)]
        )
        equation = thin_signals.smooth(equation, MOMENT_CUTOFF_HZ)
        fits[axis] = fit_with_prior(
            equation[:, 1:], equation[:, 0], np.array(means), prior_factor * np.array(sds), thin_signals.block
        )
    return fits


def required_moments(signals: Signals, base: BaseModel, motor: Motor) -> dict[Group, Floats]:
    """Return the aerodynamic moments that the motion requires, N m, (n,), by axis.

    The roll moment also balances the reaction to the torque of the propeller, which rolls the aircraft to the left.
    """
    ixx, iyy, izz, ixz = base.inertia
    p, q, r = signals.rates.T
    dp, dq, dr = signals.rate_changes.T
    torque = (
        motor.propeller_torque(signals.airspeed, signals.throttle, signals.density) if base.has_torque_reaction else 0.0
    )
    return {
        "pitch": iyy * dq + (ixx - izz) * p * r + ixz * (p * p - r * r),
        "roll": ixx * dp - ixz * (dr + p * q) + (izz - iyy) * q * r + torque,
        "yaw": izz * dr - ixz * (dp - q * r) + (iyy - ixx) * p * q,
    }


def _moment_regressors(signals: Signals, base: BaseModel) -> dict[Group, list[Floats]]:
    """Return the terms of the moment coefficient of each axis, arrays (n,).

    The first term of an axis is the part that no parameter changes. Each of the others is multiplied by one parameter,
    in the order of `PARAMETERS`.
    """
    c = base.coefficients
    alpha, beta = signals.extra["alpha"], signals.extra["beta"]
    elevator, aileron, rudder = signals.surfaces.T
    span_factor, chord_factor = base.span / (2.0 * signals.airspeed), base.chord / (2.0 * signals.airspeed)
    roll = signals.rates[:, 0] * span_factor
    pitch = signals.rates[:, 1] * chord_factor
    yaw = signals.rates[:, 2] * span_factor
    ones = np.ones(len(alpha))
    return {
        "pitch": [
            c.pitch_zero * ones,
            ones,
            c.pitch_alpha * alpha,
            c.pitch_rate * pitch,
            c.pitch_elevator * elevator,
        ],
        "roll": [
            c.roll_rudder * rudder,
            c.roll_beta * beta,
            c.roll_roll * roll,
            c.roll_yaw * yaw,
            c.roll_aileron * aileron,
        ],
        "yaw": [
            0.0 * ones,
            c.yaw_beta * beta,
            c.yaw_roll * roll,
            c.yaw_yaw * yaw,
            c.yaw_aileron * aileron,
            c.yaw_rudder * rudder,
        ],
    }
