"""What was recorded comes back bit for bit; what was damaged is never taken for what was recorded."""

import dataclasses
import hashlib
import json
import math
import os
import struct
import tracemalloc
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.records import Attachment, Channel, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from aircraft.envelope import Envelope
from aircraft.path_limits import Limits
from flight.mission.items import Mission, MissionItem
from flight.mission.route import Route
from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import COLUMNS, Track
from logs.recording.reader import read_log
from logs.recording.recorder import Recorder
from logs.recording.setup_attachments import pack_setup, unpack_setup
from logs.recording.state_channel import state_class
from tests.logs.made_flight import make_setup, record
from world import scenario as scenario_module
from world.errors import LogError
from world.scenario import from_spec, load_scenario

Attachments = dict[str, bytes]


def same(a: Any, b: Any, where: str = "setup") -> None:
    """Equal in every field, arrays bit for bit, NaN equal to NaN."""
    assert type(a) is type(b), where
    if dataclasses.is_dataclass(a):
        for item in dataclasses.fields(a):
            same(getattr(a, item.name), getattr(b, item.name), f"{where}.{item.name}")
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype, where
        assert a.shape == b.shape, where
        assert a.tobytes() == b.tobytes(), where
    elif isinstance(a, tuple):
        assert len(a) == len(b), where
        for k, (x, y) in enumerate(zip(a, b, strict=True)):
            same(x, y, f"{where}[{k}]")
    elif isinstance(a, float) and math.isnan(a):
        assert math.isnan(b), where
    else:
        assert a == b, where


def rewrite(source: Path, target: Path, change: Callable[[Any, str], Any]) -> Path:
    """Copy a log with mcap's own writer; change(record, topic or name) gives what is written, None to leave it out."""
    channels: dict[int, Channel] = {}
    made: dict[int, int] = {}
    schemas: dict[int, Schema] = {}
    with source.open("rb") as file, target.open("wb") as out:
        writer: Any = Writer(out)
        writer.start(profile="other", library="other")
        for item in StreamReader(file).records:
            if isinstance(item, Schema):
                schemas[item.id] = item
            elif isinstance(item, Channel) and item.id not in channels:
                channels[item.id] = item
                schema = schemas[item.schema_id]
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                made[item.id] = writer.register_channel(item.topic, item.message_encoding, number)
            elif isinstance(item, Message):
                item = change(item, channels[item.channel_id].topic)
                if item is not None:
                    writer.add_message(made[item.channel_id], item.log_time, item.data, item.publish_time)
            elif isinstance(item, Attachment):
                item = change(item, item.name)
                if item is not None:
                    writer.add_attachment(item.create_time, item.log_time, item.name, item.media_type, item.data)
        writer.finish()
    return target


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
@settings(max_examples=40, deadline=None)
def test_any_track_comes_back_bit_for_bit(tmp_path_factory: pytest.TempPathFactory, track: Track) -> None:
    path = tmp_path_factory.getbasetemp() / "any.mcap"
    with Recorder(path, SMALL) as recorder:
        recorder.write(track)
        recorder.finish("completed")
    log = read_log(path)
    same(log.track, track)
    assert log.complete


SMALL = make_setup(with_plan=False, terrain={"kind": "flat", "amsl_m": 10.0})


@pytest.mark.parametrize("with_plan", [True, False])
def test_the_setup_comes_back_whole(tmp_path: Path, track: Track, with_plan: bool) -> None:
    setup = make_setup(with_plan=with_plan)
    log = read_log(record(tmp_path / "a.mcap", setup, track))
    same(log.setup, setup)
    assert log.versions["numpy"] == np.__version__


def test_no_field_of_a_setup_is_left_behind() -> None:
    # A field with a default could be forgotten in silence: these are all that the log knows of.
    kinds = (FlightSetup, Limits, Mission, Route, Envelope)
    names = {kind: [item.name for item in dataclasses.fields(kind)] for kind in kinds}
    assert len(names[FlightSetup]) == 12
    assert len(names[Limits]) == 8
    assert len(names[Mission]) == 7
    assert len(names[Route]) == 8
    assert len(names[Envelope]) == 14
    assert len(dataclasses.fields(MissionItem)) == 8


def test_a_dem_comes_from_the_log_and_not_from_its_file(
    tmp_path: Path, track: Track, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = load_scenario("jacksboro")
    assert scenario.terrain is not None
    setup = dataclasses.replace(make_setup(with_plan=False), scenario=scenario)
    path = record(tmp_path / "a.mcap", setup, track)

    def refuse(*_: object) -> None:
        raise AssertionError("the elevation file was opened")

    monkeypatch.setattr(scenario_module, "open_raster", refuse)
    same(read_log(path).setup.scenario, scenario)


def test_a_foreign_mission_without_terrain(tmp_path: Path, track: Track) -> None:
    spec = make_setup().scenario.to_json() | {"terrain": {"kind": "none"}, "threats": []}
    setup = dataclasses.replace(make_setup(with_plan=False), scenario=from_spec(spec, "t", external=True))
    log = read_log(record(tmp_path / "a.mcap", setup, track))
    assert log.setup.scenario.terrain is None
    assert log.setup.scenario.external
    same(log.setup, setup)


def test_other_writers_layouts_are_read(tmp_path: Path, log_file: Path, track: Track) -> None:
    kind = state_class()

    def plain(item: Any, topic: str) -> Any:
        if topic == "/state":
            # Zeros are left out by protobuf's own encoder, so lengths differ from row to row.
            return dataclasses.replace(item, data=kind.FromString(item.data).SerializeToString())
        return item

    log = read_log(rewrite(log_file, tmp_path / "b.mcap", plain))
    same(log.track, track)
    assert log.complete


def test_an_edited_clearance_or_verdict_is_only_what_it_says(tmp_path: Path, log_file: Path, track: Track) -> None:
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


SOAK = bool(os.environ.get("PLANFLY_SOAK"))


def _cuts(size: int) -> Iterator[int]:
    if SOAK:
        yield from range(0, size, 3)
        return
    rng = np.random.default_rng(2)
    yield from range(40)
    yield from sorted(rng.integers(40, size, size=60).tolist())
    yield from range(size - 40, size)


def prefix_of(whole: Track, found: Track) -> None:
    same(found, whole.rows(0, len(found)))


def test_a_truncated_file_gives_its_whole_chunks(tmp_path: Path, log_file: Path, track: Track, setup: Any) -> None:
    data = log_file.read_bytes()
    path = tmp_path / "cut.mcap"
    lengths = []
    for cut in _cuts(len(data)):
        path.write_bytes(data[:cut])
        try:
            log = read_log(path)
        except LogError:
            lengths.append(0)
            continue
        assert not log.complete
        assert log.problem
        prefix_of(track, log.track)
        same(log.setup, setup)
        lengths.append(len(log.track))
    assert lengths == sorted(lengths)
    assert lengths[0] == 0
    assert lengths[-1] == len(track)


@pytest.mark.parametrize("finished", [True, False])
def test_no_flipped_bit_is_taken_for_data(
    tmp_path: Path, log_file: Path, track: Track, setup: Any, finished: bool
) -> None:
    whole = bytearray(log_file.read_bytes())
    if not finished:
        del whole[-3000:]
    rng = np.random.default_rng(3)
    path = tmp_path / "bit.mcap"
    # All over the file, and densely in its last part, where the chunks with the rows are.
    flips = 2500 if SOAK else 60
    places = [*rng.integers(0, len(whole), size=flips), *rng.integers(len(whole) - 90_000, len(whole), size=flips)]
    for place in [*places, *range(0, 60)]:
        data = bytearray(whole)
        data[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(data)
        try:
            log = read_log(path)
        except LogError:
            continue
        assert not log.complete, f"byte {place}"
        prefix_of(track, log.track)
        same(log.setup, setup)


MAGIC = b"\x89MCAP0\r\n"


def mcap_record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def chunk_record(data: bytes, size: int, crc: int) -> bytes:
    head = struct.pack("<QQQI", 0, 0, size, crc) + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(data))
    return mcap_record(6, head + data)


@pytest.mark.parametrize("declared", [2**30, 1000])
def test_a_chunk_bomb_is_refused_before_it_grows(tmp_path: Path, declared: int) -> None:
    compressor = zstandard.ZstdCompressor(level=19).compressobj(size=2**30)
    block = bytes(2**22)
    bomb = b"".join(compressor.compress(block) for _ in range(256)) + compressor.flush()
    assert len(bomb) < 120_000
    path = tmp_path / "bomb.mcap"
    header = mcap_record(1, struct.pack("<I", 0) * 2)
    path.write_bytes(MAGIC + header + chunk_record(bomb, declared, 1))
    tracemalloc.start()
    with pytest.raises(LogError, match=r"1,073,741,824 bytes: at most|does not decompress to the 1,000"):
        read_log(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20e6


def test_many_small_bombs_are_refused(tmp_path: Path) -> None:
    # A record of a kind that readers skip.
    block = mcap_record(0x80, bytes(2**25))
    data = zstandard.ZstdCompressor().compress(block)
    record_ = chunk_record(data, len(block), zlib.crc32(block))
    path = tmp_path / "bombs.mcap"
    path.write_bytes(MAGIC + record_ * 1000)
    with pytest.raises(LogError, match="chunks grow to"):
        read_log(path)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty"),
        (b"QGC WPL 110\n", "not an MCAP file"),
        (MAGIC, "no whole chunk"),
        (MAGIC + b"\x06" + b"\xff" * 8, "at most 67,108,864 are read"),
        (MAGIC + b"\x00" * 100, "no whole chunk"),
        (MAGIC + mcap_record(9, b"\xff" * 30), "cannot be read"),
        (MAGIC + mcap_record(6, b"\xff" * 30), "cannot be read"),
        (bytes(range(256)) * 50, "not an MCAP file"),
    ],
)
def test_what_is_no_log_is_refused_in_one_line(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "bad.mcap"
    path.write_bytes(content)
    with pytest.raises(LogError, match=words) as caught:
        read_log(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_missing_files_and_folders_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "none.mcap", tmp_path):
        with pytest.raises(LogError, match=f"^{path}: "):
            read_log(path)


def test_somebody_elses_mcap_is_refused(tmp_path: Path, log_file: Path) -> None:
    def drop(item: Any, topic: str) -> Any:
        return None if topic.endswith(".json") else item

    with pytest.raises(LogError, match=r"no setup\.json: not a planfly flight log"):
        read_log(rewrite(log_file, tmp_path / "other.mcap", drop))


def altered(setup: FlightSetup, change: Callable[[dict[str, Any]], None]) -> Attachments:
    pieces = pack_setup(setup)
    data = json.loads(pieces["setup.json"])
    change(data)
    return pieces | {"setup.json": json.dumps(data).encode()}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda data: data["route"]["items"].append(3), r"route\.items: 5 values: 4 are expected"),
        (lambda data: data["envelope"]["climb_rad"].pop(), r"envelope\.climb_rad: shape \[2, 2\]: \[3, 2\]"),
        (lambda data: data["envelope"]["climb_rad"][0].pop(), r"envelope\.climb_rad: shape"),
        (lambda data: data["envelope"]["amsl_m"].reverse(), r"envelope\.amsl_m: not increasing"),
        (lambda data: data.pop("seed"), "seed"),
        (lambda data: data.update(surprise=1), "surprise: unknown key"),
        (lambda data: data.update(schema="planfly.log/9"), "schema"),
        (lambda data: data.update(airspeed_mps="nan"), "airspeed_mps"),
        (lambda data: data["route"]["waypoints_east_north_amsl_m"][0].__setitem__(0, "inf"), "waypoints"),
        (lambda data: data["sha256"].update({"plan.json": "0"}), r"plan\.json: altered"),
        (lambda data: data["sha256"].pop("scenario.json"), r"scenario\.json: missing"),
        (lambda data: data["sha256"].pop("terrain.json"), r"terrain\.kind: 'peaks': the log holds no terrain\.json"),
        (lambda data: data["sha256"].pop("terrain-000.heights"), r"terrain\.json: parts"),
    ],
)
def test_a_setup_that_does_not_fit_is_refused(change: Callable[[dict[str, Any]], None], words: str) -> None:
    with pytest.raises(LogError, match=words) as caught:
        unpack_setup(altered(make_setup(), change), "x.mcap")
    assert "\n" not in str(caught.value)


def test_a_log_does_not_make_its_reader_open_files(track: Track, monkeypatch: pytest.MonkeyPatch) -> None:
    def trap(*_: object) -> None:
        raise AssertionError("a file was opened")

    setup = make_setup(with_plan=False)
    pieces = pack_setup(setup)
    spec = json.loads(pieces["scenario.json"]) | {"terrain": {"kind": "dem", "path": "/etc/passwd"}}
    pieces["scenario.json"] = json.dumps(spec).encode()
    data = json.loads(pieces["setup.json"])
    data["sha256"]["scenario.json"] = hashlib.sha256(pieces["scenario.json"]).hexdigest()
    del data["sha256"]["terrain.json"]
    pieces["setup.json"] = json.dumps(data).encode()
    monkeypatch.setattr(scenario_module, "open_raster", trap)
    with pytest.raises(LogError, match=r"terrain\.kind: 'dem'"):
        unpack_setup(pieces, "x.mcap")


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("row", 77, "rows are missing"),
        ("time_s", 0.5, "time does not increase"),
        ("leg_index", -4, "leg does not exist"),
    ],
)
def test_rows_that_cannot_follow_end_the_track(
    tmp_path: Path, log_file: Path, track: Track, field: str, value: float, words: str
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
    assert words in log.problem
    prefix_of(track, log.track)


def test_a_hole_or_a_lost_end_is_seen(tmp_path: Path, log_file: Path) -> None:
    def lose(item: Any, topic: str) -> Any:
        return None if topic == "/state" and item.sequence >= 470 else item

    log = read_log(rewrite(log_file, tmp_path / "b.mcap", lose))
    assert (log.complete, log.problem, log.ended) == (False, "470 of 480 rows are there", "completed")
