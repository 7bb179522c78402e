"""The timeline against numbers got in another way."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight.simulation.track import Track
from logs.recording.reader import FlightLog, LogEvent, read_log
from logs.replay.instruments import make_instruments
from logs.replay.timeline import TimelineEntry, entry_lines, timeline
from logs.verdict.measures.along_track import passages, segment_clearances
from logs.verdict.measures.leg_numbers import with_legs
from tests.logs.made_flight import make_setup, make_track
from world.terrain import flat_terrain


@pytest.fixture(scope="module")
def log(log_file: Path) -> FlightLog:
    return read_log(log_file)


def texts(entries: list[TimelineEntry], kind: str) -> list[str]:
    return [entry.text for entry in entries if entry.kind == kind]


def test_the_timeline_tells_legs_turns_and_ends_in_order(log: FlightLog) -> None:
    entries = timeline(log)
    assert entries == timeline(log)
    assert [entry.time for entry in entries] == sorted(entry.time for entry in entries)
    assert entries[0].kind == "start"
    assert entries[-1].kind == "end"
    # Course of the first leg: atan2(900 m east, 700 m north) = 52.1 degrees; its length the root of 900^2 + 700^2.
    assert texts(entries, "leg")[0] == "leg 0 to waypoint 1 (item 2): course 052°, 1140 m, slope +0.5°, 25.0 m/s"
    assert len(texts(entries, "leg")) == 3
    # 52.13 - 18.43 = 33.69 degrees, to the left; 0.45 rad = 25.8 degrees of bank.
    assert texts(entries, "turn")[0] == "turn left 33.7° at waypoint 1 (item 2), peak bank 25.8°"
    assert "full for 4.0 s" in texts(entries, "throttle")
    assert texts(entries, "event") == ["warning: half way up", "arrived"]
    assert texts(entries, "end")[0].startswith("completed; 8.0 s, 2.72 km, 9.0 Wh")


def test_the_lowest_clearance_of_each_leg(log: FlightLog) -> None:
    entries = [entry for entry in timeline(log) if entry.kind == "ground"]
    terrain = log.setup.scenario.terrain
    assert terrain is not None
    fine = np.linspace(0.0, log.end_time, 40_001)
    place = np.stack([np.interp(fine, log.track.time, log.track.position[:, k]) for k in range(3)], axis=1)
    height = place[:, 2] - terrain.height(place[:, 0], place[:, 1])
    legs = with_legs(log.setup, log.track).leg
    leg = legs[np.searchsorted(log.track.time, fine, side="right") - 1]
    for k, entry in enumerate(sorted(entries, key=lambda item: item.text)):
        lowest = float(height[leg == k].min())
        assert entry.text.startswith(f"lowest of leg {k}: {lowest:.1f} m above ground")
    # The recorded clearance, 999 m, is not believed.
    assert not any("999" in entry.text for entry in entries)


def test_a_low_flight_is_said_to_be_low(log: FlightLog) -> None:
    lowered = dataclasses.replace(log.track, position=log.track.position - np.array([0.0, 0.0, 60.0]))
    found = texts(timeline(dataclasses.replace(log, track=lowered)), "ground")
    assert any("49.4 m above ground, under the required 60 m" in text for text in found)


@given(
    speed=st.floats(10.0, 60.0),
    offset=st.floats(0.0, 390.0),
    rate=st.sampled_from([1.0, 7.0, 60.0]),
)
@settings(max_examples=40, deadline=None)
def test_passage_times_are_the_spheres_chord(speed: float, offset: float, rate: float) -> None:
    time = np.arange(round(3000.0 / speed * rate) + 2) / rate
    position = np.stack([-1500.0 + speed * time, np.full(time.size, offset), np.full(time.size, 100.0)], axis=1)
    (stay,) = passages(time, position, np.array([0.0, 0.0, 100.0]), 400.0)
    half = math.sqrt(400.0**2 - offset**2)
    assert stay.start == pytest.approx((1500.0 - half) / speed, abs=1e-6)
    assert stay.end == pytest.approx((1500.0 + half) / speed, abs=1e-6)
    assert stay.closest == pytest.approx(offset, abs=1e-6)
    assert stay.whole


def test_a_flight_that_starts_and_ends_inside() -> None:
    time = np.array([0.0, 1.0, 2.0, 3.0])
    position = np.array([[0.0, 0.0, 0.0], [200.0, 0.0, 0.0], [200.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    first, last = passages(time, position, np.zeros(3), 100.0)
    assert (first.start, first.end, first.whole) == (0.0, 0.5, True)
    assert (last.start, last.end, last.whole) == (2.5, 3.0, False)
    assert passages(time, position, np.array([0.0, 0.0, 500.0]), 100.0) == []
    assert passages(time, position, np.zeros(3), 0.0) == []


def test_garbage_positions_meet_nothing() -> None:
    ground = flat_terrain(np.array([[-1e3, 1e3], [-1e3, 1e3]]), 5.0, 100.0)
    position = np.array(
        [[0.0, 0.0, 50.0], [10.0, 0.0, 40.0], [math.nan, 0.0, 0.0], [1e300, 0.0, 0.0], [0.0, 0.0, 20.0]]
    )
    low, at = segment_clearances(ground, position)
    assert low[0] == pytest.approx(35.0)
    assert at[0] == pytest.approx(1.0)
    assert np.isnan(low[1:]).all()
    stays = passages(np.arange(5.0), position, np.zeros(3), 60.0)
    assert [(stay.start, stay.end) for stay in stays] == [(0.0, 1.0)]


def test_a_threat_is_entered_and_left(log: FlightLog) -> None:
    found = [entry for entry in timeline(log) if entry.kind == "threat"]
    assert [entry.text.split(":")[0] for entry in found] == [
        "inside the missile range of Alfa (400 m)",
        "outside the missile range of Alfa",
        "inside the radar range of threat 2 (800 m)",
        "still inside the radar range of threat 2",
    ]
    near = np.sqrt(((log.track.position - log.setup.scenario.threats.position[0]) ** 2).sum(axis=1))
    inside = log.track.time[near <= 400.0]
    assert found[0].time == pytest.approx(inside[0], abs=0.02)
    assert found[1].time == pytest.approx(inside[-1], abs=0.02)
    assert f"closest {near.min():.0f} m" in found[1].text


def test_what_is_not_known_is_said(log: FlightLog) -> None:
    bare = dataclasses.replace(make_setup(with_plan=False).scenario, terrain=None, external=True)
    cut = dataclasses.replace(
        log,
        setup=dataclasses.replace(log.setup, scenario=bare),
        ended=None,
        complete=False,
        problem="the file ends at byte 7",
    )
    entries = timeline(cut)
    assert texts(entries, "ground") == ["no terrain in the log: clearance is not known"]
    assert texts(entries, "end")[0].startswith("not recorded;")
    assert entries[-1].text == "the log is not complete: the file ends at byte 7"


def test_lines_fit_a_terminal_and_cannot_steer_it(log: FlightLog) -> None:
    nasty = LogEvent(3.0, "\x1b[2J\rall " + "very long words " * 20 + "x" * 300, "info")
    entries = timeline(dataclasses.replace(log, events=(nasty,)))
    lines = [line for entry in entries for line in entry_lines(entry)]
    assert all(len(line) <= 100 and line.isprintable() for line in lines)
    assert lines[0].startswith("     0.00 s  start    aerosonde, scenario synthetic, seed 7")


def test_one_row_and_unknown_numbers_are_told_too(log: FlightLog) -> None:
    single = dataclasses.replace(log, track=log.track.rows(0, 1), events=(), end_time=0.0)
    assert {entry.kind for entry in timeline(single)} >= {"start", "leg", "end"}
    terrain = log.setup.scenario.terrain
    assert terrain is not None
    # No ground is known north of 690 m, so under the last leg.
    heights = np.array(terrain.heights)
    heights[int(terrain.to_pixel(0.0, 690.0)[1]) :] = math.nan
    scenario = dataclasses.replace(log.setup.scenario, terrain=dataclasses.replace(terrain, heights=heights))
    setup = dataclasses.replace(log.setup, scenario=scenario)
    attitude = np.full((len(log.track), 3), math.nan, dtype=np.float32)
    lost: Track = dataclasses.replace(make_track(), attitude=attitude)
    entries = timeline(dataclasses.replace(log, setup=setup, track=lost))
    assert any("no terrain data under it" in text for text in texts(entries, "ground"))
    assert any("peak bank nan" in text for text in texts(entries, "turn"))


def test_legs_are_those_of_the_track_whatever_was_recorded(log: FlightLog) -> None:
    found = with_legs(log.setup, log.track).leg
    # The flight goes through each waypoint, 5.7 m a row; a leg ends within a few rows of it, at the fly-by's apex.
    for index, waypoint in enumerate(log.setup.route.waypoints[1:-1], 1):
        nearest = int(np.argmin(np.linalg.norm(log.track.position - waypoint, axis=1)))
        assert abs(int(np.searchsorted(found, index)) - nearest) < 12
    lying = dataclasses.replace(log.track, leg=np.zeros(len(log.track), dtype=np.int32))
    assert timeline(dataclasses.replace(log, track=lying)) == timeline(log)
    assert make_instruments(dataclasses.replace(log, track=lying)).frame(6.0) == make_instruments(log).frame(6.0)
    # What was never reached begins no leg, and a track of nothing is on the first.
    half = log.track.rows(0, len(log.track) // 2)
    assert with_legs(log.setup, half).leg.max() == found[: len(half)].max()
    assert not with_legs(log.setup, log.track.rows(0, 1)).leg.any()
    gone = dataclasses.replace(log.track, position=np.full((len(log.track), 3), math.nan))
    assert not with_legs(log.setup, gone).leg.any()
