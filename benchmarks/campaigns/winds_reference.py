"""Compare the boundaries of `planfly winds` on the demo with up to 1,000 flights at each of some fixed winds.

``python -m benchmarks.campaigns.winds_reference [--directions K ...] [--flights N] [--even] [--seed N]`` flies the
demo in winds of 0.5 m/s below and above each boundary that ``planfly winds jacksboro-air`` found, with other weather
and other aircraft, and adds the counts to ``tests/authorities/winds_reference.json``: some minutes per point.  If a
direction has only one point, and fewer flights than required are flyable there, it gets another point 1 m/s below.

The draws of a point are independent, or with ``--even`` evenly spread (Sobol points with Owen scrambling): each draw
has the same distribution, and the proportions of the drawn aircraft are as expected.  A point of independent draws ends
early if its share of flyable flights is above or below the target with 99 % confidence, valid at every number of
flights.  A point of Sobol samples does not end early.

The boundary of the reference is the maximum-likelihood normal distribution through a direction's points, and its
interval follows from the likelihood ratio, with a free slope; Sobol samples are treated as independent, which makes the
interval wider than necessary.  A boundary is right if it is within 0.5 m/s of the reference, and shown wrong if it is
within 0.5 m/s of no wind in the interval.  A direction with a single wind has its boundary above that wind if enough
flights are flyable, and below it if not.
"""

import argparse
import json
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from benchmarks.campaigns.sobol_samples import SOBOL_FLIGHTS, fly_sobol
from planfly.campaigns.campaign_base import CampaignBase, GivenWind, open_campaign
from planfly.campaigns.dispersions import default_dispersions
from planfly.campaigns.find_winds import SEARCHED_QUANTITIES, WindsGoal, WindsResult, find_winds, open_winds_store
from planfly.campaigns.flight_requests import FlightRequest, FlyOne
from planfly.campaigns.flight_row import fly_one
from planfly.campaigns.statistics.decision import Estimator, Goal, Tally
from planfly.campaigns.worker_pool import Workers, worker_pool

# File of the reference.
REFERENCE = Path(__file__).parents[2] / "tests" / "authorities" / "winds_reference.json"
# Goal of the search for boundaries.
GOAL = WindsGoal(0.99, 0.95, 16, 20.0, 5000)
# Tolerance of a boundary, m/s.
WITHIN = 0.5
# Grid of the reference's boundaries, where a share 1 - P fails, m/s.
_BOUNDARIES = np.arange(0.0, 30.0, 0.05)
# Grid of the slopes of the reference's distributions, 1/(m/s).
_SLOPES = np.geomspace(0.02, 20.0, 120)
# Default seed of the reference's draws; the boundaries are found with seed 1.
_SEED = 77


def demo(seed: int) -> CampaignBase:
    """Return the demo's campaign base, with dispersions but for the mean wind; seed: seed of the draws."""
    base = open_campaign("jacksboro-air", default_dispersions().without(SEARCHED_QUANTITIES), {"seed": 1})
    return replace(base, seed=seed)


def share_at(base: CampaignBase, wind: GivenWind, most: int) -> Tally:
    """Fly independent draws at one wind until the target is decided, up to ``most`` flights."""
    decide = Estimator(Goal(GOAL.target, True, most, 0.99))
    return _count_outcomes(base, wind, most, decide.decides, fly_one)


def sobol_share_at(base: CampaignBase, wind: GivenWind) -> Tally:
    """Fly a full set of Sobol samples at one wind."""
    return _count_outcomes(base, wind, SOBOL_FLIGHTS, lambda _: False, fly_sobol)


def _count_outcomes(
    base: CampaignBase, wind: GivenWind, most: int, ends: Callable[[Tally], bool], fly: FlyOne
) -> Tally:
    """Fly until `ends` returns True for the outcomes so far, or up to `most` flights."""
    indices, flown = iter(range(most)), Tally(0, 0, 0)

    def next_request() -> FlightRequest | None:
        """Return the next request; None if the outcomes decide or all flights are requested."""
        index = None if ends(flown) else next(indices, None)
        return None if index is None else FlightRequest(index, wind)

    with worker_pool(Workers(2), base, fly) as pool:
        for one in pool.fly(next_request):
            good = one.row.outcome == "flyable"
            flown = Tally(flown.flyable + good, flown.failed + (not good), 0)
    return flown


def found_winds() -> WindsResult:
    """Find the boundaries of `planfly winds jacksboro-air --seed 1`."""
    base = demo(1)
    with tempfile.TemporaryDirectory() as name, open_winds_store(base, GOAL, Path(name), resume=False) as store:
        return find_winds(base, GOAL, Workers(2), store)


def winds_row() -> dict[str, float]:
    """Count the flights of the search, and its directions that agree with the reference, by row name."""
    found = found_winds()
    kept = json.loads(REFERENCE.read_text(encoding="utf-8")) if REFERENCE.exists() else {}
    pairs = [(found.boundaries[int(direction)].estimate, points) for direction, points in kept.items()]
    return {
        "winds of the demo, 16 directions: flights": len(found.flights),
        "winds: directions with a reference": len(kept),
        "winds: of these right within 0.5 m/s": sum(is_within(one, points, 0.0) for one, points in pairs),
        "winds: of these not shown wrong at 95 %": sum(is_within(one, points, 0.95) for one, points in pairs),
        "winds: of these another reference would agree in": sum(agreement(points) for points in kept.values()),
    }


def is_within(boundary: float, points: list[dict[str, Any]], confidence: float) -> bool:
    """Return True if a boundary, m/s, is within 0.5 m/s of the reference's interval of this confidence."""
    low, high = reference_interval(points, confidence)
    return low - WITHIN <= boundary <= high + WITHIN


def reference_interval(points: list[dict[str, Any]], confidence: float) -> tuple[float, float]:
    """Return the confidence interval of the reference's boundary, m/s.

    For confidence 0 both ends are the most likely boundary.

    points: wind speed, number of flights and of flyable flights at each wind of one direction.

    >>> points = [{"speed": 8.0, "flights": 1000, "flyable": 995}, {"speed": 9.0, "flights": 1000, "flyable": 985}]
    >>> [round(one, 1) for one in reference_interval(points, 0.0)]
    [8.6, 8.6]
    """
    if len(speeds := {float(one["speed"]) for one in points}) == 1:
        speed = speeds.pop()
        return (speed, GOAL.most) if _enough_fly(points) else (0.0, speed - 0.05)
    likelihood = _log_likelihood(points).max(axis=0)
    likely = _BOUNDARIES[likelihood >= likelihood.max() - 0.5 * chi2.ppf(confidence, 1)]
    # Boundaries beyond the largest wind of the search are not distinguished.
    return min(float(likely[0]), GOAL.most), min(float(likely[-1]), GOAL.most)


def agreement(points: list[dict[str, Any]], references: int = 100) -> float:
    """Return the probability that another reference has its boundary within 0.5 m/s of this one.

    The other reference has the same size.  The most likely distribution of this reference is taken as the truth.  A
    reference with a single wind is treated as certain.
    """
    if len({one["speed"] for one in points}) == 1:
        return 1.0
    likelihood = _log_likelihood(points)
    k, at = np.unravel_index(int(np.argmax(likelihood)), likelihood.shape)
    boundary, random, agreed = min(float(_BOUNDARIES[at]), GOAL.most), np.random.default_rng(_SEED), 0
    for _ in range(references):
        other = []
        for point in points:
            failing = norm.cdf(norm.isf(GOAL.target) + _SLOPES[k] * (point["speed"] - _BOUNDARIES[at]))
            other.append(point | {"flyable": point["flights"] - int(random.binomial(point["flights"], failing))})
        agreed += abs(reference_interval(other, 0.0)[0] - boundary) <= WITHIN
    return agreed / references


def _enough_fly(points: list[dict[str, Any]]) -> bool:
    """Return True if the fraction of flyable flights at points reaches the target."""
    return sum(one["flyable"] for one in points) >= GOAL.target * sum(one["flights"] for one in points)


def _log_likelihood(points: list[dict[str, Any]]) -> NDArray[np.float64]:
    """Return the log-likelihood of the outcomes for each slope (rows) and boundary (columns) of the grids."""
    speeds, flights, flyable = (np.array([one[name] for one in points]) for name in ("speed", "flights", "flyable"))
    x = norm.isf(GOAL.target) + _SLOPES[:, None, None] * (speeds - _BOUNDARIES[:, None])
    out: NDArray[np.float64] = (flyable * norm.logsf(x) + (flights - flyable) * norm.logcdf(x)).sum(axis=-1)
    return out


def main() -> None:
    """Fly the points and store them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.campaigns.winds_reference")
    parser.add_argument("--directions", type=int, nargs="*", default=list(range(GOAL.directions)))
    parser.add_argument("--flights", type=int, default=1000, help="at each point, at most")
    parser.add_argument("--even", action="store_true", help=f"{SOBOL_FLIGHTS} low-discrepancy (Sobol) samples a point")
    parser.add_argument("--seed", type=int, default=_SEED, help=f"of the draws, another for another set ({_SEED})")
    parser.add_argument("--winds", type=Path, help="winds.json of a run of `planfly winds`; else they are found here")
    args = parser.parse_args()
    if args.winds is None:
        boundaries = [(one.estimate, one.is_beyond_search) for one in found_winds().boundaries]
    else:
        table = json.loads(args.winds.read_text(encoding="utf-8"))
        boundaries = [(float(one["boundary_mps"]), bool(one["beyond"])) for one in table["directions"]]
    base = demo(args.seed)
    drawn = {"draws": "even" if args.even else "independent", "seed": args.seed}
    kept = json.loads(REFERENCE.read_text(encoding="utf-8")) if REFERENCE.exists() else {}
    for direction in args.directions:
        points = kept.setdefault(str(direction), [])
        # Flights in a wind below the boundary and in one above it show that the boundary is right. A boundary beyond
        # the largest wind of the search has only a wind below it, and a lower one if too few flights were flyable
        # there.
        boundary, beyond = boundaries[direction]
        speeds = [round(max(0.0, boundary - WITHIN), 2)]
        below = [one for one in points if one["speed"] == speeds[0]]
        if not beyond:
            speeds.append(round(boundary + WITHIN, 2))
        elif below and not _enough_fly(below):
            speeds.append(speeds[0] - 2.0 * WITHIN)
        for speed in speeds:
            asked = {"speed": speed, **drawn}
            if any(asked.items() <= one.items() for one in points):
                continue
            wind = GivenWind(speed, 360.0 * direction / GOAL.directions)
            tally = sobol_share_at(base, wind) if args.even else share_at(base, wind, args.flights)
            points.append({**asked, "flights": tally.flown, "flyable": tally.flyable})
            points.sort(key=lambda one: (one["speed"], one["seed"]))
            print(direction, points, flush=True)
            REFERENCE.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
