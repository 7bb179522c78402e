"""Memory of the process that leads a campaign.

``python -m benchmarks.campaigns.client_memory FLIGHTS`` leads a campaign of the demo, but of made-up flights, each row
as large as a real one's, to its report, and prints its largest resident size in MB.
"""

import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from planfly.campaigns.campaign_base import CampaignBase, GivenWind, open_campaign
from planfly.campaigns.dispersions import default_dispersions
from planfly.campaigns.flight_row import STATION_COUNT, FlightRow
from planfly.campaigns.fly_campaign import fly_campaign, open_store
from planfly.campaigns.report import finish_campaign
from planfly.campaigns.statistics.decision import Goal
from planfly.campaigns.worker_pool import Workers
from tests.planfly.campaigns.made_campaigns import made_flight

# Waypoints whose crossings a row of the demo holds.
_WAYPOINTS = 14


def large_flight(base: CampaignBase, index: int, wind: GivenWind | None = None) -> FlightRow:
    """Return a synthetic flight row as large as a real one, with duration 0, so that no log is flown."""
    row = made_flight(base, index, wind)
    random = np.random.default_rng(index)
    clearance = random.uniform(50.0, 300.0, STATION_COUNT).astype(np.float32)
    crossings = random.normal(0.0, 3.0, (_WAYPOINTS, 2)).astype(np.float32)
    return replace(row, duration=0.0, clearance=clearance.tobytes(), crossings=crossings.tobytes())


def lead(flights: int, folder: Path) -> None:
    """Run a campaign with a number of synthetic flights, including its report."""
    base = open_campaign("jacksboro-air", default_dispersions(), {"seed": 1})
    goal = Goal(None, False, flights, 0.95)
    with open_store(base, goal, folder, resume=False) as store:
        estimate = fly_campaign(base, goal, Workers(1), store, fly=large_flight)
    finish_campaign(base, goal, estimate, folder, "planfly campaign")


def client_memory(flights: int) -> float:
    """Return the largest resident size of a client for a number of flights, MB."""
    command = [sys.executable, "-m", "benchmarks.campaigns.client_memory", str(flights)]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()[-1])


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        lead(int(sys.argv[1]), Path(name))
    # The largest size of this process alone; getrusage returns at least the size of the process that started it.
    status = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    print(next(int(line.split()[1]) / 1024.0 for line in status if line.startswith("VmHWM")))
