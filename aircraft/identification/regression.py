"""Fit by least squares with a prior, and a covariance that allows for autocorrelated residuals."""

from dataclasses import dataclass

import numpy as np

from world.arrays import Floats, Ints


@dataclass(frozen=True, slots=True)
class Fit:
    """Result of a regression.

    estimate: (p,).
    covariance: (p, p), from blocks of residuals and the prior.
    predicted: (n,) prediction of the measured values.
    residual: (n,) measured minus predicted.
    explained: R^2, fraction of the measured variance that the prediction explains.
    """

    estimate: Floats
    covariance: Floats
    predicted: Floats
    residual: Floats
    explained: float


def correlation_samples(residual: Floats, max_lag: int = 500) -> float:
    """Return the correlation length of a series (n,), in samples; at most `max_lag` lags are examined.

    It is the two-sided sum of the autocorrelation up to its first zero: this number of samples contains as much
    information as one independent sample.

    >>> round(correlation_samples(np.random.default_rng(1).normal(size=4000)))
    1
    """
    from scipy.fft import next_fast_len

    n = len(residual)
    centred = residual - residual.mean()
    size = next_fast_len(n + max_lag, real=True)
    spectrum = np.abs(np.fft.rfft(centred, size)) ** 2
    correlation = np.fft.irfft(spectrum, size)[: min(max_lag, n)]
    if correlation[0] <= 0.0:
        return 1.0
    correlation = correlation / correlation[0]
    non_positive = np.flatnonzero(correlation <= 0.0)
    end = int(non_positive[0]) if non_positive.size else len(correlation)
    return float(max(1.0, 1.0 + 2.0 * correlation[1:end].sum()))


def fit_with_prior(
    columns: Floats, measured: Floats, mean: Floats, sd: Floats, blocks: Ints, floor: float = 0.0
) -> Fit:
    """Fit measured (n,) = columns (n, p) @ coefficients by maximum a posteriori, with normal priors.

    mean, sd: means and standard deviations of the independent priors, (p,); an infinite standard deviation means no
        prior.
    blocks: (n,) block number of each row.
    floor: lower bound on the residual variance times the correlation length in samples; it allows for errors of the
        model itself.

    The weight of the data is divided by the correlation length of the residuals, because autocorrelated samples contain
    less information. The covariance is the robust covariance over blocks (White 1980, Liang and Zeger 1986), plus the
    contribution of the prior.

    >>> x = np.linspace(0.0, 1.0, 50)
    >>> fit = fit_with_prior(x[:, None], 3.0 * x, np.zeros(1), np.full(1, np.inf), np.arange(50) // 5)
    >>> round(float(fit.estimate[0]), 6)
    3.0
    """
    precision = 1.0 / np.square(sd)
    normal_matrix = columns.T @ columns
    moment = columns.T @ measured
    estimate = np.linalg.lstsq(normal_matrix + 1e-12 * np.trace(normal_matrix) * np.eye(len(mean)), moment, rcond=None)[
        0
    ]
    weight = 1.0
    for _ in range(4):
        residual = measured - columns @ estimate
        scatter = float(residual.var()) + 1e-12 * float(np.square(measured).mean()) + 1e-300
        weight = 1.0 / max(floor, scatter * correlation_samples(residual))
        estimate = np.linalg.solve(weight * normal_matrix + np.diag(precision), weight * moment + precision * mean)
    predicted = columns @ estimate
    residual = measured - predicted
    inverse = np.linalg.inv(weight * normal_matrix + np.diag(precision))
    scores = weight * columns * residual[:, np.newaxis]
    block_count = int(blocks.max()) + 1
    block_scores = np.zeros((block_count, len(mean)))
    np.add.at(block_scores, blocks, scores)
    # Correct for a small number of blocks, whose scatter is underestimated.
    score_covariance = block_scores.T @ block_scores * block_count / max(1, block_count - len(mean))
    if floor > 0.0:
        score_covariance = score_covariance + weight * normal_matrix
    covariance = inverse @ score_covariance @ inverse
    covariance = covariance + inverse @ np.diag(precision) @ inverse
    variance = float(measured.var())
    explained = 1.0 - float(residual.var()) / variance if variance > 0.0 else 0.0
    return Fit(estimate, covariance, predicted, residual, explained)
