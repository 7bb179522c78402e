"""An identified aircraft that holds no level flight is refused, with the reason."""

from types import SimpleNamespace
from typing import Any

import pytest

from aircraft.catalog import load_aircraft
from aircraft.identification.parameters import prior_means
from planfly.identification.base_numbers import base_model
from planfly.identification.folder import _check_level_flight_at_cruise
from world.errors import LogError


def _identified(cruise: float) -> Any:
    """Return what the check reads of an Ultra Stick that is identified at a cruise airspeed, m/s."""
    return SimpleNamespace(
        cruise=cruise,
        numbers=base_model(load_aircraft("ultrastick25e")),
        estimate=SimpleNamespace(values=prior_means()),
        logs=[SimpleNamespace(source="a.BIN")],
    )


@pytest.mark.parametrize("cruise", [5.0, 60.0])
def test_an_aircraft_without_level_flight_is_refused(cruise: float) -> None:
    """At 5 m/s the wing carries no 1.96 kg (a lift coefficient of 4.2), and at 60 m/s no motor holds its drag."""
    with pytest.raises(LogError, match=rf"a\.BIN: .*cannot fly level at {cruise}") as refused:
        _check_level_flight_at_cruise(_identified(cruise), load_aircraft("ultrastick25e"))
    assert "\n" not in str(refused.value)


def test_an_aircraft_with_level_flight_passes() -> None:
    _check_level_flight_at_cruise(_identified(17.0), load_aircraft("ultrastick25e"))
