"""The loop reads each property once, ticks, sets each property once, and then steps, in this order."""

from collections.abc import Callable

import numpy as np
import pytest

from flight.simulation.loop import make_loop
from flight.simulation.workspace import OUTPUT, READ_FIELDS, Workspace
from tests.flight.simulation.hand_made import make_workspace
from world.kernels import field_names

OUTPUTS = field_names(OUTPUT)


class Recorded:
    """A JSBSim of lists: what was called, in order, and what was set."""

    def __init__(self, statuses: list[int], steps: int) -> None:
        self.space: Workspace = make_workspace()
        self.calls: list[str] = []
        self.set: list[tuple[str, float]] = []
        self.seen: list[list[float]] = []
        self.statuses = statuses
        self.round = 0
        self.fly = make_loop(
            [self._getter(k, name) for k, name in enumerate(READ_FIELDS)],
            [self._setter(name) for name in OUTPUTS],
            self._tick,
            self.space,
            lambda: self.calls.append("run"),
            steps,
        )

    def _getter(self, k: int, name: str) -> Callable[[], float]:
        def get() -> float:
            self.calls.append(f"get {name}")
            return 1000.0 * self.round + k

        return get

    def _setter(self, name: str) -> Callable[[float], object]:
        def put(value: float) -> None:
            self.calls.append(f"set {name}")
            self.set.append((name, value))

        return put

    def _tick(self) -> int:
        self.calls.append("tick")
        self.seen.append([self.space.record.state[name] for name in READ_FIELDS])
        self.space.output[:] = 10.0 * self.round + np.arange(len(OUTPUTS))
        self.round += 1
        return self.statuses.pop(0)


def test_a_round_reads_ticks_sets_and_runs() -> None:
    flown = Recorded([0, 0], steps=3)
    assert flown.fly(2) == 0
    a_round = [*(f"get {name}" for name in READ_FIELDS), "tick", *(f"set {name}" for name in OUTPUTS), *["run"] * 3]
    assert flown.calls == 2 * a_round


def test_each_reading_and_each_output_is_the_one_of_its_name() -> None:
    flown = Recorded([0, 0], steps=1)
    flown.fly(2)
    assert flown.seen == [list(range(22)), list(range(1000, 1022))]
    assert flown.set == [(name, 10.0 * turn + k) for turn in range(2) for k, name in enumerate(OUTPUTS)]


@pytest.mark.parametrize("status", [1, 5])
def test_the_end_of_a_flight_sets_and_steps_nothing_more(status: int) -> None:
    flown = Recorded([0, status, 0], steps=2)
    assert flown.fly(3) == status
    assert flown.calls.count("tick") == 2
    assert flown.calls[-1] == "tick"
    assert flown.calls.count("run") == 2
    assert len(flown.set) == len(OUTPUTS)


def test_no_rounds_do_nothing() -> None:
    flown = Recorded([], steps=2)
    assert flown.fly(0) == 0
    assert flown.calls == []
