"""The state and the commands are plain rows of numbers, whose order JSBSim's readings and setters follow."""

import numpy as np
import pytest

from flight.dynamics.state import COMMANDS, STATE, Commands
from world.kernels import Record, field_names


@pytest.mark.parametrize("dtype", [STATE, COMMANDS])
def test_a_record_is_as_many_floats_as_it_has_fields(dtype: np.dtype[np.record]) -> None:
    # `Fdm.read` and the loop fill it as a row of floats.
    names = field_names(dtype)
    assert dtype.itemsize == 8 * len(names)
    record: Record = np.arange(float(len(names))).view(dtype)[0]
    assert [record[name] for name in names] == list(range(len(names)))


def test_commands_have_one_order_in_python_and_in_compiled_code() -> None:
    assert Commands(1.0, 2.0, 3.0, 4.0) == Commands(elevator=1.0, aileron=2.0, rudder=3.0, throttle=4.0)
    record: Record = np.zeros(1, COMMANDS)[0]
    for name, value in Commands(1.0, 2.0, 3.0, 4.0)._asdict().items():
        record[name] = value
    assert record.tolist() == (1.0, 2.0, 3.0, 4.0)


def test_the_state_has_a_reading_of_each_command_in_their_order() -> None:
    names = field_names(STATE)
    first = names.index("elevator")
    assert names[first : first + 4] == Commands._fields
    assert len(set(names)) == len(names)
