"""A log that an interruption leaves whole, or not at all."""

from pathlib import Path

import numpy as np
import pytest

from flight.simulation.track import track_rows
from logs.recording.example_log import example_log
from logs.recording.reader import read_log
from logs.recording.recorder import CrashSafeRecorder, Recorder
from world.errors import LogError
from world.interruption import Interrupted, interrupt

FLOWN = example_log()


def test_an_interrupted_flight_keeps_every_row_it_was_handed(tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    rows = track_rows(FLOWN.track)
    with pytest.raises(Interrupted), CrashSafeRecorder(path, FLOWN.setup, batch=60) as log:  # noqa: PT012
        log.write_rows(rows[:37])
        log.write_rows(rows[37:123])
        interrupt(2)
    left = read_log(path)
    assert (left.complete, left.ended, left.recorded_verdict) == (True, "interrupted", None)
    assert np.array_equal(left.track.position, FLOWN.track.position[:123])


def test_a_signal_in_the_middle_of_a_write_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, written = tmp_path / "flight.mcap", Recorder.write_rows

    def struck(self: Recorder, rows: object) -> None:
        interrupt(2)
        written(self, rows)

    monkeypatch.setattr(Recorder, "write_rows", struck)
    with pytest.raises(Interrupted), CrashSafeRecorder(path, FLOWN.setup) as log:
        log.write_rows(track_rows(FLOWN.track)[:50])
    assert len(read_log(path).track) == 50


def test_a_flight_that_was_over_is_said_to_be(tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    with pytest.raises(KeyboardInterrupt), CrashSafeRecorder(path, FLOWN.setup) as log:  # noqa: PT012
        log.write_rows(track_rows(FLOWN.track))
        log.end_reason = "completed"
        raise KeyboardInterrupt
    assert read_log(path).ended == "completed"


@pytest.mark.parametrize("opening", [True, False])
def test_a_log_without_a_row_is_not_left(opening: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, made = tmp_path / "flight.mcap", Recorder.__init__

    def struck(self: Recorder, *args: object, **options: object) -> None:
        made(self, *args, **options)
        interrupt(15)

    if opening:
        monkeypatch.setattr(Recorder, "__init__", struck)
    with pytest.raises(KeyboardInterrupt), CrashSafeRecorder(path, FLOWN.setup):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_an_error_leaves_the_log_unfinished(tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    with pytest.raises(LogError), CrashSafeRecorder(path, FLOWN.setup) as log:  # noqa: PT012
        log.write_rows(track_rows(FLOWN.track))
        raise LogError("full")
    assert not read_log(path).complete


@pytest.mark.parametrize("there", [False, True])
def test_a_target_that_is_a_link_is_never_removed(there: bool, tmp_path: Path) -> None:
    """One that leads to itself cannot be written; what an interruption leaves goes, not the link."""
    link = tmp_path / "link.mcap"
    link.symlink_to(tmp_path / ("real.mcap" if there else "link.mcap"))
    if there:
        with pytest.raises(Interrupted), CrashSafeRecorder(link, FLOWN.setup):
            interrupt(2)
        assert not (tmp_path / "real.mcap").exists()
    else:
        with pytest.raises(OSError, match="symbolic links"):
            CrashSafeRecorder(link, FLOWN.setup)
    assert link.is_symlink()
