"""Least squares with a prior, and a covariance that allows for autocorrelated residuals."""

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


def correlation_samples(residual: Floats, most: int = 500) -> float:
    """Return the correlation length of a series (n,) in samples.

    It is the sum of the autocorrelation up to its first zero: that many samples carry the information of one.

    >>> round(correlation_samples(np.random.default_rng(1).normal(size=4000)))
    1
    """
    from scipy.fft import next_fast_len

    n = len(residual)
    centred = residual - residual.mean()
    size = next_fast_len(n + most, real=True)
    spectrum = np.abs(np.fft.rfft(centred, size)) ** 2
    correlation = np.fft.irfft(spectrum, size)[: min(most, n)]
    if correlation[0] <= 0.0:
        return 1.0
    correlation = correlation / correlation[0]
    below = np.flatnonzero(correlation <= 0.0)
    last = int(below[0]) if below.size else len(correlation)
    return float(max(1.0, 1.0 + 2.0 * correlation[1:last].sum()))


def fit_with_prior(
    columns: Floats, measured: Floats, mean: Floats, sd: Floats, blocks: Ints, floor: float = 0.0
) -> Fit:
    """Return the most probable coefficients of columns (n, p) for measured (n,), with normal priors.

    mean, sd: (p,) of the independent priors; an infinite sd means no prior.
    blocks: (n,) block number of each row.
    floor: smallest variance of a residual times its correlation length in samples, for errors of every model.

    The data's weight counts only independent samples, by the residual's autocorrelation; the covariance is the robust
    one over blocks (White 1980, Liang and Zeger 1986), plus the prior's contribution.

    >>> x = np.linspace(0.0, 1.0, 50)
    >>> fit = fit_with_prior(x[:, None], 3.0 * x, np.zeros(1), np.full(1, np.inf), np.arange(50) // 5)
    >>> round(float(fit.estimate[0]), 6)
    3.0
    """
    precision = 1.0 / np.square(sd)
    normal = columns.T @ columns
    right = columns.T @ measured
    estimate = np.linalg.lstsq(normal + 1e-12 * np.trace(normal) * np.eye(len(mean)), right, rcond=None)[0]
    weight = 1.0
    for _ in range(4):
        residual = measured - columns @ estimate
        scatter = float(residual.var()) + 1e-12 * float(np.square(measured).mean()) + 1e-300
        weight = 1.0 / max(floor, scatter * correlation_samples(residual))
        estimate = np.linalg.solve(weight * normal + np.diag(precision), weight * right + precision * mean)
    predicted = columns @ estimate
    residual = measured - predicted
    inverse = np.linalg.inv(weight * normal + np.diag(precision))
    scores = weight * columns * residual[:, np.newaxis]
    count = int(blocks.max()) + 1
    sums = np.zeros((count, len(mean)))
    np.add.at(sums, blocks, scores)
    # Correct for a small number of blocks, whose scatter is underestimated.
    robust = sums.T @ sums * count / max(1, count - len(mean))
    if floor > 0.0:
        robust = robust + weight * normal
    covariance = inverse @ robust @ inverse
    covariance = covariance + inverse @ np.diag(precision) @ inverse
    variance = float(measured.var())
    explained = 1.0 - float(residual.var()) / variance if variance > 0.0 else 0.0
    return Fit(estimate, covariance, predicted, residual, explained)
