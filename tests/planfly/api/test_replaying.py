"""`planfly.replay`: a flight by the clock, whatever the clock does."""

from types import SimpleNamespace

import pytest

import planfly
from logs.recording.example_log import example_log
from planfly.api import replaying
from world import running_clock


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """A clock that only sleeping moves: its time, s, and how often it was slept."""
    state = [100.0, 0.0]

    def sleep(seconds: float) -> None:
        state[0] += seconds
        state[1] += 1

    monkeypatch.setattr(replaying, "time", SimpleNamespace(sleep=sleep))
    monkeypatch.setattr(running_clock, "time", SimpleNamespace(monotonic=lambda: state[0]))
    return state


def test_it_takes_as_long_as_the_flight_by_its_speed(clock: list[float]) -> None:
    log = example_log()
    frames = list(planfly.replay(log, start=10.0, end=11.8, speed=4.0))
    # At four times real time, ten frames a second, the first and the last included.
    assert [time for time, _ in frames] == pytest.approx([10.0, 10.4, 10.8, 11.2, 11.6, 11.8])
    assert clock[1] == 5
    assert [lines for _, lines in frames] == [planfly.instruments(log).frame(time) for time, _ in frames]


def test_all_of_it_and_its_width(clock: list[float]) -> None:
    log = example_log()
    widths = iter(range(60, 10_000))
    frames = list(planfly.replay(log, speed=100.0, width=lambda: next(widths)))
    assert (frames[0][0], frames[-1][0]) == (float(log.track.time[0]), log.end_time)
    assert frames[1][1] == planfly.instruments(log).frame(frames[1][0], width=61)


def test_bad_input_is_refused_before_the_first_frame() -> None:
    for bad, said in (({"speed": 0.0}, "speed 0.0"), ({"start": 1e6}, "start 1e\\+06"), ({"end": -1.0}, "end -1.0")):
        with pytest.raises(planfly.PlanflyError, match=said):
            planfly.replay(example_log(), **bad)  # type: ignore[arg-type]
