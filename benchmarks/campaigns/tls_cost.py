"""Measure the cost of TLS between a campaign's client, scheduler and workers, in flights a minute and CPU time.

``python -m benchmarks.campaigns.tls_cost [ROUNDS] [FLIGHTS]``.  Campaigns with and without TLS alternate in one run.
Other programs affect the flights a minute of a round, but hardly the CPU time of a flight.
"""

import statistics
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import psutil

from planfly.campaigns import worker_pool
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.worker_pool import FlightRequest, Workers

# Number of rounds.
ROUNDS = 9
# Number of flights of a campaign.
FLIGHTS = 60
# Number of workers.
_WORKERS = 2


class Flown(NamedTuple):
    """Flights a minute, and CPU time of client, scheduler and workers per flight, s."""

    a_minute: float
    cpu: float


def _cpu() -> float:
    """Return the CPU time of this process and its children, s."""
    processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
    return sum(sum(one.cpu_times()[:2]) for one in processes)


def fly(base: CampaignBase, flights: int) -> Flown:
    """Fly some flights, and measure from the first result of each worker on."""
    requests: Iterator[FlightRequest] = (FlightRequest(index) for index in range(flights))
    began = cpu = 0.0
    with worker_pool.worker_pool(Workers(_WORKERS), base) as pool:
        for number, _ in enumerate(pool.fly(lambda: next(requests, None)), 1):
            if number == _WORKERS:
                began, cpu = time.perf_counter(), _cpu()
        seconds, cpu = time.perf_counter() - began, _cpu() - cpu
    return Flown(60.0 * (flights - _WORKERS) / seconds, cpu / (flights - _WORKERS))


def tls_cost(base: CampaignBase, rounds: int = ROUNDS, flights: int = FLIGHTS) -> dict[str, Any]:
    """Return the median ratios of all rounds."""
    rates, cpus = [], []
    for number in range(rounds):
        flown: dict[bool, Flown] = {}
        for private in (True, False) if number % 2 else (False, True):
            plain = mock.patch.object(worker_pool, "private_security", return_value=None)
            if private:
                flown[True] = fly(base, flights)
            else:
                with plain:
                    flown[False] = fly(base, flights)
        without, with_it = flown[False], flown[True]
        rates.append(without.a_minute / with_it.a_minute)
        cpus.append(with_it.cpu / without.cpu)
        print(f"  round {number + 1}: without TLS {without}, with {with_it}", flush=True)
    return {
        "flights a minute without TLS / with it": statistics.median(rates),
        "processor time of a flight with TLS / without it": statistics.median(cpus),
    }


def main() -> None:
    """Measure, and print a line for each figure."""
    # Imported here: the rows of campaigns import this.
    from benchmarks.campaigns.campaign_rows import mission_13_km

    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else ROUNDS
    flights = int(sys.argv[2]) if len(sys.argv) > 2 else FLIGHTS
    with tempfile.TemporaryDirectory() as folder:
        for label, value in tls_cost(mission_13_km(Path(folder)), rounds, flights).items():
            print(f"  {label:<52}{value:10.4g}")


if __name__ == "__main__":
    main()
