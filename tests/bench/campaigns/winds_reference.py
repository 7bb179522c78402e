"""`planfly winds` on the demo against flights at fixed winds, up to 1,000 of them at each.

``python -m tests.bench.campaigns.winds_reference [--directions K ...] [--flights N]`` flies the demo in wind half a
metre a second below and above each boundary that ``planfly winds jacksboro`` found, in other weather and with other
aircraft than that had, and adds the counts to ``tests/authorities/winds_reference.json``: some minutes a point.  A
point ends early where its share of flyable flights is above or below the target with 99 % confidence, valid at every
number of flights.  The boundary is right within half a metre a second where the share is at least the target below,
and at most the target above; where it is otherwise by no more than 1,000 flights may be off, that is said, too: at 95 %
by Clopper and Pearson's bound.
"""

import argparse
import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

from planfly.campaigns.engine.cluster import Workers
from planfly.campaigns.engine.flight_loop import Order, hired_pilots
from planfly.campaigns.find_winds import ASKED, WindsFound, WindsGoal, find_winds, open_winds_store
from planfly.campaigns.flights.campaign_base import CampaignBase, open_campaign
from planfly.campaigns.flights.varied_flight import GivenWind
from planfly.campaigns.spread.spread_file import default_spread
from planfly.campaigns.statistics.decision import Estimator, Goal
from planfly.campaigns.statistics.proportions import Tally, lower_bound, upper_bound
from planfly.campaigns.statistics.wind_boundary import WindBoundary

REFERENCE = Path(__file__).parents[2] / "authorities" / "winds_reference.json"
GOAL = WindsGoal(0.99, 0.95, 16, 20.0, 5000)
WITHIN = 0.5
# Of the reference's draws; the boundaries are found with seed 1.
_SEED = 77


def demo(seed: int) -> CampaignBase:
    """The demo's plan of seed 1, with a spread but for the wind's mean; seed: of the draws."""
    base = open_campaign("jacksboro", default_spread().without(ASKED), seed=1)
    return replace(base, seed=seed)


def share_at(base: CampaignBase, wind: GivenWind, most: int) -> Tally:
    """Fly at one wind until it is decided, or so many flights."""
    decide = Estimator(Goal(GOAL.target, True, most, 0.99))
    indices, flown = iter(range(most)), Tally(0, 0, 0)

    def following() -> Order | None:
        index = None if decide.decides(flown) else next(indices, None)
        return None if index is None else Order(index, wind)

    with hired_pilots(Workers(2), base) as pilots:
        for one in pilots.fly(following):
            good = one.row.outcome == "flyable"
            flown = Tally(flown.flyable + good, flown.failed + (not good), 0)
    return flown


def found_winds() -> WindsFound:
    """The boundaries as `planfly winds jacksboro --seed 1` finds them."""
    base = demo(1)
    with tempfile.TemporaryDirectory() as name, open_winds_store(base, GOAL, Path(name), resume=False) as store:
        return find_winds(base, GOAL, Workers(2), store)


def winds_row() -> dict[str, float]:
    """Flights that the boundaries take, and of the reference's directions those that are right within 0.5 m/s."""
    found = found_winds()
    kept = json.loads(REFERENCE.read_text(encoding="utf-8")) if REFERENCE.exists() else {}
    pairs = [(found.boundaries[int(direction)], points) for direction, points in kept.items()]
    return {
        "winds of the demo, 16 directions: flights": len(found.flights),
        "winds: directions with a reference": len(kept),
        "winds: of these right within 0.5 m/s": sum(_is_right(one, points, 0.0) for one, points in pairs),
        "winds: of these not shown wrong at 95 %": sum(_is_right(one, points, 0.95) for one, points in pairs),
    }


def _is_right(boundary: WindBoundary, points: list[dict[str, Any]], confidence: float) -> bool:
    """Whether no point further than half a metre a second from a boundary contradicts it.

    confidence: with which a point does; 0 for by its share alone.
    Above a boundary beyond all that was looked at nothing does.
    """
    for point in points:
        tally = Tally(point["flyable"], point["flights"] - point["flyable"], 0)
        most = upper_bound(tally, confidence) if confidence else tally.share
        least = lower_bound(tally, confidence) if confidence else tally.share
        if point["speed"] <= boundary.estimate - WITHIN + 0.05 and most < GOAL.target:
            return False
        if point["speed"] >= boundary.estimate + WITHIN - 0.05 and least > GOAL.target and not boundary.beyond:
            return False
    return True


def main() -> None:
    """Fly the points and keep them."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.campaigns.winds_reference")
    parser.add_argument("--directions", type=int, nargs="*", default=list(range(GOAL.directions)))
    parser.add_argument("--flights", type=int, default=1000, help="at each point, at most")
    parser.add_argument("--winds", type=Path, help="winds.json of a run of `planfly winds`; else they are found here")
    args = parser.parse_args()
    if args.winds is None:
        boundaries = [(one.estimate, one.beyond) for one in found_winds().boundaries]
    else:
        table = json.loads(args.winds.read_text(encoding="utf-8"))
        boundaries = [(float(one["boundary_mps"]), bool(one["beyond"])) for one in table["directions"]]
    base = demo(_SEED)
    kept = json.loads(REFERENCE.read_text(encoding="utf-8")) if REFERENCE.exists() else {}
    for direction in args.directions:
        points = {float(point["speed"]): point for point in kept.get(str(direction), [])}
        boundary, beyond = boundaries[direction]
        for speed in (boundary - WITHIN,) if beyond else (boundary - WITHIN, boundary + WITHIN):
            speed = round(max(0.0, speed), 2)
            if speed in points:
                continue
            tally = share_at(base, GivenWind(speed, 360.0 * direction / GOAL.directions), args.flights)
            points[speed] = {"speed": speed, "flights": tally.flown, "flyable": tally.flyable}
            print(direction, points[speed], flush=True)
        kept[str(direction)] = [points[speed] for speed in sorted(points)]
        REFERENCE.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
