"""Chunks hold at most a second and 64 KiB, and their indexes lead to every message."""

import io
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk

from flight.simulation.setup import FlightSetup
from logs.recording.mcap_writer import SECOND_NS
from logs.recording.reader import read_log
from logs.recording.recorder import CHUNK_SIZE
from logs.recording.state_channel import EPOCH_NS
from tests.logs.made_flight import make_track, record
from tests.logs.mcap_messages import chunks


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
    # The first hold the scene, of which a part may be larger.
    for chunk in (chunk for chunk in chunks(path) if chunk.message_end_time > EPOCH_NS):
        assert chunk.message_start_time // SECOND_NS == chunk.message_end_time // SECOND_NS
        assert chunk.uncompressed_size <= CHUNK_SIZE + 4096
    np.testing.assert_array_equal(read_log(path).track.time, make_track(3.0, rate_hz).time)
