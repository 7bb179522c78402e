"""Guidance's memory begins as nothing flown, and each law that a scenario may name has a number of its own."""

from typing import get_args

import numpy as np

from flight.guidance.guidance_memory import ARDUPILOT, CROSS_TRACK, GUIDANCE_MEMORY, L1, VECTOR_FIELD
from flight.simulation.simulate import LAWS
from world.kernels import Record, field_names
from world.scenario_tables import FlightTable
from world.scenario_types import Guidance


def test_every_law_of_a_scenario_has_its_number() -> None:
    assert set(LAWS) == set(get_args(Guidance))
    assert sorted(LAWS.values()) == sorted({CROSS_TRACK, L1, VECTOR_FIELD})
    assert (LAWS["l1"], LAWS["vector-field"]) == (L1, VECTOR_FIELD)
    assert ARDUPILOT not in LAWS.values()


def test_a_fresh_memory_steers_by_the_default_law_from_the_paths_beginning() -> None:
    memory: Record = np.zeros(1, GUIDANCE_MEMORY)[0]
    assert memory.law == LAWS[FlightTable().steering.guidance]
    assert (memory.piece, memory.leg, memory.distance, bool(memory.done)) == (0, 0, 0.0, False)


def test_counts_are_whole_and_an_end_is_a_truth() -> None:
    kinds = {name: GUIDANCE_MEMORY[name] for name in field_names(GUIDANCE_MEMORY)}
    whole = {name for name, kind in kinds.items() if kind == np.int64}
    assert whole == {"law", "piece", "leg", "l1_leg"}
    assert {name for name, kind in kinds.items() if kind == np.bool_} == {"done"}
    assert all(kind == np.float64 for name, kind in kinds.items() if name not in whole | {"done"})
