"""Messages and channels of a log are those that mcap's own reader finds."""

import dataclasses
import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from flight.simulation.track import COLUMNS, Track
from logs.recording.reader import log_channels, log_messages, read_log
from logs.recording.recorder import Recorder
from logs.recording.state_channel import state_class
from tests.logs.log_copies import prefix_of, rewrite, same
from tests.logs.made_flight import make_setup
from tests.soak import scaled
from world.errors import LogError


def test_every_message_is_given_as_it_was_written(log_file: Path) -> None:
    with log_file.open("rb") as file:
        found = [
            (channel.topic, message.log_time, message.data)
            for _, channel, message in make_reader(file).iter_messages(log_time_order=False)
        ]
    assert [(item.channel.topic, item.log_time, item.data) for item in log_messages(log_file)] == found


def test_the_first_chunk_declares_every_channel(log_file: Path) -> None:
    with log_file.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    schemas = {number: (schema.name, schema.encoding, schema.data) for number, schema in summary.schemas.items()}
    assert [
        (channel.topic, channel.encoding, (channel.schema, channel.schema_encoding, channel.schema_data))
        for channel in log_channels(log_file)
    ] == [
        (channel.topic, channel.message_encoding, schemas[channel.schema_id]) for channel in summary.channels.values()
    ]


def test_a_cut_log_gives_its_messages_up_to_the_cut(log_file: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log_file.read_bytes()[: log_file.stat().st_size * 3 // 4])
    whole, part = (list(log_messages(path)) for path in (log_file, cut))
    assert 0 < len(part) < len(whole)
    assert part == whole[: len(part)]


# ----------------------------------------------------------------------
# A recorded flight comes back bit for bit; rows that cannot be part of it end it.


def test_a_track_comes_back_bit_for_bit(log_file: Path, track: Track) -> None:
    log = read_log(log_file)
    same(log.track, track)
    assert (log.complete, log.problem, log.ended, log.end_time) == (True, "", "completed", track.time[-1])
    assert [(event.time, event.text, event.level) for event in log.events] == [
        (1.25, "half way up", "warning"),
        (7.983333333, "arrived", "info"),
    ]
    assert log.recorded_verdict is not None
    assert log.recorded_verdict["findings"][0]["flown"] == 41.0


@st.composite
def tracks(draw: st.DrawFn) -> Track:
    """Any numbers that the types can hold, in increasing time."""
    count = draw(st.integers(1, 40))
    steps = draw(st.lists(st.floats(1e-6, 3.0), min_size=count, max_size=count))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    columns: dict[str, Any] = {}
    for name, width in COLUMNS.items():
        kind = np.float64 if name == "position" else np.float32
        bits = rng.integers(0, 256, size=count * width * np.dtype(kind).itemsize, dtype=np.uint8)
        # A signalling NaN becomes a quiet one on its way through a register.
        quiet = bits.view(kind).astype(np.float64).astype(kind)
        columns[name] = quiet.reshape((count, width) if width > 1 else (count,))
    columns["time"] = np.cumsum(steps)
    columns["leg"] = rng.integers(0, 3, size=count).astype(np.int32)
    special = draw(st.sampled_from([math.nan, math.inf, -0.0, 5e-324, -1e308]))
    columns["position"][draw(st.integers(0, count - 1)), 1] = special
    return Track(**columns)


@pytest.mark.filterwarnings("ignore:invalid value encountered in cast")
@given(tracks())
@settings(max_examples=scaled(40, 15), deadline=None)
def test_any_track_comes_back_bit_for_bit(tmp_path_factory: pytest.TempPathFactory, track: Track) -> None:
    path = tmp_path_factory.getbasetemp() / "any.mcap"
    with Recorder(path, SMALL) as recorder:
        recorder.write(track)
        recorder.finish("completed")
    log = read_log(path)
    same(log.track, track)
    assert log.complete


SMALL = make_setup(with_plan=False, terrain={"kind": "flat", "amsl_m": 10.0})


def test_messages_in_other_layouts_are_read(tmp_path: Path, log_file: Path, track: Track) -> None:
    kind = state_class()

    def plain(item: Any, topic: str) -> Any:
        if topic == "/state":
            # Zeros are left out by protobuf's own encoder, so lengths differ from row to row.
            return dataclasses.replace(item, data=kind.FromString(item.data).SerializeToString())
        return item

    log = read_log(rewrite(log_file, tmp_path / "b.mcap", plain))
    same(log.track, track)
    assert log.complete


def test_an_edited_clearance_or_verdict_changes_nothing_else(tmp_path: Path, log_file: Path, track: Track) -> None:
    kind = state_class()

    def edit(item: Any, topic: str) -> Any:
        if topic == "/state":
            row: Any = kind.FromString(item.data)
            row.clearance_seen_m = 1.0
            return dataclasses.replace(item, data=row.SerializeToString())
        if topic == "verdict.json":
            return dataclasses.replace(item, data=b'{"flyable": false}')
        return item

    log = read_log(rewrite(log_file, tmp_path / "b.mcap", edit))
    same(dataclasses.replace(log.track, clearance=track.clearance), track)
    assert (log.track.clearance == 1.0).all()
    assert log.recorded_verdict == {"flyable": False}


def test_missing_files_and_folders_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "none.mcap", tmp_path):
        with pytest.raises(LogError, match=f"^{path}: "):
            read_log(path)


def test_an_mcap_file_of_another_kind_is_refused(tmp_path: Path, log_file: Path) -> None:
    def drop(item: Any, topic: str) -> Any:
        return None if topic.endswith(".json") else item

    with pytest.raises(LogError, match=r"not a planfly log: an MCAP file without setup\.json"):
        read_log(rewrite(log_file, tmp_path / "other.mcap", drop))


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("row", 77, "rows are missing"),
        ("time_s", 0.5, "time does not increase"),
        ("leg_index", -4, "leg does not exist"),
    ],
)
def test_the_track_ends_before_a_row_that_cannot_follow(
    tmp_path: Path, log_file: Path, track: Track, field: str, value: float, message: str
) -> None:
    kind = state_class()

    def edit(item: Any, topic: str) -> Any:
        if topic == "/state":
            row: Any = kind.FromString(item.data)
            if row.row == 123:
                setattr(row, field, value)
                return dataclasses.replace(item, data=row.SerializeToString())
        return item

    log = read_log(rewrite(log_file, tmp_path / "b.mcap", edit))
    assert (log.complete, len(log.track)) == (False, 123)
    assert message in log.problem
    prefix_of(track, log.track)


def test_rows_missing_at_the_end_are_counted(tmp_path: Path, log_file: Path) -> None:
    def lose(item: Any, topic: str) -> Any:
        return None if topic == "/state" and item.sequence >= 470 else item

    log = read_log(rewrite(log_file, tmp_path / "b.mcap", lose))
    assert (log.complete, log.problem, log.ended) == (False, "the log contains 470 of 480 rows", "completed")


def test_a_log_prints_in_a_line_and_is_a_table_in_a_notebook(log_file: Path, tmp_path: Path) -> None:
    log = read_log(str(log_file))
    assert repr(log) == f"<FlightLog flight.mcap: {log.setup.scenario.name}, {log.end_time:.1f} s, completed>"
    rows = {row[0].text: row[1].text for row in ElementTree.fromstring(log._repr_html_()).iter("tr")}
    assert rows["aircraft"] == "aerosonde"
    assert rows["ended"] == "completed"
    assert "incomplete" not in rows
    cut, data = tmp_path / "cut.mcap", log_file.read_bytes()
    cut.write_bytes(data[: data.index(b"result.json") - 100])
    short = read_log(cut)
    assert repr(short).endswith(" s, cut short>")
    rows = {row[0].text: row[1].text for row in ElementTree.fromstring(short._repr_html_()).iter("tr")}
    assert rows["incomplete"] == short.problem
