import numpy as np
import pytest

from flight.simulation.setup import Gap
from logs.importers.clean_positions import (
    DEGREE_LENGTH_M,
    MAX_CLOCK_LAG_S,
    MIN_LATE_ROWS,
    clean_positions,
    find_gaps,
    measure_steps,
    remove_clock_jumps,
)
from logs.importers.raw_log import LogSeries


def test_a_clock_that_goes_on_stays_as_it_is() -> None:
    time = np.arange(0.0, 10.0, 0.1)
    assert np.array_equal(remove_clock_jumps(time).time, time)
    assert remove_clock_jumps(time).jumps == ()


def test_one_row_fewer_than_a_jump_takes_is_late() -> None:
    """Just inside and just outside of the number of rows that stay behind."""
    before, after = np.arange(100.0, 120.0), np.arange(121.0, 140.0)
    late = np.concatenate([before, 50.0 + np.arange(MIN_LATE_ROWS - 1), after])
    assert remove_clock_jumps(late).jumps == ()
    gone = np.concatenate([before, 50.0 + np.arange(MIN_LATE_ROWS), after])
    assert remove_clock_jumps(gone).jumps == (119.0,)


def test_less_than_a_second_back_is_no_jump() -> None:
    before = np.arange(0.0, 20.0, 0.5)
    for back, count in ((MAX_CLOCK_LAG_S - 0.01, 0), (MAX_CLOCK_LAG_S + 0.01, 1)):
        after = before[-1] - back + np.zeros(20)
        assert len(remove_clock_jumps(np.concatenate([before, after])).jumps) == count


def test_two_restarts_are_two_jumps() -> None:
    flight = np.arange(5.0, 25.0)
    found = remove_clock_jumps(np.concatenate([flight, flight, flight]), usual_step=1.0)
    assert found.time.tolist() == np.arange(5.0, 65.0).tolist()
    assert found.jumps == (24.0, 44.0)


def north(time: np.ndarray, speed: float = 25.0, lon: float = 8.0) -> LogSeries:
    """A flight to the north."""
    return LogSeries(
        "POS", time, np.column_stack([46.0 + speed * time / DEGREE_LENGTH_M, np.full(time.size, lon), time * 0.0])
    )


TIME = np.arange(0.0, 60.0, 0.2)


def test_a_flight_in_order_stays_as_it_is() -> None:
    found = clean_positions(north(TIME))
    assert np.array_equal(found.time, TIME)
    assert (found.faults.doubled, found.faults.unordered, found.faults.glitches, found.gaps) == (0, 0, 0, ())


@pytest.mark.parametrize(("pause", "count"), [(1.0, 0), (1.01, 1)])
def test_a_pause_over_a_second_is_a_gap(pause: float, count: int) -> None:
    time = np.concatenate([TIME, TIME + TIME[-1] + pause])
    assert len(find_gaps(time)) == count


def test_of_rare_rows_a_pause_is_longer() -> None:
    """A logger of one fix in four seconds has no gap at each."""
    time = np.arange(0.0, 400.0, 4.0)
    assert find_gaps(time) == ()
    assert find_gaps(np.delete(time, [50, 51])) == (Gap(196.0, 208.0),)


def test_doubled_late_and_unusable_rows_are_counted() -> None:
    series = north(TIME)
    time, values = series.time.copy(), series.values.copy()
    order = np.arange(time.size)
    order[[100, 101]] = [101, 100]
    time, values = np.insert(time[order], 50, time[50]), np.insert(values[order], 50, values[50], axis=0)
    values[200] = [0.0, 0.0, 0.0]
    values[210, 0] = np.nan
    values[220, 0] = 95.0
    found = clean_positions(LogSeries("POS", time, values))
    assert (found.faults.doubled, found.faults.unordered, found.faults.unusable) == (1, 1, 3)
    assert (np.diff(found.time) > 0.0).all()


@pytest.mark.parametrize("rows", [1, 5])
def test_places_that_nobody_can_have_been_at_are_left_out(rows: int) -> None:
    series = north(TIME)
    values = series.values.copy()
    values[100 : 100 + rows, 1] += 0.05  # 3.9 km to the east
    found = clean_positions(LogSeries("POS", TIME, values))
    assert found.faults.glitches == rows
    assert found.lon.max() == 8.0


def test_a_height_that_leaps_and_comes_back_is_a_glitch() -> None:
    series = north(TIME)
    values = series.values.copy()
    values[100, 2] = 3000.0
    assert clean_positions(LogSeries("POS", TIME, values)).faults.glitches == 1


def test_a_new_place_for_good_is_no_glitch() -> None:
    series = north(TIME)
    values = series.values.copy()
    values[100:, 1] += 0.05
    assert clean_positions(LogSeries("POS", TIME, values)).faults.glitches == 0


def test_a_jump_of_the_clock_is_taken_out_and_a_gap_is_not() -> None:
    """In both the times lack 100 s; only in the second the aircraft went on meanwhile."""
    jumped = np.where(TIME >= 30.0, TIME + 100.0, TIME)
    values = north(TIME).values
    found = clean_positions(LogSeries("POS", jumped, values))
    assert found.gaps == ()
    assert found.faults.clock_jumps == (130.0,)
    assert found.time[-1] == pytest.approx(TIME[-1])
    assert found.to_steady_clock(np.array([10.0, 140.0])).tolist() == pytest.approx([10.0, 40.0])
    gone_on = clean_positions(north(jumped))
    assert len(gone_on.gaps) == 1
    assert gone_on.faults.clock_jumps == ()


def test_distances_across_the_180th_meridian_are_short() -> None:
    assert measure_steps(np.zeros(2), np.array([179.9995, -179.9995]))[0] == pytest.approx(0.001 * DEGREE_LENGTH_M)
    lat = np.array([-33.0, -33.0])
    assert measure_steps(lat, np.array([-70.0, -70.001]))[0] == pytest.approx(
        0.001 * DEGREE_LENGTH_M * np.cos(np.radians(33))
    )


def test_a_single_row_that_is_missing_at_one_a_second_is_a_gap() -> None:
    time = np.arange(0.0, 30.0)
    assert find_gaps(time) == ()
    assert find_gaps(np.delete(time, 10)) == (Gap(9.0, 11.0),)
    # Rows that come now and then by four tenths late are none.
    late = time + np.where(time % 5.0 == 0.0, 0.4, 0.0)
    assert find_gaps(late) == ()


def every_20_metres(time: np.ndarray) -> LogSeries:
    """A flight to the north, whatever its clock says."""
    lat = 46.0 + 20.0 * np.arange(time.size) / DEGREE_LENGTH_M
    return LogSeries("POS", time, np.column_stack([lat, np.full(time.size, 8.0), np.zeros(time.size)]))


@pytest.mark.parametrize("at", [0, 1, 30, 199])
@pytest.mark.parametrize("wrong", [-4.5e8, -20.0, 2.1e8, 9.9e8])
def test_a_few_rows_whose_times_are_damaged_cost_these_rows_alone(at: int, wrong: float) -> None:
    time = np.arange(200.0) + 100.0
    time[at] = wrong
    found = clean_positions(every_20_metres(time))
    assert found.time.tolist() == [100.0 + k for k in range(200) if k != at]
    assert found.faults.unusable == 1
    assert found.shifts == ()


def test_a_clock_that_was_set_in_flight_is_set_back() -> None:
    """As many rows before as after: their times are no damage."""
    time = np.concatenate([100.0 + np.arange(50.0), 5e8 + np.arange(50.0)])
    found = clean_positions(every_20_metres(time))
    assert np.diff(found.time).tolist() == pytest.approx([1.0] * 99)
    assert found.faults.unusable == 0
    assert len(found.faults.clock_jumps) == 1
