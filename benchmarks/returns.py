"""Measure the judgement of returns and glides from all points of the demo, and test suggested rally points.

``python -m benchmarks.returns [--every S] [--fresh N] [--whole N]`` plans and flies the demo, and judges its returns
as `planfly returns` does: alone, with the glides, and with the search for rally points.  With the suggested points it
then returns from N places that the search has not used, with a point mass, and from N of them with the simulated
autopilot in JSBSim, and prints the lowest clearance and the nearest sphere.  Times are measured in the second pass,
without compilation and cold caches.
"""

import argparse
from collections.abc import Callable
from time import perf_counter
from typing import TypeVar

import numpy as np

import planfly
from logs.verdict.returns.drawn_returns import collect_drawn_returns
from logs.verdict.returns.judge_glides import judge_glides
from logs.verdict.returns.judge_returns import ReturnWorld, judge_returns, make_return_world
from logs.verdict.returns.return_starts import ReturnStarts, flown_starts
from logs.verdict.returns.returns_text import returns_headline
from logs.verdict.returns.suggest_returns import suggest_rally_points
from planfly.rtl.jsbsim_returns import fly_return

Result = TypeVar("Result")
# Seed of the fresh places.
_SEED = 35
# Interval of the places among which they are drawn, s.
_FINE_INTERVAL_S = 0.1


def timed(words: str, work: Callable[[], Result]) -> tuple[Result, float]:
    """Do a piece of work twice; print and return the time of the second pass."""
    work()
    begun = perf_counter()
    result = work()
    seconds = perf_counter() - begun
    print(f"{words:45s} {seconds:6.2f} s", flush=True)
    return result, seconds


def fresh_places(flown: planfly.FlownMission, every: float, count: int) -> ReturnStarts:
    """Return places of the flight that differ from those at intervals of ``every`` seconds."""
    starts = flown_starts(flown.setup, flown.track, _FINE_INTERVAL_S)
    off = np.abs((starts.time / every + 0.5) % 1.0 - 0.5) * every
    unseen = np.flatnonzero(off > 0.4 * every)
    chosen = np.random.default_rng(_SEED).choice(unseen, size=min(count, len(unseen)), replace=False)
    return starts.subset(np.sort(chosen))


def fly_fresh(world: ReturnWorld, starts: ReturnStarts, whole: int) -> None:
    """Fly returns from fresh places, and print the number of unsafe ones.

    whole: number of these returns that are also flown in JSBSim.
    """
    found = judge_returns(world, starts, 0.0)
    low = [one.clearance for one in found.each]
    outside = [one.sphere_distance for one in found.each]
    print(f"from {len(low)} fresh places by the model: {returns_headline(found)}")
    print(f"  below {world.limit:.0f} m: {sum(one < world.limit for one in low)}, least {min(low):.1f} m;", end=" ")
    print(f"inside a sphere: {sum(one <= 0.0 for one in outside)}, nearest {min(outside):.1f} m outside")
    rows = starts.rows[np.linspace(0, len(starts) - 1, whole).round().astype(int)] if whole else []
    flown = [one for one in (fly_return(world, row) for row in rows) if one is not None]
    if flown:
        least, nearest = min(one[0] for one in flown), min(one[1] for one in flown)
        print(f"from {len(flown)} of them in JSBSim: least {least:.1f} m, nearest {nearest:.1f} m outside a sphere")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.returns")
    parser.add_argument("--every", type=float, default=3.2, help="seconds between two returns (299 with 3.2)")
    parser.add_argument("--fresh", type=int, default=100, help="places that the search has not seen")
    parser.add_argument("--whole", type=int, default=20, help="of these, flown in JSBSim")
    args = parser.parse_args()
    flown = planfly.fly(planfly.plan("jacksboro-air", seed=1), wind=(5, 250))
    world, starts = make_return_world(flown.setup), flown_starts(flown.setup, flown.track, args.every)
    returns, alone = timed(
        f"{len(starts)} returns, the least sure in JSBSim", lambda: judge_returns(world, starts, args.every, fly_return)
    )
    glides, without = timed("glides from there", lambda: judge_glides(world, starts))
    _, drawn = timed(
        "what is drawn of them, but for the drawing", lambda: collect_drawn_returns(world, starts, returns, glides)
    )
    begun = perf_counter()
    rally = suggest_rally_points(world, starts)
    search = perf_counter() - begun
    print(f"{'the search for rally points, once':45s} {search:6.2f} s")
    print(
        f"returns {alone:.1f} s; with glides {alone + without:.1f} s; with the search {alone + search:.1f} s", end="; "
    )
    print(f"drawing needs {drawn:.1f} s more")
    print(f"{returns_headline(returns)}; {glides.count('home')} glide home, {glides.count('nothing')} nowhere")
    if rally is None or rally.rally is None:
        print("no rally points were found")
        return
    print(f"{len(rally.rally)} rally points suggested")
    fly_fresh(rally.apply_to(world), fresh_places(flown, args.every, args.fresh), args.whole)


if __name__ == "__main__":
    main()
