"""Recorded files, read by mcap's own readers: every row, whatever the blocks, whole to the last second."""

import io
import json
import math
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Attachment, Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.reader import read_log
from logs.recording.recorder import CHUNK_SIZE, Recorder
from logs.recording.state_channel import EPOCH_NS, SECOND_NS
from tests.logs.conftest import make_setup, make_track, record
from tests.logs.recording.mcap_messages import chunks, messages


def test_an_independent_reader_finds_every_row_with_its_values(log_file: Path, track: Track) -> None:
    rows = messages(log_file)["/state"]
    assert len(rows) == len(track)
    state = [row for _, row in rows]
    assert [row.row for row in state] == list(range(len(track)))
    assert [row.time_s for row in state] == track.time.tolist()
    assert [row.up_amsl_m for row in state] == track.position[:, 2].tolist()
    assert [row.north_m for row in state] == track.position[:, 1].tolist()
    assert [row.velocity_up_mps for row in state] == track.velocity[:, 2].tolist()
    assert [row.yaw_rate_rad_per_s for row in state] == track.rates[:, 2].tolist()
    assert [row.beta_rad for row in state] == track.flow[:, 1].tolist()
    assert [row.rudder_rad for row in state] == track.controls[:, 2].tolist()
    assert [row.throttle_command_fraction for row in state] == track.commands[:, 3].tolist()
    assert [row.leg_index for row in state] == track.leg.tolist()
    assert [row.clearance_seen_m for row in state] == track.clearance.tolist()
    for message, row in rows:
        assert message.log_time == EPOCH_NS + round(row.time_s * 1e9)


def test_every_state_field_is_filled_and_none_is_left_over(log_file: Path) -> None:
    _, row = messages(log_file)["/state"][100]
    names = {field.name for field, _ in row.ListFields()}
    # The first leg's number is 0.
    assert {field.name for field in row.DESCRIPTOR.fields} - names == {"leg_index"}
    assert len(row.SerializeToString()) <= len(messages(log_file)["/state"][100][0].data)


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


@pytest.mark.filterwarnings("ignore:(start|end)_time is deprecated:DeprecationWarning")
def test_a_message_index_points_at_its_messages(log_file: Path) -> None:
    # A reader that seeks by log time uses the index alone.
    with log_file.open("rb") as file:
        reader = make_reader(file)
        start, end = EPOCH_NS + 3 * SECOND_NS // 2, EPOCH_NS + 2 * SECOND_NS
        found = [message for _, _, message in reader.iter_messages(topics=["/state"], start_time=start, end_time=end)]
    assert [message.sequence for message in found] == list(range(90, 120))
    data = log_file.read_bytes()
    with log_file.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    for index in summary.chunk_indexes:
        stream = StreamReader(io.BytesIO(data[index.chunk_start_offset :]), skip_magic=True, emit_chunks=True)
        records = stream.records
        chunk = next(records)
        assert isinstance(chunk, Chunk)
        count = sum(isinstance(item, Message) for item in breakup_chunk(chunk))
        assert count == sum(len(next(records).records) for _ in index.message_index_offsets)  # type: ignore[attr-defined]  # MessageIndex


@pytest.mark.parametrize("rate_hz", [1.0, 60.0, 700.0])
def test_a_chunk_holds_at_most_a_second_and_64_kib(tmp_path: Path, setup: FlightSetup, rate_hz: float) -> None:
    path = record(tmp_path / "a.mcap", setup, make_track(3.0, rate_hz))
    for chunk in chunks(path)[1:]:  # the first holds the scene
        assert chunk.message_start_time // SECOND_NS == chunk.message_end_time // SECOND_NS
        assert chunk.uncompressed_size <= CHUNK_SIZE + 4096
    np.testing.assert_array_equal(read_log(path).track.time, make_track(3.0, rate_hz).time)


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
    path, seen = tmp_path / "live.mcap", tmp_path / "seen.mcap"
    with Recorder(path, setup) as recorder:
        for first in range(0, 400, 13):
            recorder.write(track.rows(first, first + 13))
            # What another process sees of the file now is what a kill would leave.
            seen.write_bytes(path.read_bytes())
            whole = int(track.time[first + 12]) * 60
            if whole:
                log = read_log(seen)
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


def test_the_setup_names_every_piece_and_every_package(log_file: Path) -> None:
    with log_file.open("rb") as file:
        pieces = {item.name: item.data for item in StreamReader(file).records if isinstance(item, Attachment)}
    setup = json.loads(pieces["setup.json"])
    assert set(setup["sha256"]) == set(pieces) - {"setup.json", "result.json", "verdict.json"}
    assert {"python", "numpy", "jsbsim", "mcap", "protobuf"} < set(setup["versions"])
    assert json.loads(pieces["result.json"]) == {
        "schema": "planfly.result/1",
        "ended": "completed",
        "rows": 480,
        "end_time_s": 7.983333333,
    }


@pytest.mark.parametrize("every", [2, 3, 7])
@pytest.mark.parametrize("rows_a_block", [1, 60, 100_000])
def test_one_row_in_so_many_and_the_last(tmp_path: Path, setup: FlightSetup, every: int, rows_a_block: int) -> None:
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
