"""Tune L1 and the vector field for straight legs, as best they can: what `tests.bench.flight` compares ours with.

``python -m tests.bench.tune_rivals`` searches each law's own settings, one at a time, for the least RMS on the standard
mission's straight legs in 10 m/s and moderate turbulence, with the aircraft's inner loops.  It is told the mission that
it is compared on, which ours is not; only the winds are others.
"""

from dataclasses import replace
from typing import Any, cast

import numpy as np

from flight.gains import Gains, load_gains
from flight.simulate import simulate
from tests.bench.flight import BEST_FIELD, BEST_L1, aerosonde, errors_of, flown_with, straight_rms, windy

WINDS = range(500, 504)
FAILED = 1000.0
ROUNDS = 6


def cost(law: str, gains: Gains) -> float:
    """Mean RMS on the straight legs, m; `FAILED` for a flight that does not arrive or swings 60 m off."""
    found = []
    with flown_with(gains):
        for seed in WINDS:
            setup = replace(windy(seed), guidance=cast("Any", law))
            flown = simulate(setup, aerosonde())
            errors = errors_of(flown)
            found.append(straight_rms(setup, flown) if errors.completed and errors.cross_max < 60.0 else FAILED)
    return float(np.mean(found))


def tune(law: str, settings: dict[str, float]) -> tuple[dict[str, float], float]:
    """Coordinate search from these settings, rounded to two digits."""
    gains, best = load_gains(aerosonde()), dict(settings)
    lowest = cost(law, replace(gains, **best))
    steps = dict.fromkeys(best, 1.4)
    for _ in range(ROUNDS):
        for name in best:
            for factor in (steps[name], 1.0 / steps[name]):
                tried = best | {name: float(f"{best[name] * factor:.2g}")}
                found = cost(law, replace(gains, **tried))
                if found < 0.999 * lowest:
                    best, lowest = tried, found
                    break
            else:
                steps[name] = 1.0 + 0.5 * (steps[name] - 1.0)
    return best, lowest


def main() -> None:
    """Print what is best for each."""
    for law, settings in (("l1", BEST_L1), ("vector-field", BEST_FIELD)):
        best, lowest = tune(law, settings)
        print(f"{law}: {best}, RMS {lowest:.4f} m", flush=True)


if __name__ == "__main__":
    main()
