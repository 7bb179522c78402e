"""Compare corners beyond 100 degrees and loiters of ArduPlane's model with the flights of ArduPlane itself.

``python -m benchmarks.corners_and_circles`` flies the stored missions of `tests.flight.autopilots.arduplane` with the
model, and prints the overshoot of each corner, and the radius of each loiter (its largest distance from the centre, if
it is tighter than the bank limit allows) and its smallest distance: of the model, of ArduPlane, and their ratio.
"""

import math

import numpy as np

from tests.flight.autopilots.arduplane.kept_missions import CIRCLES, CORNERS, by_law, kept, middles

# Smallest distance from the centre of a held loiter, as a fraction of its radius.
_MIN_RADIUS_FRACTION = 0.8


def main() -> None:
    """Print the comparison, and the 5th, 50th and 95th percentile of the ratios of each kind."""
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
            if min(near) > _MIN_RADIUS_FRACTION * min(wide):
                _compare("radius", flight, law.radius(middle), real.radius(middle), ratios)
            else:
                _compare("greatest distance", flight, *wide, ratios)
            print(f"  nearest to the middle: {near[0]:.1f} m by the model, {near[1]:.1f} m by ArduPlane")
    for kind, found in ratios.items():
        low, median, high = np.percentile(found, (5.0, 50.0, 95.0))
        print(f"{kind}, model / ArduPlane: {len(found)}, 5 % {low:.3f}, median {median:.3f}, 95 % {high:.3f}")


def _compare(kind: str, name: str, law: float, real: float, ratios: dict[str, list[float]]) -> None:
    """Print the value of the model, of the real autopilot, and their ratio, and store the ratio."""
    if not math.isfinite(law / real):
        # The loiter was left before its distance from the centre had settled.
        return
    ratios[kind].append(law / real)
    print(f"{name}: {kind} {law:.1f} m by the model, {real:.1f} m by ArduPlane, {law / real:.3f}")


if __name__ == "__main__":
    main()
