"""What a worker of dask holds of a campaign, and how it flies one of its flights.

dask asks for a class of its own, which is why this is a module of its own: nothing else of a campaign imports dask.
"""

import contextlib
import pickle
import signal
import threading
from dataclasses import replace
from typing import Any

from distributed import WorkerPlugin, get_worker

from aircraft.catalog import find_aircraft
from planfly.campaigns.campaign_base import CampaignBase, GivenWind
from planfly.campaigns.flight_row import FlightRow, fly_one
from planfly.campaigns.worker_pool import FlyOne, fingerprint, refuse_different


class CampaignPlugin(WorkerPlugin):
    """A campaign on a worker: on each, also on one that comes late or takes a dead one's place.

    name: of the campaign on its scheduler.
    """

    def __init__(self, name: str, base: CampaignBase, mine: dict[str, str], fly: FlyOne = fly_one) -> None:
        self.name = name
        self._packed = pickle.dumps((base, fly))
        self._aircraft = base.scenario.flight.aircraft
        self._mine = mine
        self._ready: tuple[CampaignBase, FlyOne] | None = None

    def setup(self, worker: Any) -> None:
        """Leave Ctrl-C on a terminal to the client, which ends its workers."""
        if threading.current_thread() is threading.main_thread():
            with contextlib.suppress(ValueError):
                signal.signal(signal.SIGINT, signal.SIG_IGN)

    def ready(self, worker: str) -> tuple[CampaignBase, FlyOne]:
        """The campaign, unpacked once.  Raises WorkerError for a worker that flies otherwise than the client would."""
        if self._ready is None:
            refuse_different(self._mine, fingerprint(self._aircraft), worker)
            base, fly = pickle.loads(self._packed)
            # The same model, wherever this machine has it.
            airframe = replace(base.airframe, aircraft=find_aircraft(self._aircraft))
            self._ready = replace(base, airframe=airframe), fly
        return self._ready


def fly_task(campaign: str, index: int, wind: GivenWind | None) -> FlightRow:
    """Fly a flight on the worker that this runs on."""
    worker = get_worker()
    plugin = worker.plugins[campaign]
    if not isinstance(plugin, CampaignPlugin):
        raise TypeError(f"{campaign} is no campaign of this worker")
    base, fly = plugin.ready(worker.address)
    return replace(fly(base, index, wind), worker=worker.address)
