"""The law's memory begins as nothing flown."""

import numpy as np

from flight.ardupilot.law_memory import ARDUPILOT_MEMORY
from world.kernels import Record, field_names


def test_a_fresh_memory_is_on_the_first_leg_and_has_flown_nothing() -> None:
    fresh: Record = np.zeros(1, ARDUPILOT_MEMORY)[0]
    assert (fresh.leg, bool(fresh.begun), bool(fresh.flown), bool(fresh.on_circle)) == (0, False, False, False)


def test_counts_are_whole_and_all_else_are_numbers() -> None:
    kinds = {name: ARDUPILOT_MEMORY[name] for name in field_names(ARDUPILOT_MEMORY)}
    assert {name for name, kind in kinds.items() if kind == np.int64} == {"leg", "held"}
    assert {name for name, kind in kinds.items() if kind == np.bool_} == {"begun", "flown", "on_circle"}
    assert all(kind == np.float64 for kind in kinds.values() if kind not in (np.int64, np.bool_))
