"""A log that an interruption leaves whole, or not at all."""

from pathlib import Path

import numpy as np
import pytest

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Rows, track_rows
from logs.recording.example_log import example_log
from logs.recording.reader import read_log
from logs.recording.recorder import Recorder
from world.errors import LogError
from world.interruption import Interrupted, interrupt

FLOWN = example_log()


def test_an_interrupted_flight_keeps_every_row_it_was_handed(tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    rows = track_rows(FLOWN.track)
    with pytest.raises(Interrupted), Recorder(path, FLOWN.setup, batch=60) as log:  # noqa: PT012
        log.write_rows(rows[:37])
        log.write_rows(rows[37:123])
        interrupt(2)
    left = read_log(path)
    assert (left.complete, left.ended, left.recorded_verdict) == (True, "interrupted", None)
    assert np.array_equal(left.track.position, FLOWN.track.position[:123])


def test_a_signal_in_the_middle_of_a_write_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, written = tmp_path / "flight.mcap", Recorder._append_rows

    def struck(self: Recorder, rows: Rows) -> None:
        interrupt(2)
        written(self, rows)

    monkeypatch.setattr(Recorder, "_append_rows", struck)
    with pytest.raises(Interrupted), Recorder(path, FLOWN.setup) as log:
        log.write_rows(track_rows(FLOWN.track)[:50])
    assert len(read_log(path).track) == 50


def test_a_flight_that_was_over_is_said_to_be(tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    with pytest.raises(KeyboardInterrupt), Recorder(path, FLOWN.setup) as log:  # noqa: PT012
        log.write_rows(track_rows(FLOWN.track))
        log.end_reason = "completed"
        raise KeyboardInterrupt
    assert read_log(path).ended == "completed"


@pytest.mark.parametrize("opening", [True, False])
def test_a_log_without_a_row_is_not_left(opening: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, opened = tmp_path / "flight.mcap", Recorder._open_file

    def struck(self: Recorder, setup: FlightSetup) -> None:
        opened(self, setup)
        interrupt(15)

    if opening:
        monkeypatch.setattr(Recorder, "_open_file", struck)
    with pytest.raises(KeyboardInterrupt), Recorder(path, FLOWN.setup):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_an_error_leaves_the_log_unfinished(tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    with pytest.raises(LogError), Recorder(path, FLOWN.setup) as log:  # noqa: PT012
        log.write_rows(track_rows(FLOWN.track))
        raise LogError("full")
    assert not read_log(path).complete


@pytest.mark.parametrize("there", [False, True])
def test_a_target_that_is_a_link_is_never_removed(there: bool, tmp_path: Path) -> None:
    """One that leads to itself cannot be written; what an interruption leaves goes, not the link."""
    link = tmp_path / "link.mcap"
    link.symlink_to(tmp_path / ("real.mcap" if there else "link.mcap"))
    if there:
        with pytest.raises(Interrupted), Recorder(link, FLOWN.setup):
            interrupt(2)
        assert not (tmp_path / "real.mcap").exists()
    else:
        with pytest.raises(OSError, match="symbolic links"):
            Recorder(link, FLOWN.setup)
    assert link.is_symlink()
