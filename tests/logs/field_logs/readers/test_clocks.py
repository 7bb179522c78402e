import numpy as np

from logs.field_logs.readers.clocks import BEHIND, ROWS_BEHIND, steady_clock


def test_a_clock_that_goes_on_stays_as_it_is() -> None:
    time = np.arange(0.0, 10.0, 0.1)
    assert np.array_equal(steady_clock(time).time, time)
    assert steady_clock(time).jumps == ()


def test_one_row_fewer_than_a_jump_takes_is_late() -> None:
    """Just inside and just outside of the number of rows that stay behind."""
    before, after = np.arange(100.0, 120.0), np.arange(121.0, 140.0)
    late = np.concatenate([before, 50.0 + np.arange(ROWS_BEHIND - 1), after])
    assert steady_clock(late).jumps == ()
    gone = np.concatenate([before, 50.0 + np.arange(ROWS_BEHIND), after])
    assert steady_clock(gone).jumps == (119.0,)


def test_less_than_a_second_back_is_no_jump() -> None:
    before = np.arange(0.0, 20.0, 0.5)
    for back, count in ((BEHIND - 0.01, 0), (BEHIND + 0.01, 1)):
        after = before[-1] - back + np.zeros(20)
        assert len(steady_clock(np.concatenate([before, after])).jumps) == count


def test_two_restarts_are_two_jumps() -> None:
    flight = np.arange(5.0, 25.0)
    found = steady_clock(np.concatenate([flight, flight, flight]), usual=1.0)
    assert found.time.tolist() == np.arange(5.0, 65.0).tolist()
    assert found.jumps == (24.0, 44.0)
