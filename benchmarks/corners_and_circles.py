"""Corners beyond 100 degrees and circles by ArduPlane's law against those that ArduPlane itself flew.

``python -m benchmarks.corners_and_circles`` flies the kept missions of `tests.flight.autopilots.arduplane` by the law,
and prints each corner's overshoot, each circle's radius (its greatest distance from the middle, where it is tighter
than the bank limit's) and how near its middle was come to: by the law, by ArduPlane, and their ratio.
"""

import math

import numpy as np

from tests.flight.autopilots.arduplane.kept_missions import CIRCLES, CORNERS, by_law, kept, middles

# A circle that is nearer to its middle somewhere than this share of its radius is not held about it.
_HELD = 0.8


def main() -> None:
    """Print the comparison, and of each kind the 5th, 50th and 95th percentile of the ratios."""
    ratios: dict[str, list[float]] = {"overshoot": [], "radius": [], "greatest distance": []}
    for flight in CORNERS:
        law, real = by_law(flight), kept(flight)
        for k in range(1, len(law.waypoints) - 1):
            _compare("overshoot", f"{flight} {k}", law.overshoot(k), real.overshoot(k), ratios)
    for flight in CIRCLES:
        law, real = by_law(flight), kept(flight)
        for middle in middles(flight):
            near = law.away(middle).min(), real.away(middle).min()
            wide = law.widest(middle), real.widest(middle)
            if min(near) > _HELD * min(wide):
                _compare("radius", flight, law.radius(middle), real.radius(middle), ratios)
            else:
                _compare("greatest distance", flight, *wide, ratios)
            print(f"  nearest to the middle: {near[0]:.1f} m by law, {near[1]:.1f} m by ArduPlane")
    for kind, found in ratios.items():
        low, median, high = np.percentile(found, (5.0, 50.0, 95.0))
        print(f"{kind}, law by ArduPlane: {len(found)}, 5 % {low:.3f}, median {median:.3f}, 95 % {high:.3f}")


def _compare(kind: str, name: str, law: float, real: float, ratios: dict[str, list[float]]) -> None:
    if not math.isfinite(law / real):
        # Left before its distance from the middle had settled.
        return
    ratios[kind].append(law / real)
    print(f"{name}: {kind} {law:.1f} m by law, {real:.1f} m by ArduPlane, {law / real:.3f}")


if __name__ == "__main__":
    main()
