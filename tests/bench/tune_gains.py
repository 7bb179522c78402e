"""Choose an aircraft's gains by coordinate search on one set of missions, and report on another.

``python -m tests.bench.tune_gains [ROUNDS]`` prints each improvement and, at the end, the chosen gains and how they fly
missions, winds and mismatches that the search has not seen.  It writes no file: put the numbers into ``gains.toml``.
"""

import sys
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from flight.fdm import Variation
from flight.gains import Gains, load_gains
from flight.setup import FlightSetup
from flight.simulate import simulate
from tests.bench.flight import Errors, aerosonde, errors_of, flown_with, maker

NAMES = (
    *("cross_track_frequency", "cross_track_damping", "cross_track_integral", "turn_lead", "turn_smoothing"),
    *("side_gain", "side_lag", "roll_gain", "roll_rate_gain", "aileron_per_roll_rate", "yaw_rate_gain"),
    *("height_frequency", "height_damping", "height_integral", "slope_lead", "pitch_rate_gain"),
    *("speed_gain", "speed_integral"),
)
# What the search flies, and what the report flies: seeds of missions, and of their winds.
TUNED_ON, REPORTED_ON = range(100, 106), range(200, 212)
# Flown too, in both: gains near the edge of stability show in them.
VARIATIONS = (
    None,
    Variation(control=0.75),
    Variation(control=1.25),
    Variation(mass=0.9),
    Variation(mass=1.1, drag=1.3),
)
FIRST_STEP = 1.35
# What a figure counts as one: the limits in wind.
SCALES = (0.15, 1.0, 0.3, 1.0)
FAILED = 1000.0


def mission(seed: int) -> FlightSetup:
    """Seven legs with turns and slopes of their own, every third in calm air."""
    random = np.random.default_rng(seed)
    way, course = [np.array([0.0, 0.0, 500.0])], random.uniform(0.0, 6.0)
    for leg in range(7):
        run, slope = random.uniform(700.0, 1500.0), np.radians(random.uniform(-4.0, 4.5))
        course += random.uniform(-0.8, 0.8) if leg else 0.0
        way.append(way[-1] + run * np.array([np.sin(course), np.cos(course), np.tan(slope)]))
    if seed % 3 == 0:
        return maker()(np.array(way), seed=seed)
    wind = (float(random.uniform(4.0, 10.0)), float(random.uniform(0.0, 360.0)))
    return maker()(np.array(way), wind=wind, turbulence="moderate", seed=seed)


def fly(gains: Gains, seeds: Iterable[int]) -> list[Errors]:
    """Fly each mission once, the variations in turn."""
    with flown_with(gains):
        return [
            errors_of(simulate(mission(seed), aerosonde(), variation=VARIATIONS[seed % len(VARIATIONS)]))
            for seed in seeds
        ]


def cost(found: Iterable[Errors]) -> float:
    """Mean of all errors in units of their limits, the largest counted twice; `FAILED` for a flight that fails."""
    costs = []
    for item in found:
        if not item.completed:
            return FAILED
        values = (item.cross_rms, item.cross_max, item.height_rms, item.height_max)
        costs.append(sum(value / scale for value, scale in zip(values, SCALES, strict=True)))
    return float(np.mean(costs) + np.max(costs))


def search(gains: Gains, rounds: int) -> Gains:
    """Change one gain at a time by a factor that shrinks where neither way helps."""
    best, lowest = gains, cost(fly(gains, TUNED_ON))
    print(f"start {lowest:.4f}", flush=True)
    steps = dict.fromkeys(NAMES, FIRST_STEP)
    for _ in range(rounds):
        for name in NAMES:
            tried = [replace(best, **{name: getattr(best, name) * factor}) for factor in (steps[name], 1 / steps[name])]
            costs = [cost(fly(candidate, TUNED_ON)) for candidate in tried]
            k = int(np.argmin(costs))
            if costs[k] < 0.999 * lowest:
                best, lowest = tried[k], costs[k]
                print(f"{name} = {getattr(best, name):.4g}: {lowest:.4f}", flush=True)
            else:
                steps[name] = 1.0 + 0.5 * (steps[name] - 1.0)
    return best


def main() -> None:
    gains = search(load_gains(aerosonde()), int(sys.argv[1]) if len(sys.argv) > 1 else 2)
    found = fly(gains, REPORTED_ON)
    print(gains)
    print(f"on {len(REPORTED_ON)} other missions: cost {cost(found):.4f}")
    for seed, item in zip(REPORTED_ON, found, strict=True):
        print(f"  {seed}: {item}")


if __name__ == "__main__":
    main()
