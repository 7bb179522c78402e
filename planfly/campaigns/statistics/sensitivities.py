"""How much of a result's variance each drawn quantity explains, from the flights that were flown anyway.

First-order index of variance, Var(E[y | x]) / Var(y), estimated from given data: flights are sorted into groups of
equal size by x, and the variance between the groups' means is compared with that of all (Plischke, Borgonovo, Smith,
"Global sensitivity measures from given data", EJOR 226, 2013).  What groups of a few differ by chance is taken off, as
in Kelley's epsilon squared (PNAS 21, 1935), so that a quantity that does nothing comes to nothing.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FEWEST_FLIGHTS = 30
_MAX_GROUPS = 64


def first_order(x: Floats, y: Floats) -> float:
    """First-order index of y (n,) to x (n,), 0 to 1; 0 for fewer than `FEWEST_FLIGHTS`, or where y does not vary.

    >>> random = np.random.default_rng(1)
    >>> x = random.random((4000, 2))
    >>> [round(first_order(x[:, k], 3.0 * x[:, 0] + x[:, 1]), 1) for k in range(2)]
    [0.9, 0.1]
    """
    count = x.size
    total = float(((y - y.mean()) ** 2).sum()) if count else 0.0
    if count < FEWEST_FLIGHTS or total <= 1e-12 * count or np.ptp(x) == 0.0:
        return 0.0
    groups = int(min(_MAX_GROUPS, max(4, round(2.0 * count ** (1.0 / 3.0)))))
    parts = np.array_split(y[np.argsort(x, kind="stable")], groups)
    between = sum(part.size * float(part.mean() - y.mean()) ** 2 for part in parts)
    within = (total - between) / (count - groups)
    return float(np.clip((between - (groups - 1) * within) / total, 0.0, 1.0))


def rank_slope(x: Floats, y: Floats) -> float:
    """Spearman's rank correlation, -1 to 1: which way y goes with x; 0 where either does not vary.

    >>> rank_slope(np.arange(5.0), -np.arange(5.0) ** 3)
    -1.0
    """
    from scipy.stats import spearmanr

    if x.size < 3 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return 0.0
    return round(float(spearmanr(x, y).statistic), 12)
