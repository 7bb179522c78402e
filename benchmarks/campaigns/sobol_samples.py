"""Flights of a campaign by low-discrepancy (Sobol) samples.

Each draw is of the dispersions' own distributions, but together they cover what may be drawn evenly: Sobol's points,
scrambled (Owen, "Randomly permuted (t,m,s)-nets and (t,s)-sequences", in Monte Carlo and Quasi-Monte Carlo Methods,
1995).  The error of a share that the draws decide falls faster than with random samples.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from planfly.campaigns.campaign_base import CampaignBase, GivenWind, vary_flight
from planfly.campaigns.dispersions import QUANTITIES, Dispersions, Draw
from planfly.campaigns.flight_row import FlightRow
from planfly.workflow.pipeline import FlightTask, fly_and_judge

# Flights of a set: a power of two, for which Sobol's points are balanced.
SOBOL_FLIGHTS = 1024


@lru_cache
def _shares(quantities: int, seed: int) -> NDArray[np.float64]:
    """Return the quantile (0 to 1) of each quantity for each flight, (SOBOL_FLIGHTS, quantities)."""
    out: NDArray[np.float64] = qmc.Sobol(quantities, scramble=True, seed=seed).random(SOBOL_FLIGHTS)
    return out


def sobol_draw(dispersions: Dispersions, seed: int, index: int) -> Draw:
    """Return the draw of a flight, whose varying quantities are a Sobol sample.

    index: number of the flight, from 0 to SOBOL_FLIGHTS - 1.
    """
    shares = dict(zip(dispersions.varying, _shares(len(dispersions.varying), seed)[index].tolist(), strict=True))
    drawn = {one.quantity: one.value(share) for one, share in shares.items()}
    gusts = int(np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,))).integers(2**63))
    return Draw(index, gusts, {one.name: drawn.get(one, one.nominal) for one in QUANTITIES})


def fly_sobol(base: CampaignBase, index: int, wind: GivenWind | None = None) -> FlightRow:
    """Fly one Sobol sample by its index; wind: mean wind instead of the scenario's wind."""
    draw = sobol_draw(base.dispersions, base.seed, index)
    varied = vary_flight(base, draw, wind)
    flown = fly_and_judge(varied.setup, FlightTask(off_nominal=varied.off_nominal, reference="never"))
    return FlightRow(draw, "flyable" if flown.verdict.flyable else "not flyable", flown.ended)
