"""A recorded file is whole to its last second, and its bytes depend on setup and rows alone."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Attachment
from mcap.stream_reader import StreamReader

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.reader import read_log
from logs.recording.recorder import Recorder
from logs.recording.state_channel import EPOCH_NS
from tests.logs.made_flight import make_setup, make_track, record
from tests.logs.mcap_messages import chunks, messages


def test_the_summary_agrees_with_the_data(log_file: Path, track: Track) -> None:
    with log_file.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        names = [item.name for item in reader.iter_attachments()]
    assert summary.statistics is not None
    assert summary.statistics.message_count == sum(len(items) for items in messages(log_file).values())
    assert summary.statistics.chunk_count == len(summary.chunk_indexes) == len(chunks(log_file))
    assert summary.statistics.attachment_count == len(names) == len(summary.attachment_indexes)
    assert summary.statistics.message_start_time == EPOCH_NS
    assert summary.statistics.message_end_time == EPOCH_NS + round(track.time[-1] * 1e9)
    assert names[0] == "setup.json"
    assert {"scenario.json", "plan.json", "mission.waypoints", "terrain.json"} < set(names)
    assert names[-2:] == ["verdict.json", "result.json"]


@pytest.mark.parametrize("rows_a_block", [1, 7, 59, 100_000])
def test_the_bytes_do_not_depend_on_the_blocks(tmp_path: Path, log_file: Path, rows_a_block: int) -> None:
    again = record(tmp_path / "again.mcap", make_setup(), make_track(), rows_a_block=rows_a_block)
    assert again.read_bytes() == log_file.read_bytes()


def test_an_exception_leaves_a_readable_unfinished_file(tmp_path: Path, setup: FlightSetup, track: Track) -> None:
    path = tmp_path / "cut.mcap"

    def fly() -> None:
        with Recorder(path, setup) as recorder:
            recorder.write(track.rows(0, 130))
            raise RuntimeError("engine")

    with pytest.raises(RuntimeError, match="engine"):
        fly()
    log = read_log(path)
    assert (log.complete, log.ended, len(log.track)) == (False, None, 130)
    assert "before the flight had ended" in log.problem
    with path.open("rb") as file:
        assert make_reader(file, validate_crcs=True).get_summary() is not None


def test_a_killed_process_loses_at_most_the_last_second(tmp_path: Path, setup: FlightSetup, track: Track) -> None:
    path, copy = tmp_path / "live.mcap", tmp_path / "copy.mcap"
    with Recorder(path, setup) as recorder:
        for first in range(0, 400, 13):
            recorder.write(track.rows(first, first + 13))
            # What another process reads of the file now is what a kill would leave.
            copy.write_bytes(path.read_bytes())
            whole = int(track.time[first + 12]) * 60
            if whole:
                log = read_log(copy)
                assert (len(log.track), log.complete) == (whole, False)


def test_what_cannot_be_recorded_is_refused(tmp_path: Path, setup: FlightSetup, track: Track) -> None:
    with Recorder(tmp_path / "a.mcap", setup) as recorder:
        recorder.write(track.rows(0, 0))
        recorder.write(track.rows(0, 10))
        with pytest.raises(ValueError, match="must increase"):
            recorder.write(track.rows(9, 20))
        with pytest.raises(ValueError, match="level 'loud'"):
            recorder.event(1.0, "x", "loud")
        with pytest.raises(ValueError, match="time nan"):
            recorder.event(math.nan, "x")
    with pytest.raises(FileNotFoundError):
        Recorder(tmp_path / "none" / "a.mcap", setup)


def test_the_setup_lists_every_attachment_and_every_package(log_file: Path) -> None:
    with log_file.open("rb") as file:
        attachments = {item.name: item.data for item in StreamReader(file).records if isinstance(item, Attachment)}
    setup = json.loads(attachments["setup.json"])
    assert set(setup["sha256"]) == set(attachments) - {"setup.json", "result.json", "verdict.json"}
    assert {"python", "numpy", "jsbsim", "mcap", "protobuf"} < set(setup["versions"])
    assert json.loads(attachments["result.json"]) == {
        "schema": "planfly.result/1",
        "ended": "completed",
        "rows": 480,
        "end_time_s": 7.983333333,
    }


@pytest.mark.parametrize("every", [2, 3, 7])
@pytest.mark.parametrize("rows_a_block", [1, 60, 100_000])
def test_a_thinned_log_holds_one_row_in_so_many_and_the_last(
    tmp_path: Path, setup: FlightSetup, every: int, rows_a_block: int
) -> None:
    whole = make_track(3.0)
    with Recorder(tmp_path / "thin.mcap", setup, every=every) as recorder:
        for first in range(0, len(whole), rows_a_block):
            recorder.write(whole.rows(first, min(len(whole), first + rows_a_block)))
        recorder.finish("completed")
    log = read_log(tmp_path / "thin.mcap")
    assert log.complete
    kept = sorted({*range(0, len(whole), every), len(whole) - 1})
    np.testing.assert_array_equal(log.track.time, whole.time[kept])
    np.testing.assert_array_equal(log.track.commands, whole.commands[kept])
