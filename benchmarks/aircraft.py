"""Compare the aircraft's trim and modes with the book, and predicted limits with flown ones.

``python -m benchmarks.aircraft`` prints these rows only; `run` is for ``make bench``.
"""

import math
from typing import Any

import numpy as np

from aircraft.catalog import load_aircraft
from benchmarks.limits import Limit, calm_limits, wind_limits
from flight.dynamics.fdm import Fdm, Variation
from flight.dynamics.trim import linearise, steady_flight
from tests.aircraft import beard_mclain as reference

# Aerosonde without parasite drag, as in the published trim.
CLEAN = Variation(parasite_drag=0.0)
# Trim that the book publishes: angles in rad, throttle 0 to 1.
PUBLISHED_TRIM = {"elevator": -0.125112, "aileron": 0.001837, "throttle": 0.676780}
# Constants of the roll and pitch transfer functions that the book publishes.
PUBLISHED_CONSTANTS = np.array([22.62885, 130.88368, 5.29474, -36.11239])


def against_the_book() -> dict[str, float]:
    """Compare trims and modes with the book (Beard and McLain), over a flat planet.

    Returns the worst relative error of trims and modes against the book's equations, and of the published trim and
    constants.
    """
    aerosonde = load_aircraft("aerosonde")
    world = reference.BookAtmosphere()
    trims, modes = [], []
    for airspeed in (19.0, 22.0, 25.0, 28.0, 31.0):
        for climb in (-0.05, 0.0, 0.05):
            states, commands = reference.book_trim(airspeed, climb, world)
            if not 0.0 < commands[3] < 1.0:
                continue
            fdm = Fdm(aerosonde, flat_earth=True)
            found = steady_flight(fdm, airspeed, 100.0, climb)
            if found is None:
                trims.append(math.inf)
                continue
            expected = np.array([math.atan2(states[2], states[0]), *commands])
            trims.append(np.abs((np.array([found.alpha, *found.commands()]) - expected) / expected).max())
            roots, book = (
                np.sort_complex(np.linalg.eigvals(a))
                for a in (linearise(fdm, found)[0], reference.book_linearise(states, commands, world)[0])
            )
            modes.append(np.abs((roots - book) / book).max())
    clean = steady_flight(Fdm(aerosonde, flat_earth=True, variation=CLEAN), 25.0, 100.0)
    published = math.inf
    if clean is not None:
        published = max(abs(getattr(clean, name) / value - 1.0) for name, value in PUBLISHED_TRIM.items())
    fdm = Fdm(aerosonde, flat_earth=True)
    level = steady_flight(fdm, 25.0, 100.0)
    constants = math.inf
    if level is not None:
        a, b = linearise(fdm, level)
        got = np.array([-a[3, 3], b[3, 1], -a[4, 4], b[4, 0]])
        constants = float(np.abs(got / PUBLISHED_CONSTANTS - 1.0).max())
    return {
        "trim against the book's equations": float(max(trims)),
        "modes against the book's equations": float(max(modes)),
        "published trim (no parasite drag)": published,
        "published transfer-function constants": constants,
    }


# Largest allowed relative error of each row.
MUST = {
    "trim against the book's equations": 5e-4,
    "modes against the book's equations": 1e-3,
    "published trim (no parasite drag)": 1e-3,
    "published transfer-function constants": 2e-4,
}


def limit_line(limit: Limit) -> str:
    """Return a row with the predicted and the flown limit."""
    wind = f"{limit.wind:.0f} m/s from {math.degrees(limit.wind_from):4.0f}" if limit.wind else "calm"
    factor, unit = (1.0, "m") if limit.kind == "leg" else (180.0 / math.pi, "deg")
    predicted, flown = factor * limit.predicted, factor * limit.flown
    kind = limit.kind if limit.kind != "leg" else "leg, same direction" if limit.same_way else "leg, S-turn"
    return (
        f"{kind:<20}{wind:<20} predicted {predicted:7.2f}, flown {flown:7.2f} {unit:<4}"
        f" optimistic by {factor * limit.optimistic:+6.2f}, conservative {100.0 * limit.conservative:+5.1f} %"
    )


def report(*, whole: bool = True) -> dict[str, float]:
    """Print the rows and return their figures by name, for the benchmark's record."""
    figures = against_the_book()
    print("the aircraft against the book, flat planet that does not turn (worst relative error)")
    for name, value in figures.items():
        print(f"  {name:<48}{100.0 * value:9.5f} %  (must {100.0 * MUST[name]:g} %)")
    print("limits: the envelope's prediction and the flight's, Aerosonde at 25 m/s from 800 m AMSL")
    calm, windy = calm_limits(whole=whole), wind_limits(whole=whole)
    for limit in (*calm, *windy):
        print(f"  {limit_line(limit)}")
    slopes = [math.degrees(abs(limit.optimistic)) for limit in calm if limit.kind != "leg"]
    legs = [abs(limit.optimistic) for limit in calm if limit.kind == "leg"]
    figures["calm: worst slope difference, deg"] = max(slopes)
    figures["calm: worst leg difference, m"] = max(legs)
    figures["wind: most optimistic slope, deg"] = max(math.degrees(x.optimistic) for x in windy if x.kind != "leg")
    figures["wind: most optimistic leg, m"] = max(x.optimistic for x in windy if x.kind == "leg")
    figures["wind: most conservative, share"] = max(x.conservative for x in windy)
    return figures


def run() -> dict[str, Any]:
    """Measure everything, print a table, and return it."""
    print()
    return dict(report())


if __name__ == "__main__":
    report()
