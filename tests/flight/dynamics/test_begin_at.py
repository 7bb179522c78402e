"""A flight begun in a given state goes on from it."""

import numpy as np
import pytest

from aircraft.catalog import load_aircraft
from flight.dynamics.fdm import Fdm


def test_a_flight_begun_in_its_own_state_goes_on_as_it_would_have() -> None:
    """Half a second of flight from a state that was flown through, by two instances."""
    aircraft = load_aircraft("aerosonde")
    first, second = Fdm(aircraft), Fdm(aircraft)
    trim = first.start(45.0, 0.0, 500.0, 0.3, 25.0)
    commands = [trim.elevator + 0.05, trim.aileron + 0.05, trim.rudder, trim.throttle]
    first.write(commands)
    first.step(120)
    state = first.read()
    second.start_untrimmed(
        attitude=(state.roll, state.pitch, state.yaw),
        velocity=(state.velocity_north, state.velocity_east, state.velocity_down),
        rates=(state.roll_rate, state.pitch_rate, state.yaw_rate),
        wind=(0.0, 0.0, 0.0),
        amsl=float(state.amsl),
        commands=[state.elevator, state.aileron, state.rudder, state.throttle],
    )
    second.write(commands)
    for fdm in (first, second):
        fdm.step(60)
    one, other = first.read(), second.read()
    for field in ("roll", "pitch", "airspeed", "roll_rate", "pitch_rate"):
        assert other[field] == pytest.approx(one[field], abs=2e-3 * max(1.0, abs(float(one[field])))), field
    assert np.isfinite(other.amsl)
