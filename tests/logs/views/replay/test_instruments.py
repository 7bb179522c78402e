"""A frame of the instruments is always the same, within its width, and has the numbers of its row."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.reader import read_log
from logs.views.replay.instruments import MIN_WIDTH, make_instruments
from tests.logs.made_flight import record

TIMES = np.arange(0.0, 8.0, 0.37)


def test_replaying_twice_gives_the_same_frames(log_file: Path) -> None:
    shows = [make_instruments(read_log(log_file)) for _ in range(2)]
    first, second = ([show.frame(float(time)) for time in TIMES] for show in shows)
    assert first == second
    # In any order, too: a frame has no memory.
    assert [shows[0].frame(float(time)) for time in TIMES[::-1]] == first[::-1]
    assert len({"\n".join(frame) for frame in first}) == len(TIMES)


@pytest.mark.parametrize("width", [10, MIN_WIDTH, 80, 200])
def test_frames_fit_their_width_and_24_lines(log_file: Path, width: int) -> None:
    show = make_instruments(read_log(log_file))
    frames = [show.frame(float(time), width=width) for time in TIMES]
    assert all(len(line) <= max(width, MIN_WIDTH) for frame in frames for line in frame)
    assert all(len(frame) <= 21 for frame in frames)


def test_in_sixty_columns_every_number_is_whole(log_file: Path) -> None:
    show = make_instruments(read_log(log_file))
    for time in TIMES:
        wide, narrow = ("\n".join(show.frame(float(time), width=width)) for width in (300, 60))
        numbers = [line[29:].strip() for line in wide.splitlines()[3:11]]
        assert all(numbers)
        assert all(text in narrow for text in numbers)
        # The controls' states, and that one is at its limit.
        states = [line.partition("] ")[2] for line in wide.splitlines() if line.startswith(("throttle", "elevator"))]
        assert len(states) == 2
        assert all(f"] {state}" in narrow for state in states)


def test_the_numbers_are_those_of_the_row(log_file: Path, track: Track) -> None:
    show = make_instruments(read_log(log_file))
    k = 200
    # The newest row at or before that time.
    text = "\n".join(show.frame(float(track.time[k]) + 0.5 / 60.0))
    assert f"{track.time[k]:.1f} of {track.time[-1]:.1f} s" in text
    assert f"airspeed     {track.airspeed[k]:.1f} m/s" in text
    assert f"{math.degrees(track.attitude[k, 0]):+.1f}°, {math.degrees(track.attitude[k, 1]):+.1f}°" in text
    assert f"leg {track.leg[k]} of 3" in text
    assert "within reach of: MISSILE Alfa" in text
    assert "AT ITS LIMIT" in text  # the middle of the track holds full throttle
    assert "\n".join(show.frame(-5.0)) == "\n".join(show.frame(0.0))
    assert "\n".join(show.frame(1e6)) == "\n".join(show.frame(float(track.time[-1])))


def test_nought_is_not_less_than_nought(tmp_path: Path, setup: FlightSetup, track: Track) -> None:
    level = np.full_like(track.attitude, np.radians(-0.02))
    log = read_log(record(tmp_path / "a.mcap", setup, replace(track, attitude=level)))
    assert "+0.0°, +0.0°" in "\n".join(make_instruments(log).frame(1.0))


@pytest.mark.parametrize(("roll", "left_is_sky"), [(0.6, False), (-0.6, True)])
def test_the_horizon_leans_against_the_bank(
    tmp_path: Path, setup: FlightSetup, track: Track, roll: float, left_is_sky: bool
) -> None:
    attitude = np.zeros_like(track.attitude)
    attitude[:, 0] = roll
    log = read_log(record(tmp_path / "a.mcap", setup, replace(track, attitude=attitude)))
    rows = [line[1:26] for line in make_instruments(log).frame(1.0) if line.startswith("|")]
    assert len(rows) == 7
    left, right = (sum(row[column] == ":" for row in rows) for column in (1, 23))
    # Right wing down: on that side there is more ground.
    assert (left < right) is not left_is_sky


def test_nose_up_shows_more_sky(tmp_path: Path, setup: FlightSetup, track: Track) -> None:
    grounds = []
    for pitch in (-0.2, 0.0, 0.2):
        attitude = np.zeros_like(track.attitude)
        attitude[:, 1] = pitch
        log = read_log(record(tmp_path / f"{pitch}.mcap", setup, replace(track, attitude=attitude)))
        grounds.append("".join(make_instruments(log).frame(1.0)).count(":"))
    assert grounds[0] > grounds[1] > grounds[2]


def test_a_track_that_is_not_a_number_is_shown(tmp_path: Path, setup: FlightSetup, track: Track) -> None:
    position, attitude = track.position.copy(), track.attitude.copy()
    position[60:90], attitude[60:90] = math.nan, math.nan
    log = read_log(record(tmp_path / "a.mcap", setup, replace(track, position=position, attitude=attitude)))
    assert "?" in "\n".join(make_instruments(log).frame(1.2))
