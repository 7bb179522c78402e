"""Flights of a campaign whose draws are spread evenly over what may be drawn.

Each draw is of the spread's own distribution, but of all of them as many have little drag, much mass and so on as are
to be: Sobol's points, scrambled (Owen, "Randomly permuted (t,m,s)-nets and (t,s)-sequences", in Monte Carlo and
Quasi-Monte Carlo Methods, 1995).  The error of a share that the draws decide falls faster than with independent ones.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from planfly.campaigns.flights.campaign_base import CampaignBase, GivenWind, vary
from planfly.campaigns.flights.flight_row import FlightRow
from planfly.campaigns.spread.draws import Draw
from planfly.campaigns.spread.spread_file import QUANTITIES, FlightSpread
from planfly.pipeline import fly_and_judge

# Flights of a set: a power of two, for which Sobol's points are balanced.
EVEN_FLIGHTS = 1024


@lru_cache
def _shares(quantities: int, seed: int) -> NDArray[np.float64]:
    """(EVEN_FLIGHTS, quantities) of each quantity's distribution, 0 to 1."""
    out: NDArray[np.float64] = qmc.Sobol(quantities, scramble=True, seed=seed).random(EVEN_FLIGHTS)
    return out


def even_draw(spread: FlightSpread, seed: int, index: int) -> Draw:
    """A flight's draw; index: from 0 to before EVEN_FLIGHTS."""
    shares = dict(zip(spread.varying, _shares(len(spread.varying), seed)[index].tolist(), strict=True))
    drawn = {one.quantity: one.value(share) for one, share in shares.items()}
    gusts = int(np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,))).integers(2**63))
    return Draw(index, gusts, {one.name: drawn.get(one, one.nominal) for one in QUANTITIES})


def fly_even(base: CampaignBase, index: int, wind: GivenWind | None = None) -> FlightRow:
    """Fly one of them by its index; wind: mean wind in the scenario's place."""
    draw = even_draw(base.spread, base.seed, index)
    varied = vary(base, draw, wind)
    flown = fly_and_judge(varied.setup, varied.airframe, None, off_nominal=varied.off_nominal, reference=False)
    return FlightRow(draw, "flyable" if flown.verdict.flyable else "not flyable", flown.ended)
