import numpy as np

from logs.field_logs.clean_places import DEGREE
from logs.field_logs.example_raw_log import example_raw_log
from logs.field_logs.flight_parts import FLYING, choose_part, flight_parts, flown_spans
from logs.field_logs.raw_log import LoggedMission, ModeChange

MISSION = example_raw_log().missions[0].mission


def spans_at(speeds: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Spans of a log that goes north at these speeds (m/s) for these times (s)."""
    speed = np.concatenate([np.full(int(seconds * 5), value) for value, seconds in speeds])
    lat = 46.0 + np.cumsum(speed * 0.2) / DEGREE
    return flown_spans(np.arange(lat.size) * 0.2, lat, np.full(lat.size, 8.0))


def test_slower_than_flying_is_no_flight() -> None:
    assert spans_at([(FLYING - 0.1, 100.0)]) == []
    assert len(spans_at([(FLYING + 0.1, 100.0)])) == 1


def test_a_short_dash_is_no_flight() -> None:
    assert spans_at([(0.0, 60.0), (20.0, 15.0), (0.0, 60.0)]) == []
    assert len(spans_at([(0.0, 60.0), (20.0, 25.0), (0.0, 60.0)])) == 1


def test_slow_for_a_minute_is_the_same_flight_and_longer_another() -> None:
    """Against the wind an aircraft may stand for a while; a minute on the ground ends a flight."""
    assert len(spans_at([(20.0, 60.0), (1.0, 50.0), (20.0, 60.0)])) == 1
    assert len(spans_at([(20.0, 60.0), (1.0, 90.0), (20.0, 60.0)])) == 2


def test_stretches_are_those_in_auto() -> None:
    modes = [ModeChange(0.0, "FBWA", False), ModeChange(20.0, "AUTO", True), ModeChange(50.0, "FBWA", False),
             ModeChange(60.0, "AUTO", True)]  # fmt: skip
    (part,) = flight_parts([(10.0, 100.0)], modes, [LoggedMission(1.0, MISSION, "CMD")], 200.0)
    assert [(one.start, one.end, one.ended, one.next_mode) for one in part.stretches] == [
        (20.0, 50.0, "mode", "FBWA"),
        (60.0, 100.0, "landed", ""),
    ]
    (cut,) = flight_parts([(10.0, 100.0)], modes, [], 101.0)
    assert cut.stretches[-1].ended == "log"
    assert (part.mission, cut.mission) == (0, -1)


def test_a_flight_with_two_missions_is_two_parts_and_the_longer_is_chosen() -> None:
    modes = [ModeChange(0.0, "AUTO", True), ModeChange(40.0, "LOITER", False), ModeChange(50.0, "AUTO", True)]
    missions = [LoggedMission(0.0, MISSION, "CMD"), LoggedMission(45.0, MISSION, "CMD")]
    parts = flight_parts([(0.0, 200.0)], modes, missions, 300.0)
    assert [(part.mission, part.along_mission) for part in parts] == [(0, 40.0), (1, 150.0)]
    assert choose_part(parts) == 1


def test_without_modes_all_of_a_flight_counts() -> None:
    (part,) = flight_parts([(5.0, 90.0)], [], [LoggedMission(0.0, MISSION, "route")], 91.0)
    assert [(one.start, one.end, one.mode, one.ended) for one in part.stretches] == [(5.0, 90.0, "", "log")]


def test_a_flight_without_auto_is_shown_and_not_judged() -> None:
    (part,) = flight_parts([(5.0, 90.0)], [ModeChange(0.0, "FBWA", False)], [], 91.0)
    assert part.stretches == ()
