"""Define the flights that a campaign requests, and the campaign's copy on each worker.

The workers are checked.
"""

import hashlib
import pickle
import platform
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from importlib import metadata, resources
from pathlib import Path
from typing import NamedTuple

from aircraft.catalog import find_aircraft, model_hash
from planfly._version import __version__
from planfly.campaigns.campaign_base import CampaignBase, GivenWind
from planfly.campaigns.flight_row import FlightRow, fly_one
from world.errors import PlanflyError

# Function that flies the flight with an index in a given wind, or in the base's wind; most campaigns use `fly_one`.
FlyOne = Callable[[CampaignBase, int, GivenWind | None], FlightRow]

# Reason for the end of a flight that could not be flown.
LOST_REASON = "lost: its workers died"
# Number of workers that may die on one flight before the flight is lost; the first deaths may have another cause.
MAX_WORKER_DEATHS = 3


@dataclass(frozen=True, slots=True)
class FlightRequest:
    """Requested flight.

    index: index of the flight, which determines its draw.
    wind: mean wind that replaces the scenario's wind; None for the scenario's wind.
    """

    index: int
    wind: GivenWind | None = None


class FinishedFlight(NamedTuple):
    """Request with the row of its flight."""

    request: FlightRequest
    row: FlightRow


# ----------------------------------------------------------------------
# Refuse workers whose software differs from that of the campaign.

# Packages whose version may change a flight in its last bits.
_PACKAGES = ("jsbsim", "numba", "numpy", "scipy")
# Top-level packages of planfly, whose sources are hashed.
_OWN_PACKAGES = ("aircraft", "flight", "logs", "planfly", "planner", "world")


class WorkerError(PlanflyError):
    """Raised if a worker does not have the software or model of the campaign."""


@cache
def code_hash() -> str:
    """Return a hash of planfly's sources as installed on this machine."""
    digest = hashlib.sha256()
    for package in _OWN_PACKAGES:
        root = Path(str(resources.files(package)))
        for file in sorted(root.rglob("*.py")):
            digest.update(str(file.relative_to(root)).encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def fingerprint(aircraft: str) -> dict[str, str]:
    """Return the software versions and hashes that determine a flight on this machine, keyed by name.

    aircraft: name of the aircraft.  If it cannot be loaded, "model" is "none: " and the reason instead of a hash.

    >>> sorted(fingerprint("aerosonde"))
    ['jsbsim', 'model', 'numba', 'numpy', 'planfly', 'python', 'scipy', 'sources']
    """
    try:
        model = model_hash(find_aircraft(aircraft))
    except PlanflyError as error:
        model = f"none: {error}"
    return {
        "planfly": __version__,
        "sources": code_hash(),
        "model": model,
        "python": ".".join(platform.python_version_tuple()[:2]),
        **{name: metadata.version(name) for name in _PACKAGES},
    }


def check_fingerprint(own_fingerprint: dict[str, str], worker_fingerprint: dict[str, str], worker: str) -> None:
    """Raise WorkerError if the fingerprint of a worker differs from this process's fingerprint.

    The message names the worker and the first difference.

    >>> check_fingerprint({"planfly": "0.1.0"}, {"planfly": "0.0.9"}, "tls://10.0.0.7:4000")
    Traceback (most recent call last):
    ...
    planfly.campaigns.flight_requests.WorkerError: worker tls://10.0.0.7:4000: planfly 0.0.9, expected 0.1.0 ...
    """
    for name, value in own_fingerprint.items():
        if worker_fingerprint.get(name) != value:
            worker_value, allowed = worker_fingerprint.get(name), f"expected {value} as in this process"
            message = f"worker {worker}: {name} {worker_value or 'missing'}, {allowed}"
            raise WorkerError(message, file=f"worker {worker}", field=name, value=worker_value, allowed=allowed)


class CampaignCopy:
    """Pickled campaign; each worker unpickles it once, after a check of its own software.

    own_fingerprint: `fingerprint` of the process that leads the campaign.
    fly: function that flies one flight of the campaign.
    """

    def __init__(self, base: CampaignBase, own_fingerprint: dict[str, str], fly: FlyOne = fly_one) -> None:
        self._packed = pickle.dumps((base, fly))
        self._aircraft = base.scenario.flight.aircraft
        self._own_fingerprint = own_fingerprint
        self._unpacked: tuple[CampaignBase, FlyOne] | None = None

    def fly(self, request: FlightRequest, worker: str) -> FlightRow:
        """Fly the requested flight on this worker, and return its row with the worker's name.

        worker: name of this worker.
        Raises WorkerError if this worker's software differs.
        """
        base, fly = self.unpack(worker)
        return replace(fly(base, request.index, request.wind), worker=worker)

    def unpack(self, worker: str) -> tuple[CampaignBase, FlyOne]:
        """Return the campaign's base and the function that flies a flight; unpickle them at the first call.

        worker: name of this worker for the message of an error.
        Raises WorkerError if this worker's software differs.
        """
        if self._unpacked is None:
            check_fingerprint(self._own_fingerprint, fingerprint(self._aircraft), worker)
            base, fly = pickle.loads(self._packed)
            # The same model, from its folder on this machine.
            uav = replace(base.uav, aircraft=find_aircraft(self._aircraft))
            self._unpacked = replace(base, uav=uav), fly
        return self._unpacked
