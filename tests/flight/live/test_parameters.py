"""Parameters: read by number or name, and only PFLY_FORCE can be set, within its range."""

import math

import pytest

from flight.live.parameters import FORCE, Parameters, vehicle_parameters


@pytest.fixture
def parameters() -> Parameters:
    return vehicle_parameters(airspeed=25.0, slowest=18.0, fastest=31.0, max_bank_deg=30.0, system=1, speed=2.0)


def test_each_is_found_by_number_and_by_name(parameters: Parameters) -> None:
    names = [entry.name for entry in parameters.entries]
    assert names == sorted(names)
    for number, name in enumerate(names):
        assert parameters.find(name.encode() + b"\0" * (16 - len(name)), -1) == number
        assert parameters.find(b"", number) == number
        message = parameters.message(number)
        assert (message.param_index, message.param_count) == (number, len(names))
    assert parameters.find(b"NO_SUCH", -1) is None
    assert parameters.find(b"", len(names)) is None


@pytest.mark.parametrize("value", [-1.0, 2.0, math.nan, math.inf])
def test_a_value_out_of_range_is_refused(parameters: Parameters, value: float) -> None:
    number, problem = parameters.set(FORCE.encode(), value)
    assert number is not None
    assert "allowed 0..1" in problem
    assert parameters[FORCE] == 0.0


def test_only_force_can_be_set(parameters: Parameters) -> None:
    for entry in list(parameters.entries):
        _, problem = parameters.set(entry.name.encode(), 1.0)
        assert bool(problem) == (entry.name != FORCE)
    assert parameters[FORCE] == 1.0
    assert parameters.set(b"NO_SUCH", 1.0) == (None, "NO_SUCH: no such parameter")
