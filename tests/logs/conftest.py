"""The small flight that never happened, its track, and the log of it."""

from collections.abc import Callable
from pathlib import Path

import pytest

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from tests.logs.made_flight import make_setup, make_track, record


@pytest.fixture(scope="session")
def setup() -> FlightSetup:
    return make_setup()


@pytest.fixture(scope="session")
def track() -> Track:
    return make_track()


@pytest.fixture(scope="session")
def log_file(tmp_path_factory: pytest.TempPathFactory, setup: FlightSetup, track: Track) -> Path:
    return record(tmp_path_factory.mktemp("log") / "flight.mcap", setup, track)


@pytest.fixture
def recorded(tmp_path: Path, setup: FlightSetup) -> Callable[[Track], Path]:
    return lambda track: record(tmp_path / "made.mcap", setup, track)
