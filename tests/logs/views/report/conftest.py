"""A flight to compare the recorded one with."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.reader import FlightLog, read_log
from tests.logs.made_flight import make_setup, record


@pytest.fixture
def other(tmp_path: Path, setup: FlightSetup, track: Track) -> FlightLog:
    """Half a second longer at its end, 10 m further north, with more energy."""
    position = track.position + np.array([0.0, 10.0, 0.0])
    energy = track.energy * 2
    time = track.time.copy()
    time[-1] += 0.5
    changed = replace(track, position=position, energy=energy, time=time)
    wind = make_setup(wind={"speed_mps": 0.0, "from_deg": 0.0})
    return read_log(record(tmp_path / "other.mcap", wind, changed))
