"""A vehicle on a link whose other end is the test."""

from collections.abc import Iterator

import pytest

from tests.flight.live.fake_vehicle import FakeVehicle


@pytest.fixture
def fake() -> Iterator[FakeVehicle]:
    made = FakeVehicle()
    yield made
    made.close()
