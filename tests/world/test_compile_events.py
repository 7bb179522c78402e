"""Who asks is told before a kernel is compiled, and not once it is there."""

import numba
import pytest

import world.kernels  # noqa: F401  # whoever compiles has imported it
from world.compile_events import notify_before_compiling


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
