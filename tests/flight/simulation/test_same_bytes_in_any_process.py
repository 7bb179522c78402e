"""The same scenario and seed give the same track, byte for byte, in any process: forked, spawned, or started anew.

`test_simulate.py` has a process started anew with another order of hashes.
"""

import hashlib
import multiprocessing
import warnings

import pytest

from aircraft.catalog import load_aircraft
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, fly_to_end
from flight.simulation.track import COLUMNS
from tests.setups import MakeSetup, standard
from tests.soak import only_in_soak, some


def fly(setup: FlightSetup) -> str:
    """A digest of all columns of the track."""
    track = fly_to_end(Flight(setup, load_aircraft(setup.aircraft))).track
    return hashlib.sha256(b"".join(getattr(track, name).tobytes() for name in COLUMNS)).hexdigest()


@only_in_soak
@pytest.mark.parametrize("method", some(["spawn", "fork"], 2))
def test_two_processes_at_once_give_the_same_bytes(make_setup: MakeSetup, method: str) -> None:
    setups = [make_setup(standard()[:3], wind=(7.0, 30.0), turbulence="moderate", seed=seed) for seed in (5, 6)]
    here = [fly(setup) for setup in setups]
    assert here[0] != here[1]
    with warnings.catch_warnings():
        # From Python 3.12 on a fork of a process with threads warns; the child here only computes.
        warnings.simplefilter("ignore", DeprecationWarning)
        with multiprocessing.get_context(method).Pool(2) as pool:
            there = pool.map(fly, setups, chunksize=1)
            again = pool.map(fly, setups[::-1], chunksize=1)
    assert there == here
    assert again == here[::-1]
