"""A clock that stands still while its process does, and goes on from there."""

from tests.flight.live.fake_vehicle import Clock
from world.running_clock import MAX_STEP_S, RunningClock


def test_it_keeps_time_while_it_is_asked_and_leaves_out_a_sleep() -> None:
    real = Clock()
    real.now = 5e6
    clock = RunningClock(real)
    for k in range(1, 101):
        real.now = 5e6 + 0.9 * MAX_STEP_S * k
        assert abs(clock() - 0.9 * MAX_STEP_S * k) < 1e-6
    before = clock()
    # A night, and the moment before it.
    real.now += 8 * 3600.0
    assert clock() == before + MAX_STEP_S
    real.now += 0.25
    assert clock() == before + MAX_STEP_S + 0.25


def test_it_never_goes_back() -> None:
    real = Clock()
    clock = RunningClock(real)
    real.now = 0.5
    assert clock() == 0.5
    real.now = -3600.0
    assert clock() == 0.5
    real.now = -3599.5
    assert clock() == 1.0
