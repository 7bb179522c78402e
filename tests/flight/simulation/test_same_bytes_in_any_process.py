"""The same scenario and seed give the same track, byte for byte, in any process: forked, spawned, or started anew.

`test_simulate.py` has a process started anew with another order of hashes.
"""

import ctypes.util
import hashlib
import multiprocessing
import warnings
from pathlib import Path
from typing import Any, cast

import jsbsim
import pytest

from aircraft.catalog import load_aircraft
from flight.dynamics import nodes
from flight.dynamics.fdm import JSBSIM_VERSION, Fdm
from flight.simulation.flight_setup import FlightSetup
from flight.simulation.simulate import simulate
from flight.simulation.track import COLUMNS
from tests.setups import MakeSetup, standard


def fly(setup: FlightSetup) -> str:
    """A digest of all columns of the track."""
    track = simulate(setup, load_aircraft(setup.aircraft)).track
    return hashlib.sha256(b"".join(getattr(track, name).tobytes() for name in COLUMNS)).hexdigest()


@pytest.mark.parametrize("method", ["fork", "spawn"])
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


def test_both_ways_to_jsbsim_give_the_same_bytes(make_setup: MakeSetup, monkeypatch: pytest.MonkeyPatch) -> None:
    for setup in (
        make_setup(standard()[:3], wind=(7.0, 30.0), turbulence="moderate"),
        make_setup(standard()[:2], terrain={"kind": "none"}),
    ):
        compiled = fly(setup)
        with monkeypatch.context() as patch:
            patch.setattr(nodes, "KNOWN", {})
            assert fly(setup) == compiled


def test_another_build_of_jsbsim_is_gone_through_python(monkeypatch: pytest.MonkeyPatch) -> None:
    library = Path(cast("Any", jsbsim)._jsbsim.__file__)
    fdm = Fdm(load_aircraft("aerosonde"))
    ours = [fdm._node("position/h-sl-ft"), None]
    version = JSBSIM_VERSION
    found = nodes.addresses(ours, version, library)
    assert found is not None
    assert found[0] != 0
    assert found[1] == 0
    assert nodes.addresses(ours, "0.0.0", library) is None
    size, where = nodes.KNOWN[version]
    # Another size, another place in it, another library, another machine.
    for known in ((size + 8, where), (size, where - 8)):
        monkeypatch.setattr(nodes, "KNOWN", {version: known})
        assert nodes.addresses(ours, version, library) is None
    monkeypatch.setattr(nodes, "KNOWN", {version: (size, where)})
    assert nodes.addresses(ours, version, Path(ctypes.util.find_library("m") or "")) is None
    monkeypatch.setattr(nodes.sys, "platform", "elsewhere")
    assert nodes.addresses(ours, version, library) is None
