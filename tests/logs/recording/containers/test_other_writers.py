"""Every container that the format allows and other writers make is read as what it holds, or named as no flight."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from mcap.opcode import Opcode
from mcap.writer import CompressionType, IndexType, Writer

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.reader import log_messages, read_log
from logs.recording.recover import recover_log
from tests.clients import NODE_MODULES, need
from tests.logs.log_copies import rewrite, same
from tests.logs.recording.containers.framing import FRAME, MAGIC, framed
from world.errors import LogError

# Options of mcap's writer for Python.
PYTHON: dict[str, dict[str, Any]] = {
    "no-chunks": {"use_chunking": False},
    "no-chunks-data-crc": {"use_chunking": False, "enable_data_crcs": True},
    "no-chunks-no-crc": {"use_chunking": False, "enable_crcs": False},
    "lz4": {"compression": CompressionType.LZ4},
    "zstd": {"compression": CompressionType.ZSTD},
    "none": {"compression": CompressionType.NONE},
    "small-chunks": {"chunk_size": 200, "compression": CompressionType.LZ4},
    "no-crc": {"enable_crcs": False},
    "data-crc": {"enable_data_crcs": True},
    "no-index": {"index_types": IndexType.NONE},
    "message-index": {"index_types": IndexType.MESSAGE},
    "no-statistics": {"use_statistics": False},
    "no-summary-offsets": {"use_summary_offsets": False},
    "no-repeats": {"repeat_channels": False, "repeat_schemas": False},
    "no-summary": {
        "index_types": IndexType.NONE,
        "use_statistics": False,
        "use_summary_offsets": False,
        "repeat_channels": False,
        "repeat_schemas": False,
    },
}
# Options of @mcap/core's writer for Node.
NODE: dict[str, dict[str, bool]] = {
    "usual": {},
    "no-chunks": {"useChunks": False},
    "nothing-but-data": {
        "useStatistics": False,
        "useSummaryOffsets": False,
        "repeatSchemas": False,
        "repeatChannels": False,
        "useAttachmentIndex": False,
        "useMetadataIndex": False,
        "useMessageIndex": False,
        "useChunkIndex": False,
    },
}


def copy(source: Path, target: Path, **options: Any) -> Path:
    """A log as mcap's own writer makes it, with another profile and a record of metadata."""
    from tests.logs import log_copies

    kept = log_copies.Writer
    log_copies.Writer = lambda out: Writer(out, **options)
    try:
        return rewrite(source, target, lambda item, _: item)
    finally:
        log_copies.Writer = kept


def whole(path: Path, track: Track, setup: FlightSetup) -> None:
    """A log that gives everything that was recorded, and whose events and scenes are there, too."""
    log = read_log(path)
    assert (log.complete, log.problem) == (True, "")
    same(log.track, track)
    same(log.setup, setup)
    assert log.ended == "completed"
    assert sum(message.channel.topic == "/state" for message in log_messages(path)) == len(track)


@pytest.mark.parametrize("name", PYTHON)
def test_what_pythons_writer_makes(name: str, log_file: Path, track: Track, setup: FlightSetup, tmp_path: Path) -> None:
    whole(copy(log_file, tmp_path / "copy.mcap", **PYTHON[name]), track, setup)


@pytest.mark.parametrize("name", NODE)
def test_what_nodes_writer_makes(name: str, log_file: Path, track: Track, setup: FlightSetup, tmp_path: Path) -> None:
    node = need(shutil.which("node"), "node", "apt package nodejs")
    need(NODE_MODULES / "@mcap" / "core", "@mcap/core", "make clients")
    script, target = Path(__file__).with_name("write_mcap.cjs"), tmp_path / "copy.mcap"
    command = [node, str(script), str(NODE_MODULES), str(log_file), str(target), json.dumps(NODE[name])]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    whole(target, track, setup)


def padded(data: bytes, unknown: tuple[int, ...]) -> bytes:
    """Three more bytes in each record but messages, and records of unknown kinds between all."""
    out = bytearray(MAGIC)
    for opcode, content in framed(data):
        body = content if opcode == Opcode.MESSAGE else content + b"pad"
        out += FRAME.pack(opcode, len(body)) + body
        if opcode != Opcode.FOOTER:
            for number in unknown:
                out += FRAME.pack(number, 5) + b"other"
    return bytes(out + MAGIC)


@pytest.mark.parametrize("chunks", [True, False])
@pytest.mark.parametrize("unknown", [(), (0x7F, 0x80, 0xFF)])
def test_padding_and_records_of_other_kinds(
    chunks: bool, unknown: tuple[int, ...], log_file: Path, track: Track, setup: FlightSetup, tmp_path: Path
) -> None:
    plain = copy(
        log_file, tmp_path / "copy.mcap", use_chunking=chunks, compression=CompressionType.NONE, enable_crcs=False
    )
    (tmp_path / "padded.mcap").write_bytes(padded(plain.read_bytes(), unknown))
    whole(tmp_path / "padded.mcap", track, setup)


@pytest.mark.parametrize("size", [0.3, 0.6, 0.999])
def test_messages_outside_chunks_are_not_believed_without_their_end(
    size: float, log_file: Path, tmp_path: Path
) -> None:
    data = copy(log_file, tmp_path / "copy.mcap", use_chunking=False, enable_data_crcs=True).read_bytes()
    cut = tmp_path / "cut.mcap"
    end = data.rindex(FRAME.pack(Opcode.DATA_END, 4))
    cut.write_bytes(data[: int(size * end)])
    with pytest.raises(LogError, match=r"outside chunks, from byte .* on, cannot be checked: the file ends at byte"):
        read_log(cut)
    flipped = bytearray(data)
    flipped[int(size * end)] ^= 4
    cut.write_bytes(flipped)
    with pytest.raises(LogError, match=r"cannot be checked: the data section is damaged|its CRC differs"):
        read_log(cut)


def test_a_chunk_that_is_flipped_into_a_message_is_no_message(log_file: Path, track: Track, tmp_path: Path) -> None:
    data = bytearray(log_file.read_bytes())
    at, places = len(MAGIC), []
    for opcode, content in framed(bytes(data)):
        if opcode == Opcode.CHUNK:
            places.append(at)
        at += FRAME.size + len(content)
    data[places[len(places) // 2]] = Opcode.MESSAGE
    path = tmp_path / "flipped.mcap"
    path.write_bytes(data)
    log = read_log(path)
    assert not log.complete
    assert "outside chunks" in log.problem
    assert len(log.track) < len(track)


@pytest.mark.parametrize("damage", ["cut", "size", "not lz4"])
def test_a_damaged_lz4_chunk_is_damage(damage: str, log_file: Path, tmp_path: Path) -> None:
    data = bytearray(copy(log_file, tmp_path / "copy.mcap", compression=CompressionType.LZ4).read_bytes())
    first = data.index(b"\x03\x00\x00\x00lz4") + 15
    if damage == "not lz4":
        data[first] ^= 0xFF
    elif damage == "size":
        data[first - 15 - 12] ^= 1
    else:
        data[first + 200] ^= 0x10
    path = tmp_path / "bad.mcap"
    path.write_bytes(data)
    with pytest.raises(LogError, match=r"decompress|CRC differs"):
        read_log(path)


def test_a_valid_container_that_is_no_flight_is_named(tmp_path: Path) -> None:
    path = tmp_path / "other.mcap"
    for chunked in (True, False):
        with path.open("wb") as out:
            writer = Writer(out, use_chunking=chunked)
            writer.start(profile="ros2", library="other")
            channel = writer.register_channel("/chatter", "json", writer.register_schema("Text", "jsonschema", b"{}"))
            writer.add_message(channel, 1, b"{}", 1)
            writer.finish()
        with pytest.raises(LogError, match=r"setup\.json"):
            read_log(path)


def test_a_log_without_chunks_can_be_recovered(
    log_file: Path, track: Track, setup: FlightSetup, tmp_path: Path
) -> None:
    """Its attachments and messages are ours again."""
    plain = copy(log_file, tmp_path / "copy.mcap", use_chunking=False, enable_data_crcs=True)
    # Its end after the data section is gone: the index.
    data = plain.read_bytes()
    plain.write_bytes(data[:-30])
    recovered = recover_log(plain)
    assert recovered is not None
    (tmp_path / "mended.mcap").write_bytes(recovered.data)
    same(read_log(tmp_path / "mended.mcap").track, track)
