"""`planfly winds` on the demo against flights at fixed winds, up to 1,000 of them at each.

``python -m benchmarks.campaigns.winds_reference [--directions K ...] [--flights N] [--even] [--seed N]`` flies the
demo in wind half a metre a second below and above each boundary that ``planfly winds jacksboro-air`` found, in other
weather and with other aircraft than that had, and adds the counts to ``tests/authorities/winds_reference.json``: some
minutes a point.  Where a direction has but one point, and there fewer fly than have to, it gets another a metre a
second below.

The draws of a point are independent of each other, or with ``--even`` spread evenly over what may be drawn (Sobol's
points, scrambled by Owen): each is drawn from the same distribution, and as many aircraft are slippery as are to be.
A point of independent draws ends early where its share of flyable flights is above or below the target with 99 %
confidence, valid at every number of flights.  One of Sobol samples does not end early.

The reference's own boundary is that of the likeliest normal law through a direction's points, and its interval that of
the likelihood ratio, with the law's slope free; Sobol samples count as if they were independent, which leaves the
interval wider than it has to be.  A boundary is right that lies within half a metre a second of it, and shown wrong if
it does of no wind in the interval.  A direction with a single wind has its boundary above that where all
fly that have to, and
below it where they do not.
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
from planfly.campaigns.find_winds import ASKED, WindsFound, WindsGoal, find_winds, open_winds_store
from planfly.campaigns.flight_requests import FlightRequest, FlyOne
from planfly.campaigns.flight_row import fly_one
from planfly.campaigns.statistics.decision import Estimator, Goal, Tally
from planfly.campaigns.worker_pool import Workers, worker_pool

REFERENCE = Path(__file__).parents[2] / "tests" / "authorities" / "winds_reference.json"
GOAL = WindsGoal(0.99, 0.95, 16, 20.0, 5000)
WITHIN = 0.5
# Laws of the reference: they begin to fail 1 - P there, m/s, and grow so steeply, 1/(m/s).
_BOUNDARIES, _SLOPES = np.arange(0.0, 30.0, 0.05), np.geomspace(0.02, 20.0, 120)
# Of the reference's draws, if no other is named; the boundaries are found with seed 1.
_SEED = 77


def demo(seed: int) -> CampaignBase:
    """The demo's plan of seed 1, with a spread but for the wind's mean; seed: of the draws."""
    base = open_campaign("jacksboro-air", default_dispersions().without(ASKED), {"seed": 1})
    return replace(base, seed=seed)


def share_at(base: CampaignBase, wind: GivenWind, most: int) -> Tally:
    """Fly independent draws at one wind until it is decided, or so many flights."""
    decide = Estimator(Goal(GOAL.target, True, most, 0.99))
    return _counted(base, wind, most, decide.decides, fly_one)


def sobol_share_at(base: CampaignBase, wind: GivenWind) -> Tally:
    """Fly a full set of Sobol samples at one wind."""
    return _counted(base, wind, SOBOL_FLIGHTS, lambda _: False, fly_sobol)


def _counted(base: CampaignBase, wind: GivenWind, most: int, ends: Callable[[Tally], bool], fly: FlyOne) -> Tally:
    indices, flown = iter(range(most)), Tally(0, 0, 0)

    def following() -> FlightRequest | None:
        index = None if ends(flown) else next(indices, None)
        return None if index is None else FlightRequest(index, wind)

    with worker_pool(Workers(2), base, fly) as pool:
        for one in pool.fly(following):
            good = one.row.outcome == "flyable"
            flown = Tally(flown.flyable + good, flown.failed + (not good), 0)
    return flown


def found_winds() -> WindsFound:
    """The boundaries as `planfly winds jacksboro-air --seed 1` finds them."""
    base = demo(1)
    with tempfile.TemporaryDirectory() as name, open_winds_store(base, GOAL, Path(name), resume=False) as store:
        return find_winds(base, GOAL, Workers(2), store)


def winds_row() -> dict[str, float]:
    """Flights that the boundaries take, and of the reference's directions those that are right within 0.5 m/s."""
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
    """Whether a boundary, m/s, is within half a metre a second of the reference's, or, of a confidence, may be."""
    low, high = reference_interval(points, confidence)
    return low - WITHIN <= boundary <= high + WITHIN


def reference_interval(points: list[dict[str, Any]], confidence: float) -> tuple[float, float]:
    """Of the reference's boundary, m/s; of confidence 0 the likeliest twice.

    >>> points = [{"speed": 8.0, "flights": 1000, "flyable": 995}, {"speed": 9.0, "flights": 1000, "flyable": 985}]
    >>> [round(one, 1) for one in reference_interval(points, 0.0)]
    [8.6, 8.6]
    """
    if len(speeds := {float(one["speed"]) for one in points}) == 1:
        speed = speeds.pop()
        return (speed, GOAL.most) if _enough_fly(points) else (0.0, speed - 0.05)
    likelihood = _likelihood(points).max(axis=0)
    likely = _BOUNDARIES[likelihood >= likelihood.max() - 0.5 * chi2.ppf(confidence, 1)]
    # Beyond the largest wind that is looked at all are the same.
    return min(float(likely[0]), GOAL.most), min(float(likely[-1]), GOAL.most)


def agreement(points: list[dict[str, Any]], references: int = 100) -> float:
    """How often another reference of as many flights would have its boundary within half a metre a second of this one.

    As often as chance has it where this one's likeliest law is the truth; one with a single wind is left out as sure.
    """
    if len({one["speed"] for one in points}) == 1:
        return 1.0
    likelihood = _likelihood(points)
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
    return sum(one["flyable"] for one in points) >= GOAL.target * sum(one["flights"] for one in points)


def _likelihood(points: list[dict[str, Any]]) -> NDArray[np.float64]:
    """(slopes, boundaries) its logarithm."""
    speeds, flights, flyable = (np.array([one[name] for one in points]) for name in ("speed", "flights", "flyable"))
    x = norm.isf(GOAL.target) + _SLOPES[:, None, None] * (speeds - _BOUNDARIES[:, None])
    out: NDArray[np.float64] = (flyable * norm.logsf(x) + (flights - flyable) * norm.logcdf(x)).sum(axis=-1)
    return out


def _winds_to_fly(boundary: float, beyond: bool, points: list[dict[str, Any]]) -> list[float]:
    """m/s, below and above a boundary; of one that is beyond what is looked at below it, and lower if it is wrong."""
    below = round(max(0.0, boundary - WITHIN), 2)
    if not beyond:
        return [below, round(boundary + WITHIN, 2)]
    there = [one for one in points if one["speed"] == below]
    return [below, below - 2.0 * WITHIN] if there and not _enough_fly(there) else [below]


def main() -> None:
    """Fly the points and keep them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.campaigns.winds_reference")
    parser.add_argument("--directions", type=int, nargs="*", default=list(range(GOAL.directions)))
    parser.add_argument("--flights", type=int, default=1000, help="at each point, at most")
    parser.add_argument("--even", action="store_true", help=f"{SOBOL_FLIGHTS} low-discrepancy (Sobol) samples a point")
    parser.add_argument("--seed", type=int, default=_SEED, help=f"of the draws, another for another set ({_SEED})")
    parser.add_argument("--winds", type=Path, help="winds.json of a run of `planfly winds`; else they are found here")
    args = parser.parse_args()
    if args.winds is None:
        boundaries = [(one.estimate, one.beyond) for one in found_winds().boundaries]
    else:
        table = json.loads(args.winds.read_text(encoding="utf-8"))
        boundaries = [(float(one["boundary_mps"]), bool(one["beyond"])) for one in table["directions"]]
    base = demo(args.seed)
    drawn = {"draws": "even" if args.even else "independent", "seed": args.seed}
    kept = json.loads(REFERENCE.read_text(encoding="utf-8")) if REFERENCE.exists() else {}
    for direction in args.directions:
        points = kept.setdefault(str(direction), [])
        for speed in _winds_to_fly(*boundaries[direction], points):
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
