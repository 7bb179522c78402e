"""The draw of a flight: its numbers come from the campaign's seed and its own index alone."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planfly.campaigns.spread.spread_file import QUANTITIES, FlightSpread

Floats = NDArray[np.float64]

# Shares of a distribution whose values give its mean and standard deviation.
_MIDDLES = 4096


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
    uniform, number = _drawn(seed, index)
    varying = {one.quantity.name: one for one in spread.varying}
    values = {
        quantity.name: varying[quantity.name].value(share) if quantity.name in varying else quantity.nominal
        for quantity, share in zip(QUANTITIES, uniform.tolist(), strict=True)
    }
    return Draw(index, number, values)


def standard_draws(spread: FlightSpread, seed: int, start: int, stop: int) -> Floats:
    """(stop - start, d) what varies, as `draw_flight` draws it for these flights, in standard deviations from the mean.

    d: of a spread's varying quantities those that have more than one value.

    >>> from planfly.campaigns.spread.spread_file import default_spread
    >>> standard_draws(default_spread(), 1, 5, 7).shape
    (2, 11)
    """
    uniform = np.array([_drawn(seed, index)[0] for index in range(start, stop)]).reshape(-1, len(QUANTITIES))
    columns = [QUANTITIES.index(one.quantity) for one in spread.varying]
    return _standardised(spread, uniform[:, columns])


def standard_population(spread: FlightSpread, count: int) -> Floats:
    """(count, d) points that cover evenly what may be drawn, as `standard_draws` has it; count: a power of two.

    The points are Sobol's, each in the middle of its cell.

    >>> from planfly.campaigns.spread.spread_file import default_spread
    >>> bool(abs(standard_population(default_spread(), 1024).mean(axis=0)).max() < 0.01)
    True
    """
    from scipy.stats import qmc

    quantities = len(spread.varying)
    shares = qmc.Sobol(quantities, scramble=False).random(count) if quantities else np.zeros((count, 0))
    return _standardised(spread, shares + 0.5 / count)


def _drawn(seed: int, index: int) -> tuple[Floats, int]:
    """Of each of `QUANTITIES` the share of its distribution, and the seed of what changes within the flight."""
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))
    return random.random(len(QUANTITIES)), int(random.integers(2**63))


def _standardised(spread: FlightSpread, shares: Floats) -> Floats:
    """(n, d) of shares (n, v) of each varying quantity's distribution."""
    middles = (np.arange(_MIDDLES) + 0.5) / _MIDDLES
    columns = []
    for k, one in enumerate(spread.varying):
        values = one.values(middles)
        if (deviation := float(values.std())) > 0.0:
            columns.append((one.values(shares[:, k]) - values.mean()) / deviation)
    return np.column_stack(columns) if columns else np.zeros((len(shares), 0))
