"""The Aerosonde, and setups of its flights over made ground."""

import pytest

from aircraft.catalog import Aircraft, load_aircraft
from tests.setups import MakeSetup, setup_maker


@pytest.fixture(scope="session")
def aerosonde() -> Aircraft:
    return load_aircraft("aerosonde")


@pytest.fixture(scope="session")
def make_setup(aerosonde: Aircraft) -> MakeSetup:
    """See `setup_maker`."""
    return setup_maker(aerosonde)
