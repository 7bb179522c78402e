"""Who asks is told before a kernel is compiled, and not once it is there."""

import numba
import pytest

import world.kernels  # noqa: F401  # whoever compiles has imported it
from world.compile_events import COMPILE_TIMER, CompileTimer, notify_before_compiling


def test_the_innermost_is_told_before_a_kernel_is_compiled() -> None:
    told: list[str] = []
    with notify_before_compiling(lambda: told.append("outer")):
        one, other = (numba.njit(lambda a, more=more: a + more) for more in (1, 2))
        with notify_before_compiling(lambda: told.append(f"inner {len(one.signatures)}")):
            assert [one(1), one(2)] == [2, 3]
        assert other(1) == 3
    assert told == ["inner 0", "outer"]
    assert numba.njit(lambda a: a)(1) == 1
    assert len(told) == 2


def test_what_is_raised_there_ends_the_compilation() -> None:
    """As Ctrl-C has it."""

    def interrupt() -> None:
        raise KeyboardInterrupt

    kernel = numba.njit(lambda a: a)
    with pytest.raises(KeyboardInterrupt), notify_before_compiling(interrupt):
        kernel(1)
    assert kernel(1) == 1


def test_the_time_of_nested_compilations_is_counted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [5.0]
    monkeypatch.setattr("world.compile_events.time.monotonic", lambda: now[0])
    timer = CompileTimer()
    for step in (timer.begin, timer.begin, timer.end, timer.end, timer.begin, timer.end):
        step()
        now[0] += 1.0
    # From 5 to 8 s and from 9 to 10 s.
    assert timer.seconds == 4.0


def test_kernels_that_are_compiled_are_timed_and_an_interrupted_one_too() -> None:
    def interrupt() -> None:
        raise KeyboardInterrupt

    before = COMPILE_TIMER.seconds
    with pytest.raises(KeyboardInterrupt), notify_before_compiling(interrupt):
        numba.njit(lambda a: a + 2)(1)
    kernel = numba.njit(lambda a: a + 3)
    between = COMPILE_TIMER.seconds
    assert before < between
    assert kernel(1) == 4
    compiled = COMPILE_TIMER.seconds
    assert between < compiled
    assert kernel(2) == 5
    assert compiled == COMPILE_TIMER.seconds
