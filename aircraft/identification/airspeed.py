"""Estimate the scale of the airspeed sensor from the wind triangle.

Ground velocity minus air velocity is the wind.

The wind does not depend on the aircraft's heading. If the sensor reads too little, a part of the airspeed appears as
wind, and this part turns with the aircraft: every turn shows it. Wind and gusts also change, but slowly, so the change
of the difference from one second to the next is used.
"""

from dataclasses import replace

import numpy as np

from aircraft.identification.alignment import Signals
from aircraft.identification.flight_record import low_pass
from aircraft.identification.flow import Flow
from aircraft.identification.regression import fit_with_prior
from world.arrays import Floats

# Standard deviation of an uncalibrated sensor's factor.
SCALE_SD = 0.02
# Smallest standard deviation after the estimate.
_MIN_SD = 0.002
# Standard deviation of the heading, rad.
_HEADING_SD_RAD = float(np.radians(3.0))
# Correlation time of a gust, s (MIL-F-8785C, 3.7.3: 290 m at 150 m above ground, at 25 m/s).
_GUST_TIME_S = 11.5
# Standard deviation of a mean wind, m/s.
_WIND_SD_MPS = 30.0
# One of this many samples is used.
_THINNING = 25


def with_airspeed_scale(signals: Signals, flow: Flow) -> Signals:
    """Scale the airspeed of the signals to fit the wind triangle.

    flow: flow angles of the signals.

    The fields ``airspeed_factor`` and ``airspeed_sd`` of the result state the scale and its standard deviation.
    """
    factor, sd = airspeed_scale(signals, flow)
    return replace(signals, airspeed=signals.airspeed * factor, airspeed_factor=factor, airspeed_sd=sd)


def airspeed_scale(signals: Signals, flow: Flow) -> tuple[float, float]:
    """Return the ratio of true to measured airspeed, and its standard deviation.

    The ratio, an error of the heading and a mean wind for each record are fitted to the velocities. The residuals are
    taken as gusts, whose autocorrelation is removed before the fit.

    The flow is used only for the direction of the airspeed, to which the scale is insensitive to first order.
    """
    from scipy.signal import lfilter

    # Velocity through the air.
    roll, pitch, yaw = signals.attitude.T
    u = signals.airspeed * np.cos(flow.alpha) * np.cos(flow.beta)
    v = signals.airspeed * np.sin(flow.beta)
    w = signals.airspeed * np.sin(flow.alpha) * np.cos(flow.beta)
    # Components with wings level, then with wings and nose level.
    wings_level_down = v * np.sin(roll) + w * np.cos(roll)
    right = v * np.cos(roll) - w * np.sin(roll)
    forward = u * np.cos(pitch) + wings_level_down * np.sin(pitch)
    north_air, east_air = forward * np.cos(yaw) - right * np.sin(yaw), forward * np.sin(yaw) + right * np.cos(yaw)
    thin_signals = signals.thin(_THINNING, {"north_air": north_air, "east_air": east_air})
    north_air, east_air = thin_signals.extra["north_air"], thin_signals.extra["east_air"]
    north, east, _ = thin_signals.velocity.T
    row_ranges = list(zip(thin_signals.edges[:-1], thin_signals.edges[1:], strict=True))
    # Wind is ground velocity minus air velocity; an error of the heading rotates the air velocity. A gust changes the
    # wind, the airspeed and the direction of the air velocity, and after a while the ground velocity, since the
    # aircraft drifts with the gust: a regressor that contains the gust would bias the scale. The regressor is therefore
    # the mean airspeed along the flown course, smoothed over the time in which gusts change.
    mean_air = np.empty((2, len(north_air)))
    for start_row, end_row in row_ranges:
        rows = slice(start_row, end_row)
        ground, air = np.column_stack([north[rows], east[rows]]), np.column_stack([north_air[rows], east_air[rows]])
        course = low_pass(ground - (ground - air).mean(axis=0), 1.0 / _GUST_TIME_S, thin_signals.hertz)
        length = np.maximum(1.0, np.hypot(*course.T))
        mean_air[:, rows] = (thin_signals.airspeed[rows].mean() / length)[np.newaxis, :] * course.T
    columns = [(mean_air[0], mean_air[1]), (-mean_air[1], mean_air[0])]
    for start_row, end_row in row_ranges:
        indicator = np.zeros(len(north_air))
        indicator[start_row:end_row] = 1.0
        columns += [(indicator, 0.0 * indicator), (0.0 * indicator, indicator)]
    decay = float(np.exp(-1.0 / (_GUST_TIME_S * thin_signals.hertz)))

    def whiten(values: Floats) -> Floats:
        """Remove the autocorrelation of gusts (`_GUST_TIME_S`) from values (n,), in each record separately."""
        filtered = np.empty_like(values)
        for start_row, end_row in row_ranges:
            record_values = values[start_row:end_row]
            filtered[start_row:end_row] = lfilter(
                [1.0, -decay], [1.0], record_values, zi=np.array([-decay * record_values[0]])
            )[0]
            filtered[start_row] = record_values[0] * np.sqrt(1.0 - decay * decay)
        return filtered

    regressors = np.column_stack([np.concatenate([whiten(a), whiten(b)]) for a, b in columns])
    targets = np.concatenate([whiten(north - north_air), whiten(east - east_air)])
    sds = np.concatenate([[SCALE_SD, _HEADING_SD_RAD], np.full(2 * len(row_ranges), _WIND_SD_MPS)])
    blocks = np.concatenate([thin_signals.block, thin_signals.block + thin_signals.block.max() + 1])
    fit = fit_with_prior(regressors, targets, np.zeros(len(sds)), sds, blocks)
    return 1.0 + float(fit.estimate[0]), float(np.hypot(_MIN_SD, np.sqrt(fit.covariance[0, 0])))
