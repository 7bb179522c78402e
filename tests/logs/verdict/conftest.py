"""A route with three turns and four legs, and a clean flight of it."""

import pytest

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from tests.logs.verdict.judging import ROUTE
from tests.synthetic import fly_path, make_setup


@pytest.fixture(scope="session")
def setup() -> FlightSetup:
    return make_setup(ROUTE)


@pytest.fixture(scope="session")
def track(setup: FlightSetup) -> Track:
    return fly_path(setup)
