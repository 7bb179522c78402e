"""The draw of a flight: its numbers come from the campaign's seed and its own index alone."""

from dataclasses import dataclass

import numpy as np

from planfly.campaigns.spread.quantities import QUANTITIES
from planfly.campaigns.spread.spread_file import FlightSpread


@dataclass(frozen=True, slots=True)
class Draw:
    """What flight `index` of a campaign has of its own.

    seed: of what changes within the flight: turbulence, and the error of navigation.
    values: by quantity, all of them; those that do not vary have their nominal value.
    """

    index: int
    seed: int
    values: dict[str, float]


def draw_flight(spread: FlightSpread, seed: int, index: int) -> Draw:
    r"""Draw a flight's numbers.

    seed: the campaign's.  The stream is ``SeedSequence(seed, spawn_key=(index,))``: no flight needs another's draw, so
    that any order, any number of workers and any part of a campaign give the same flights.

    >>> from planfly.campaigns.spread.spread_file import parse_spread
    >>> one = parse_spread('[mass]\ndistribution = "uniform"\nloc = 0.9\nscale = 0.2\nsource = "by hand"', "x")
    >>> first, again = draw_flight(one, 1, 7), draw_flight(one, 1, 7)
    >>> first == again, first.values["drag"], 0.9 < first.values["mass"] < 1.1
    (True, 1.0, True)
    """
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))
    uniform = random.random(len(QUANTITIES)).tolist()
    number = int(random.integers(2**63))
    varying = {one.quantity.name: one for one in spread.varying}
    values = {
        quantity.name: varying[quantity.name].value(share) if quantity.name in varying else quantity.nominal
        for quantity, share in zip(QUANTITIES, uniform, strict=True)
    }
    return Draw(index, number, values)
