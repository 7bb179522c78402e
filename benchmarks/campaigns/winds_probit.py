"""Measure a simpler method for `planfly winds`: a probit regression on the wind alone, with bootstrap intervals.

``python -m benchmarks.campaigns.winds_probit [--directions K ...] [--flights N]``: flies the demo in the air from each
direction (312 flights, as many as `planfly winds` has on average), in rounds whose winds are drawn between the
quantiles of 0.2 and 60 % failures of the fit so far, fits failures by a probit regression on the wind speed, and takes
the 95 % interval of the boundary from 500 bootstrap samples.  Prints it beside the reference of `winds_reference`, and
writes ``runs/winds-probit.json``.
"""

import argparse
import json
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import norm

from benchmarks.campaigns.winds_reference import GOAL, REFERENCE, WITHIN, demo, reference_interval
from planfly.campaigns.campaign_base import GivenWind
from planfly.campaigns.flight_requests import FlightRequest
from planfly.campaigns.flight_row import fly_one
from planfly.campaigns.worker_pool import WorkerPool, Workers, worker_pool

Floats = NDArray[np.float64]
# Flights of a direction's first round, evenly spread over all winds, and of each round after it.
_ROUND_SIZE = 24
_BOOTSTRAP_SAMPLES = 500
# Fractions of failures between which the winds of later rounds are drawn.
_LOWEST_FRACTION = 0.002
_HIGHEST_FRACTION = 0.6
# Standard deviation of the weak prior of the wind of 50 % failures, and of the logarithm of the width, in units of the
# largest wind: without it, flights that all pass have no maximum likelihood.
_PRIOR_WIDTH = 3.0
_TARGET = Path("runs") / "winds-probit.json"


def fit_probit(speeds: Floats, failed: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the wind in which 50 % of the flights fail, and the standard deviation of this wind, m/s.

    They maximise the likelihood times a wide normal prior.
    """

    def loss(parameters: Floats) -> float:
        """Return the negative log-likelihood of scaled mean and logarithm of the width."""
        z = (speeds / GOAL.most - parameters[0]) / np.exp(parameters[1])
        likelihood = norm.logcdf(z[failed]).sum() + norm.logsf(z[~failed]).sum()
        return float(0.5 * ((parameters[0] - 1.0) ** 2 + (parameters[1] + 2.0) ** 2) / _PRIOR_WIDTH**2 - likelihood)

    best = minimize(loss, np.array([1.0, -2.0]), method="Nelder-Mead")
    return GOAL.most * float(best.x[0]), GOAL.most * float(np.exp(best.x[1]))


def boundary(speeds: Floats, failed: NDArray[np.bool_], fraction: float) -> float:
    """Return the wind in which a fraction of the flights fails, m/s.

    It is at least 0 and at most the largest wind of the search.
    """
    center, width = fit_probit(speeds, failed)
    return float(np.clip(center + width * norm.ppf(fraction), 0.0, GOAL.most))


def fly_direction(
    pool: WorkerPool, direction: int, flights: int, random: np.random.Generator
) -> list[tuple[float, bool]]:
    """Fly rounds of flights; return wind speed, m/s, and True if failed, of each."""
    flown: list[tuple[float, bool]] = []
    while len(flown) < flights:
        if flown:
            speeds, failed = np.array([one[0] for one in flown]), np.array([one[1] for one in flown])
            low, high = (boundary(speeds, failed, fraction) for fraction in (_LOWEST_FRACTION, _HIGHEST_FRACTION))
            chosen = random.uniform(min(low, GOAL.most - 1.0), high, min(_ROUND_SIZE, flights - len(flown)))
        else:
            chosen = np.linspace(0.0, GOAL.most, _ROUND_SIZE)
        base_index = 100_000 * direction + len(flown)
        requests = iter(
            [
                FlightRequest(base_index + k, GivenWind(float(speed), 360.0 * direction / GOAL.directions))
                for k, speed in enumerate(chosen)
            ]
        )
        winds = {base_index + k: float(speed) for k, speed in enumerate(chosen)}
        flown.extend(
            (winds[one.request.index], one.row.outcome != "flyable") for one in pool.fly(partial(next, requests, None))
        )
    return flown


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.campaigns.winds_probit")
    parser.add_argument("--directions", type=int, nargs="*", default=list(range(GOAL.directions)))
    parser.add_argument("--flights", type=int, default=312, help="of each direction")
    args = parser.parse_args()
    reference = json.loads(REFERENCE.read_text(encoding="utf-8"))
    found, random = {}, np.random.default_rng(1)
    _TARGET.parent.mkdir(exist_ok=True)
    with worker_pool(Workers(2), demo(1), fly_one) as pool:
        for direction in args.directions:
            flown = fly_direction(pool, direction, args.flights, random)
            speeds, failed = np.array([one[0] for one in flown]), np.array([one[1] for one in flown])
            estimate = boundary(speeds, failed, 1.0 - GOAL.target)
            samples = []
            for _ in range(_BOOTSTRAP_SAMPLES):
                rows = random.integers(len(speeds), size=len(speeds))
                samples.append(boundary(speeds[rows], failed[rows], 1.0 - GOAL.target))
            low, high = (float(value) for value in np.quantile(samples, (0.025, 0.975)))
            true, (least, most) = (reference_interval(reference[str(direction)], share) for share in (0.0, 0.95))
            found[direction] = {"estimate": estimate, "interval": (low, high), "reference": (*true, least, most)}
            print(
                f"{22.5 * direction:5.1f} deg: {estimate:5.2f} ({low:5.2f} to {high:5.2f}), {failed.sum()} failed; "
                f"reference {true[0]:5.2f} ({least:5.2f} to {most:5.2f}); "
                f"within {WITHIN} m/s: {true[0] - WITHIN <= estimate <= true[1] + WITHIN}; "
                f"interval holds: {low - WITHIN <= most and least <= high + WITHIN}",
                flush=True,
            )
            _TARGET.write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main()
