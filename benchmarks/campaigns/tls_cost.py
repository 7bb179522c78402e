"""What TLS between a campaign's client, scheduler and workers costs, as flights a minute without it over those with it.

``python -m benchmarks.campaigns.tls_cost [ROUNDS] [FLIGHTS]``.  Both are flown in each round, in turn first, so that a
machine that is not idle slows both.
"""

import statistics
import sys
import tempfile
from pathlib import Path
from typing import Any
from unittest import mock

from planfly.campaigns import worker_pool
from planfly.campaigns.campaign_base import CampaignBase

ROUNDS, FLIGHTS = 9, 60
# Of workers at a time.
_WORKERS = 2


def tls_cost(base: CampaignBase, rounds: int = ROUNDS, flights: int = FLIGHTS) -> dict[str, Any]:
    """The median ratio of all rounds, and the least and the largest."""
    # Imported here: the rows of campaigns import this.
    from benchmarks.campaigns.campaign_rows import flights_a_minute

    def rate(*, private: bool) -> float:
        if private:
            return flights_a_minute(base, _WORKERS, flights)
        with mock.patch.object(worker_pool, "private_security", return_value=None):
            return flights_a_minute(base, _WORKERS, flights)

    ratios = []
    for number in range(rounds):
        rates = {private: rate(private=private) for private in ((True, False) if number % 2 else (False, True))}
        ratios.append(rates[False] / rates[True])
        print(
            f"  round {number + 1}: {rates[False]:.0f} flights a minute without TLS, {rates[True]:.0f} with", flush=True
        )
    return {
        "flights a minute without TLS / with it": statistics.median(ratios),
        "  least of all rounds": min(ratios),
        "  largest of all rounds": max(ratios),
    }


def main() -> None:
    """Measure, and print a line each."""
    from benchmarks.campaigns.campaign_rows import mission_13_km

    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else ROUNDS
    flights = int(sys.argv[2]) if len(sys.argv) > 2 else FLIGHTS
    with tempfile.TemporaryDirectory() as folder:
        for label, value in tls_cost(mission_13_km(Path(folder)), rounds, flights).items():
            print(f"  {label:<52}{value:10.4g}")


if __name__ == "__main__":
    main()
